"""Constants and time series of inputs: the most specific pattern of the scenario wins, then facts."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from yawbench.fmus.fmu import Value, Variable
from yawbench.foundation.errors import InvalidValueError, ScenarioError, code_of, text_of
from yawbench.foundation.messages import fold, hint, resolved, span

from ..plan import Given, InputSeries
from ..scenario.catalogue import YAML
from ..scenario.loader import LoadedScenario
from ..scenario.quantities import unit_of
from ..scenario.schema import SeriesSpec
from ..scenario.yaml_lines import KeyPath
from ..signal_names import SignalName
from .context import WiringContext, facts_of
from .domain import Domain, Measured
from .parameters import value_for, values_of_array

if TYPE_CHECKING:
    import numpy as np

    from ..recordings.recording_formats import FileColumn

Input = tuple[str, str]  # instance, variable
FACT, INPUTS, CHANGED_FACT, CHANGED_INPUTS = range(4)
"""Levels of precedence, ascending: an overridden fact beats the file, but not other overrides."""


@dataclass(frozen=True)
class Constant:
    """The constant or time series that the scenario gives to one input."""

    value: Value | InputSeries
    key: KeyPath
    given: Given[Any]
    of_instance: bool  # the key names the instance, so it takes precedence over equal names
    exact: bool  # the key is not a pattern
    precedence: int = INPUTS

    @property
    def rank(self) -> tuple[int, bool, bool]:
        """Sort key: by precedence, then names before patterns, then keys with the instance before others."""
        return self.precedence, self.exact, self.of_instance

    @property
    def of_fact(self) -> bool:
        """Whether it comes from a fact, which applies only to inputs that nothing drives."""
        return self.precedence in (FACT, CHANGED_FACT)


def constants(system: WiringContext, domain: Domain) -> dict[Input, Constant]:
    """Return the constant of each input, from the scenario's `inputs` and facts."""
    scenario, fmus, inputs = system.scenario, system.fmus, system.inputs
    read = None
    if any(isinstance(given.value, SeriesSpec) for given in scenario.inputs.values()):
        read = _series_reader(system, domain.measured)
    by_input = dict(_of_facts(system))
    fact_changed = any(constant.precedence == CHANGED_FACT for constant in by_input.values())
    for pattern, given in scenario.inputs.items():
        key: KeyPath = ("inputs", pattern)
        prefix, name_pattern = SignalName.parse_input(pattern, fmus)
        of_instance = prefix in fmus
        instances = [prefix] if of_instance else list(fmus)
        parts = {
            (u, name): part
            for u in instances
            for part, name in system.matching_inputs(u, name_pattern).items()
        }
        each: dict[Input, Given[Any]] = dict.fromkeys(parts, given)
        if not parts:
            arrays = [(u, e) for u in instances if (e := fmus[u].elements_of(name_pattern, "input"))]
            try:
                for u, elements in arrays:
                    each |= {(u, name): one for name, one in values_of_array(elements, given).items()}
            except ValueError as error:
                system.report(given.where, str(error))
                continue
            parts = dict.fromkeys(each, "")
        if not parts and system.had(instances, name_pattern, "input"):
            system.left_out(f"inputs.{pattern}", "no instance has such an input after the swap")
        elif not parts:
            names = fold(list(dict.fromkeys(name for instance in instances for name in inputs[instance])))
            system.report(
                given.where,
                f"no input matches{hint(name_pattern, names, lead='there are')}",
                "variable-unknown",
            )
        for (instance, name), part in parts.items():
            variable, own = inputs[instance][name], each[instance, name]
            value: Value | InputSeries = 0
            try:
                if isinstance(own.value, SeriesSpec):
                    assert read is not None
                    value = read(own.value, part, variable)
                else:
                    value = value_for(variable, own.value)
            except ValueError as error:
                system.report(given.where, f"{error}, for {instance}.{name}", code_of(error))
            precedence = CHANGED_INPUTS if fact_changed and given.changed else INPUTS
            exact = "*" not in pattern and own is given  # an element takes precedence over its array
            constant = Constant(value, key, own, of_instance, exact, precedence)
            other = by_input.setdefault((instance, name), constant)
            if other.rank < constant.rank:
                by_input[instance, name] = constant
            elif other.of_fact and of_instance:  # the overridden fact replaces a constant of the instance
                by_input[instance, name] = replace(other, of_instance=True)
            elif other.rank == constant.rank and other is not constant:
                system.report(
                    given.where,
                    f"{instance}.{name} has another constant already, by inputs.{other.key[1]}",
                    "input-ambiguous",
                )
    return by_input


