"""One source for every input: wires by connections, by equal names, constants for what is left.

An input that its unit declares as optional, and that nothing drives, keeps its start value: it counts
among the constants, so it is shown and recorded like them. So does any input in an SSP archive, where
nothing is connected by equal names.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from ..plan import Fmu, Value, Variable, Wire
from ..scenario.load import Connection, Scenario
from ..scenario.measurement_units import conversion, measure_of
from ..scenario.yaml_lines import Key, dotted
from ..wording import fold, fold_sentences, hint, listed
from .parameters import origin, value_for

Input = tuple[str, str]  # unit, variable


def match(pattern: str, name: str) -> str | None:
    """Return what the `*` of a pattern stands for in a name, '' without `*`, None if they differ."""
    head, star, tail = pattern.partition("*")
    if not star:
        return "" if name == pattern else None
    fits = len(name) >= len(head) + len(tail) and name.startswith(head) and name.endswith(tail)
    return name[len(head) : len(name) - len(tail)] if fits else None


class Connector:
    """Finds every input's source.

    Problems go to the scenario's document, remarks to `notes`, where constants come from to `origins`.
    """

    def __init__(
        self,
        scenario: Scenario,
        fmus: Mapping[str, Fmu],
        replaced: Callable[[str], Fmu | None],
        notes: list[str],
        origins: Mapping[str, dict[str, str]],
    ) -> None:
        self._scenario = scenario
        self._fmus = fmus
        self._replaced = replaced
        self._notes = notes
        self._origins = origins
        self._found: list[tuple[Key, str]] = []
        self._outputs = {unit: {v.name: v for v in fmu.of("output")} for unit, fmu in fmus.items()}
        self._inputs = {unit: {v.name: v for v in fmu.of("input")} for unit, fmu in fmus.items()}

    def connect(self) -> tuple[list[Wire], dict[str, dict[str, Value]]]:
        """Return all wires, and each unit's constants."""
        wires = self._by_connections()
        ambiguous = self._by_names(wires)
        constants = self._constants(wires)
        fed = wires.keys() | constants.keys() | ambiguous
        for unit, inputs in self._inputs.items():
            for name, variable in inputs.items():
                if (unit, name) in fed:
                    continue
                if (variable.optional or self._explicit(unit)) and variable.start is not None:
                    constants[(unit, name)] = variable.start
                    self._origins[unit][name] = "default"
                else:
                    self._report(("units", unit), self._undriven(unit, variable))
        fitted = [self._fitted(wire, key) for wire, key in wires.values()]
        self._note_units(wire for wire, key in wires.values() if self._scale(key) is None)
        for key, sentence in fold_sentences(self._found):
            self._scenario.document.report(key, sentence)
        by_unit: dict[str, dict[str, Value]] = {unit: {} for unit in self._fmus}
        for (unit, name), value in constants.items():
            by_unit[unit][name] = value
        return fitted, by_unit

    def _explicit(self, unit: str) -> bool:
        """Return whether only the scenario's connections count for the inputs of a unit."""
        return self._scenario.explicit and unit not in self._scenario.replaced

    def _report(self, key: Key, sentence: str) -> None:
        self._found.append((key, sentence))

    def _by_connections(self) -> dict[Input, tuple[Wire, Key]]:
        """Return the wires that the scenario names, each with the key it comes from."""
        wires: dict[Input, tuple[Wire, Key]] = {}
        for i, connection in enumerate(self._scenario.connections):
            key: Key = ("connections", i)
            for wire in self._expand(connection, key):
                other, its_key = wires.setdefault((wire.target, wire.input), (wire, key))
                if other is not wire:
                    self._report(
                        key,
                        f"{wire.target}.{wire.input} has a source already, {other.source}.{other.output} "
                        f"by {dotted(its_key)}",
                    )
        return wires

    def _expand(self, connection: Connection, key: Key) -> list[Wire]:
        (source, from_pattern), (target, to_pattern) = connection.source, connection.target
        if source == target:
            self._report(key, f"connects {source} to itself")
            return []
        outputs = {part: n for n in self._outputs[source] if (part := match(from_pattern, n)) is not None}
        inputs = {part: n for n in self._inputs[target] if (part := match(to_pattern, n)) is not None}
        if not outputs:
            self._no_such((*key, "from"), source, from_pattern, "output")
        if not inputs:
            self._no_such((*key, "to"), target, to_pattern, "input")
        if not (outputs and inputs):
            return []
        if "*" in from_pattern and "*" not in to_pattern:
            self._report(key, f"a * in 'from' ({connection.source}) needs one in 'to' ({connection.target})")
            return []
        if "*" in from_pattern:
            pairs = [(outputs[part], n) for part, n in inputs.items() if part in outputs]
        else:
            pairs = [(from_pattern, n) for n in inputs.values()]
        if not pairs:
            given, wanted = listed(outputs, last="or"), listed(inputs, last="or")
            self._report(key, f"nothing matches: in 'from' the * can be {given}, in 'to' {wanted}")
        return [Wire(source, output, target, name) for output, name in pairs]

    def _no_such(self, key: Key, unit: str, pattern: str, kind: str) -> None:
        """Report a pattern without a match, or note it if the FMU that was replaced has one."""
        if self._had([unit], kind, pattern):
            self._notes.append(f"{dotted(key[:2])} is left out: {unit} has no {kind} {pattern!r} any more")
            return
        variable = self._fmus[unit].variables.get(pattern)
        if variable is not None:
            self._report(key, f"{unit}.{pattern} is no {kind}: its causality is {variable.causality}")
            return
        names = fold([v.name for v in self._fmus[unit].of(kind)])
        self._report(key, f"{unit} has no {kind} {pattern!r}{hint(pattern, names, lead='it has')}")

    def _had(self, units: Iterable[str], causality: str, pattern: str) -> bool:
        """Return whether an FMU that an option has replaced in one of the units has such a variable."""
        replaced = [self._replaced(unit) for unit in units if unit in self._scenario.replaced]
        return any(match(pattern, v.name) is not None for fmu in replaced if fmu for v in fmu.of(causality))

    def _by_names(self, wires: dict[Input, tuple[Wire, Key]]) -> set[Input]:
        """Add the wires of equal names; return the inputs that have more than one candidate."""
        ambiguous = set()
        for unit, inputs in self._inputs.items():
            for name in inputs:
                if self._explicit(unit):
                    break
                sources = [s for s, outputs in self._outputs.items() if name in outputs and s != unit]
                if (unit, name) in wires or not sources:
                    continue
                if len(sources) == 1:
                    wires[(unit, name)] = (Wire(sources[0], name, unit, name), ("units", unit))
                    continue
                ambiguous.add((unit, name))
                choices = listed(f"{source}.{name}" for source in sources)
                self._report(
                    ("units", unit),
                    f"{unit}.{name} has more than one source: {choices}; name one under 'connections'",
                )
        return ambiguous

    def _constants(self, wires: Mapping[Input, tuple[Wire, Key]]) -> dict[Input, Value]:
        """Return the constants, each of the most specific pattern: by name before by `*`."""
        values: dict[Input, Value] = {}
        givers: dict[Input, tuple[tuple[bool, bool], str]] = {}
        for pattern, raw in self._scenario.inputs.items():
            key = ("inputs", pattern)
            prefix, _, rest = pattern.partition(".")
            units, name_pattern = ([prefix], rest) if prefix in self._fmus else (list(self._fmus), pattern)
            found = [(u, n) for u in units for n in self._inputs[u] if match(name_pattern, n) is not None]
            if not found:
                self._no_such_input(key, pattern, name_pattern, units)
            rank = ("*" not in pattern, prefix in self._fmus)
            for target in found:
                unit, name = target
                if target in wires:
                    wire = wires[target][0]
                    driver = f"{wire.source}.{wire.output}"
                    self._report(
                        key,
                        f"{unit}.{name} is driven by {driver}: a constant is for inputs that no unit drives",
                    )
                    continue
                other_rank, other = givers.get(target, (rank, pattern))
                if other_rank > rank:
                    continue
                if other_rank == rank and other != pattern:
                    self._report(key, f"{unit}.{name} has another constant already, by inputs.{other}")
                    continue
                try:
                    values[target] = value_for(self._inputs[unit][name], raw)
                    givers[target] = (rank, pattern)
                    self._origins[unit][name] = origin(self._scenario.document, key)
                except ValueError as error:
                    self._report(key, f"{error}, for {unit}.{name}")
                    values[target] = raw
        return values

    def _no_such_input(self, key: Key, pattern: str, name_pattern: str, units: Iterable[str]) -> None:
        if self._had(units, "input", name_pattern):
            self._notes.append(f"inputs.{pattern} is left out: no unit has such an input after the swap")
            return
        names = fold(list(dict.fromkeys(n for unit in units for n in self._inputs[unit])))
        self._report(key, f"no input matches{hint(name_pattern, names, lead='there are')}")

    def _undriven(self, unit: str, variable: Variable) -> str:
        """Return the sentence for an input without a source."""
        choices = [
            f"{source}.{name}"
            for source, outputs in self._outputs.items()
            if source != unit
            for name in fold([n for n, v in outputs.items() if _fits(v, variable)])
        ]
        connect = f"connect {listed(choices, last='or')}, or give" if 0 < len(choices) <= 8 else "give"
        measure = f" [{variable.unit}]" if variable.unit else ""
        return (
            f"{unit}.{variable.name}{measure} has no source: no unit has an output of this name; "
            f"{connect} a constant under 'inputs'"
        )

    def _scale(self, key: Key) -> tuple[float, float] | None:
        """Return the gain and offset that the connection at `key` gives, None if it gives none."""
        return self._scenario.connections[key[1]].scale if key[0] == "connections" else None  # type: ignore[index]

    def _fitted(self, wire: Wire, key: Key) -> Wire:
        """Return a wire with what it does to numbers; report ends that do not fit."""
        source, target = self._outputs[wire.source][wire.output], self._inputs[wire.target][wire.input]
        between, given = _conversion(source, target), self._scale(key)
        scale = given or between
        differing = _difference(source, target, scale)
        if differing is not None:
            what, of, to = differing
            ends = f"{wire.source}.{wire.output} [{of}] to {wire.target}.{wire.input} [{to}]"
            way_out = "; a connection with a gain takes plain numbers" if what == "units" else ""
            self._report(key, f"cannot connect {ends}: the {what} differ{way_out}")
            return wire
        assert scale is not None
        whole = source.type == "Integer" and all(x.is_integer() for x in scale)
        if given and source.type != "Real" and not whole:
            self._report(
                key, f"gain and offset are for Real, and whole ones for Integer, not for {source.type}"
            )
        if given and between not in (None, (1.0, 0.0), given):
            self._notes.append(
                f"{dotted(key)}: its gain and offset stand in place of the conversion "
                f"from {source.unit} to {target.unit}"
            )
        return replace(wire, gain=scale[0], offset=scale[1])

    def _note_units(self, wires: Iterable[Wire]) -> None:
        """Note ends without a unit, and units that an FMU defines otherwise than their name says."""
        missing: dict[str, list[str]] = {}
        odd: dict[tuple[str, str], None] = {}
        for wire in wires:
            ends = (
                (wire.source, self._outputs[wire.source][wire.output]),
                (wire.target, self._inputs[wire.target][wire.input]),
            )
            lacking = [(unit, v.name) for unit, v in ends if v.type == "Real" and v.unit is None]
            if len(lacking) == 1:
                missing.setdefault(lacking[0][0], []).append(lacking[0][1])
            odd.update({(unit, v.unit): None for unit, v in ends if v.unit and _contradicts_its_name(v)})
        for unit, names in missing.items():
            text = listed(fold(list(dict.fromkeys(names))))
            self._notes.append(f"{unit} ({self._fmus[unit].name}) declares no unit for {text}: not checked")
        for unit, measure in odd:
            who = f"{unit} ({self._fmus[unit].name})"
            self._notes.append(f"{who} defines {measure} otherwise than usual: taken as it defines it")

    def recorded(self) -> tuple[tuple[str, str], ...]:
        """Return what is recorded: (unit, output), in the order of the scenario's list or units.

        Text is not: a table of results holds numbers.
        """
        numbers = {
            unit: [name for name, v in outputs.items() if v.type != "String"]
            for unit, outputs in self._outputs.items()
        }
        if self._scenario.record is None:
            return tuple((unit, name) for unit, names in numbers.items() for name in names)
        chosen: dict[tuple[str, str], None] = {}
        for i, (unit, pattern) in enumerate(self._scenario.record):
            units = list(numbers) if unit == "*" else [unit]
            found = [(u, n) for u in units for n in numbers[u] if match(pattern, n) is not None]
            chosen.update(dict.fromkeys(found))
            if found:
                continue
            if self._had(units, "output", pattern):
                self._notes.append(f"record[{i}] is left out: {unit} has no output {pattern!r} any more")
                continue
            names = fold(list(dict.fromkeys(n for u in units for n in numbers[u])))
            who = "no unit has an" if unit == "*" else f"{unit} has no"
            sentence = f"{who} output {pattern!r} to record{hint(pattern, names, lead='there are')}"
            self._scenario.document.report(("record", i), sentence)
        return tuple(chosen)


