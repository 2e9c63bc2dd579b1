"""The constants and time series that the scenario gives to inputs, each of the most specific pattern."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from ..plan import Fmu, Series, Value
from ..scenario.load import Scenario
from ..scenario.schema import SeriesSpec
from ..scenario.yaml_lines import Key
from ..wording import fold, hint
from .parameters import origin, value_for
from .patterns import Replaced, had, matching
from .series import series_reader

Input = tuple[str, str]  # unit, variable


@dataclass(frozen=True)
class Constant:
    """What the scenario gives to one input."""

    value: Value | Series
    key: Key
    origin: str
    of_unit: bool  # the key names the unit, so it goes before equal names
    exact: bool  # the key is no pattern

    @property
    def rank(self) -> tuple[bool, bool]:
        """By name before by `*`, then with the unit before without."""
        return self.exact, self.of_unit


def constants(
    scenario: Scenario,
    fmus: Mapping[str, Fmu],
    replaced: Replaced,
    notes: list[str],
    problems: list[tuple[Key, str]],
) -> dict[Input, Constant]:
    """Return what `inputs` gives to each input; problems and remarks go to the two lists."""
    found: dict[Input, Constant] = {}
    read = series_reader(scenario)
    inputs = {unit: {v.name: v for v in fmu.of("input")} for unit, fmu in fmus.items()}
    for pattern, raw in scenario.inputs.items():
        key: Key = ("inputs", pattern)
        prefix, _, rest = pattern.partition(".")
        of_unit = prefix in fmus
        units, name_pattern = ([prefix], rest) if of_unit else (list(fmus), pattern)
        parts = {(u, name): part for u in units for part, name in matching(name_pattern, inputs[u]).items()}
        if not parts and had(scenario, replaced, units, name_pattern, "input"):
            notes.append(f"inputs.{pattern} is left out: no unit has such an input after the swap")
        elif not parts:
            problems.append((key, f"no input matches{_alike(name_pattern, units, fmus)}"))
        for (unit, name), part in parts.items():
            variable = fmus[unit].variables[name]
            value: Value | Series = 0
            try:
                value = read(raw, part, variable) if isinstance(raw, SeriesSpec) else value_for(variable, raw)
            except ValueError as error:
                problems.append((key, f"{error}, for {unit}.{name}"))
            one = Constant(value, key, origin(scenario.document, key), of_unit, "*" not in pattern)
            other = found.setdefault((unit, name), one)
            if other.rank < one.rank:
                found[unit, name] = one
            elif other.rank == one.rank and other is not one:
                problems.append(
                    (key, f"{unit}.{name} has another constant already, by inputs.{other.key[1]}")
                )
    return found


def _alike(pattern: str, units: Iterable[str], fmus: Mapping[str, Fmu]) -> str:
    names = fold(list(dict.fromkeys(v.name for unit in units for v in fmus[unit].of("input"))))
    return hint(pattern, names, lead="there are")