def _of_facts(system: WiringContext) -> Iterator[tuple[Input, Constant]]:
    """Yield the constants of inputs that come from facts."""
    scenario, known = system.scenario, system.inputs
    for name, fact, given in facts_of(scenario):
        takers = [
            (instance, variable)
            for instance, inputs in known.items()
            for variable in fact.inputs
            if variable in inputs
        ]
        if fact.inputs and not takers:
            if not given.changed and any(system.had(known, variable, "input") for variable in fact.inputs):
                system.left_out(name, "no instance has such an input after the swap")
            else:
                system.report(given.where, f"no instance has an input {name}", "variable-unknown")
        refused: dict[str, list[str]] = {}
        for instance, variable in takers:
            value = given.value
            try:
                value = value_for(known[instance][variable], value)
            except ValueError as error:
                refused.setdefault(str(error), []).append(f"{instance}.{variable}")
            precedence = CHANGED_FACT if given.changed else FACT
            yield (instance, variable), Constant(value, (name,), given, False, True, precedence)
        everywhere = [len(inputs) for inputs in refused.values()] == [len(takers)]
        for sentence, inputs in refused.items():
            for variable in inputs:
                system.report(given.where, sentence if everywhere else f"{sentence}, for {variable}")


Reader = Callable[[SeriesSpec, str, Variable], InputSeries]
"""Callback: (specification, part matched by the `*` of its key, input) -> time series."""
RECORDED = 100
"""Rows from which a file that no measurement file describes counts as recorded. Chosen: fewer are written by
hand, with times as far apart as a ramp is long."""


def _series_reader(system: WiringContext, measured: Callable[[Path], Measured]) -> Reader:
    """Return a reader for the time series of a scenario, which reads every file once, and notes gaps in them.

    The reader raises ValueError if the file or a column is missing or unusable, the unit is incompatible, or
    the times do not cover the run.
    """
    scenario = system.scenario
    # NumPy takes long to import
    from ..recordings.clocks import seconds_of
    from ..recordings.gaps import Gap, gaps_in
    from ..recordings.recording_formats import ColumnFile, reading_series

    asked: dict[str, list[str]] = {}

    @cache
    def opened(file: str) -> ColumnFile | Measured:
        path = Path(os.path.normpath(scenario.path.parent / file))
        if path.suffix in YAML:
            return measured(path)
        with reading_series(path):
            return ColumnFile(path, asked[file])

    def column_of(spec: SeriesSpec, name: str) -> FileColumn:
        file = opened(spec.file)
        if not isinstance(file, ColumnFile):
            return file.column(name, spec.segment)
        if spec.segment is not None:
            raise ValueError(f"{spec.file} has no segments: only measurement files have")
        return file.column(name, spec.time)

    def gaps_of(spec: SeriesSpec, name: str, times: np.ndarray, held: bool) -> list[Gap]:
        """Return the gaps of a column during the run; tables written by hand or of held values have none."""
        file = opened(spec.file)
        found: tuple[Gap, ...] = ()
        if not isinstance(file, ColumnFile):
            later = 0.0 if spec.begin is None else float(scenario.start_time - spec.begin)
            found = tuple(gap.later(later) for gap in file.gaps(name, spec.segment))
        elif not held and len(times) >= RECORDED:
            found = gaps_in(times)
        start, stop = float(scenario.start_time), float(scenario.stop_time)
        return [gap for gap in found if gap.overlaps(start, stop)]

    def read(spec: SeriesSpec, part: str, variable: Variable) -> InputSeries:
        name = (spec.column or variable.name).replace("*", part)
        asked.setdefault(spec.file, [spec.time, name])
        try:
            file = opened(spec.file)
        except ScenarioError as error:
            raise InvalidValueError(text_of(error.diagnostics), code=error.code) from None
        with reading_series(spec.file):
            column = column_of(spec, name)
            times, column = _taken(seconds_of(column.times, column.time_unit, f"time {spec.time!r}"), column)
            if spec.begin is not None:
                times = times - float(spec.begin - scenario.start_time)
            values = _values(column, name, variable)
            _check_times(times, scenario, spec)
        held = spec.interpolation == "held" or variable.type != "Real"
        how = "holds the value before it" if held else "is interpolated"
        for gap in gaps_of(spec, name, times, held):
            words = f"{spec.file}: {name} has no samples from {gap} of the run, and {how} there"
            if all(note.message != words for note in system.notes):  # once for all wheels
                system.note("series-gap", words, "warning")
        return InputSeries(spec.file, name, file.sha256, held, times, values)

    return read


