"""Constants and time series of inputs: the most specific pattern of the scenario wins, then facts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from ..errors import code_of
from ..messages import fold, hint
from ..names import SignalName, matching
from ..plan import InputSeries, Value, ValueOrigin
from ..scenario.scenario_schema import SeriesSpec
from ..scenario.yaml_lines import KeyPath
from .context import WiringContext, facts_of
from .parameters import origin, value_for

Input = tuple[str, str]  # instance, variable


FACT, INPUTS, CHANGED_FACT, CHANGED_INPUTS = range(4)
"""Levels of precedence, ascending: an overridden fact beats the file, but not other overrides."""


@dataclass(frozen=True)
class Constant:
    """The constant or time series that the scenario gives to one input."""

    value: Value | InputSeries
    key: KeyPath
    origin: ValueOrigin
    of_unit: bool  # the key names the instance, so it takes precedence over equal names
    exact: bool  # the key is not a pattern
    level: int = INPUTS

    @property
    def rank(self) -> tuple[int, bool, bool]:
        """Precedence: by level, then names before patterns, then keys with the instance before others."""
        return self.level, self.exact, self.of_unit

    @property
    def of_fact(self) -> bool:
        """Whether it comes from a fact, which applies only to inputs that nothing drives."""
        return self.level in (FACT, CHANGED_FACT)


def constants(system: WiringContext) -> dict[Input, Constant]:
    """Return the constant of each input, from the scenario's `inputs` and facts."""
    scenario, fmus, inputs = system.scenario, system.fmus, system.inputs
    read = None
    if any(isinstance(raw, SeriesSpec) for raw in scenario.inputs.values()):
        from .series import series_reader  # needs numpy, which takes long to import

        read = series_reader(scenario)
    found = dict(_of_facts(system))
    fact_changed = any(one.level == CHANGED_FACT for one in found.values())
    for pattern, raw in scenario.inputs.items():
        key: KeyPath = ("inputs", pattern)
        prefix, name_pattern = SignalName.parse_input(pattern, fmus)
        of_unit = prefix in fmus
        instances = [prefix] if of_unit else list(fmus)
        parts = {
            (u, name): part for u in instances for part, name in matching(name_pattern, inputs[u]).items()
        }
        if not parts and system.had(instances, name_pattern, "input"):
            system.note(
                "left-out-after-swap",
                f"inputs.{pattern} is left out: no unit has such an input after the swap",
            )
        elif not parts:
            names = fold(list(dict.fromkeys(name for instance in instances for name in inputs[instance])))
            system.report(
                key, f"no input matches{hint(name_pattern, names, lead='there are')}", "variable-unknown"
            )
        for (instance, name), part in parts.items():
            variable = inputs[instance][name]
            value: Value | InputSeries = 0
            try:
                if isinstance(raw, SeriesSpec):
                    assert read is not None
                    value = read(raw, part, variable)
                else:
                    value = value_for(variable, raw)
            except ValueError as error:
                system.report(key, f"{error}, for {instance}.{name}", code_of(error))
            level = CHANGED_INPUTS if fact_changed and scenario.document.override(key) else INPUTS
            given_by = origin(scenario, key)
            one = Constant(value, key, given_by, of_unit, "*" not in pattern, level)
            other = found.setdefault((instance, name), one)
            if other.rank < one.rank:
                found[instance, name] = one
            elif other.of_fact and of_unit:  # the overridden fact replaces a constant of the instance
                found[instance, name] = replace(other, of_unit=True)
            elif other.rank == one.rank and other is not one:
                system.report(
                    key,
                    f"{instance}.{name} has another constant already, by inputs.{other.key[1]}",
                    "input-ambiguous",
                )
    return found


def _of_facts(system: WiringContext) -> Iterator[tuple[Input, Constant]]:
    """Yield the constants of inputs that come from facts."""
    scenario, known = system.scenario, system.inputs
    for name, fact, raw, changed in facts_of(scenario):
        key: KeyPath = (name,)
        takers = [
            (instance, one) for instance, inputs in known.items() for one in fact.inputs if one in inputs
        ]
        if fact.inputs and not takers:
            if not changed and any(system.had(known, one, "input") for one in fact.inputs):
                system.note(
                    "left-out-after-swap", f"{name} is left out: no unit has such an input after the swap"
                )
            else:
                system.report(key, f"no unit has an input {name}", "variable-unknown")
        refused: dict[str, list[str]] = {}
        for instance, one in takers:
            value = raw
            try:
                value = value_for(known[instance][one], raw)
            except ValueError as error:
                refused.setdefault(str(error), []).append(f"{instance}.{one}")
            level = CHANGED_FACT if changed else FACT
            yield (instance, one), Constant(value, key, origin(scenario, key), False, True, level)
        everywhere = [len(inputs) for inputs in refused.values()] == [len(takers)]
        for sentence, inputs in refused.items():
            for one in inputs:
                system.report(key, sentence if everywhere else f"{sentence}, for {one}")