def _conversion(source: Variable, target: Variable) -> tuple[float, float] | None:
    """Return gain and offset from one end's unit to the other's, None if they do not fit.

    A unit that an end does not declare is taken to be the other's.
    """
    if source.unit is None or target.unit is None:
        return 1.0, 0.0
    if (source.unit, source.definition) == (target.unit, target.definition):
        return 1.0, 0.0
    measures = measure_of(source.unit, source.definition), measure_of(target.unit, target.definition)
    if measures[0] is None or measures[1] is None:
        return (1.0, 0.0) if source.unit == target.unit else None
    return conversion(measures[0], measures[1])


def _contradicts_its_name(variable: Variable) -> bool:
    usual, defined = measure_of(variable.unit), measure_of(variable.unit, variable.definition)
    return usual is not None and usual != defined


def _difference(
    source: Variable, target: Variable, scale: tuple[float, float] | None
) -> tuple[str, str | None, str | None] | None:
    """Return in what two ends differ that cannot be connected, and what each has of it."""
    if source.type != target.type:
        return "types", source.type, target.type
    if scale is None:
        return "units", source.unit, target.unit
    items = source.items or {}, target.items or {}
    if source.type == "Enumeration" and not items[0].items() <= items[1].items():
        of, to = (listed(f"{name} {value}" for name, value in each.items()) for each in items)
        return "enumerations", of, to
    return None


def _fits(source: Variable, target: Variable) -> bool:
    alike = source.type == target.type and (source.unit is None) == (target.unit is None)
    return alike and _conversion(source, target) is not None