def _taken(times: np.ndarray, column: FileColumn) -> tuple[np.ndarray, FileColumn]:
    """Return times and column without the rows that have no time or no value."""
    missing = times != times
    if column.values.dtype.kind in "fO":
        missing = missing | [cell is None or cell != cell for cell in column.values.tolist()]
    if not missing.any() or missing.all():
        return times, column
    return times[~missing], column._replace(values=column.values[~missing])


def _values(column: FileColumn, name: str, variable: Variable) -> np.ndarray:
    """Convert the values of a column to the type and unit of a variable."""
    import numpy as np

    from ..recordings.recording_formats import numbers_in

    if variable.type == "Real":
        wanted = unit_of(variable)
        numbers = numbers_in(column.values, column.unit, wanted, variable.unit or "none", f"column {name!r}")
        for extreme in (numbers.min(), numbers.max()):
            value_for(variable, float(extreme))
        return numbers
    taken = np.empty(len(column.values), dtype=object)
    for i, cell in enumerate(column.values.tolist()):
        try:
            taken[i] = value_for(variable, _plain(cell, variable))
        except ValueError as error:  # noqa: PERF203 - the first is told
            raise ValueError(f"column {name!r}: value {i + 1} {error}") from None
    return taken


def _plain(cell: Any, variable: Variable) -> Value:
    """Return a cell as in a scenario: files have whole numbers as floats, and booleans as 0 and 1."""
    if variable.type == "Boolean" and cell in (0, 1):
        return bool(cell)
    return int(cell) if isinstance(cell, float) and cell.is_integer() else cell


def _check_times(times: np.ndarray, scenario: LoadedScenario, spec: SeriesSpec) -> None:
    import numpy as np

    back = np.flatnonzero(np.diff(times) <= 0)
    if back.size:
        at = int(back[0]) + 1
        after, before = resolved(times[at], times[at - 1])
        raise ValueError(f"time must increase: {after} s follows {before} s (value {at + 1})")
    if spec.extrapolate == "hold":
        return
    start, stop = float(scenario.start_time), float(scenario.stop_time)
    slack = 1e-9 * max(abs(start), abs(stop))
    last = float(times[-1])
    if spec.interpolation == "held" and len(times) > 1:
        last += float(times[-1] - times[-2])  # the last value holds as long as the previous one
    if times[0] > start + slack or last < stop - slack:
        raise ValueError(
            f"covers {span(times[0], times[-1])} s of a run from {span(start, stop)} s; "
            "'extrapolate: hold' would hold its ends"
        )
