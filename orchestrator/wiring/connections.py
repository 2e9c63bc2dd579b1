"""Finds the one source of every input, and the gain and offset of every wire.

Sources are, in this order: connections of the scenario, constants whose key names the instance, outputs of
the same name, other constants.

An input that its FMU declares as optional, and that nothing drives, keeps its start value: it is listed
among the constants, so it is shown and recorded like them. The same holds for any input in an SSP archive,
where nothing is connected by equal names, and, with a note, for an input of an FMU made elsewhere that no
output resembles.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import replace
from graphlib import CycleError
from itertools import pairwise

from yawbench.fmus.fmu import Variable
from yawbench.foundation.messages import fold, hint, listed
from yawbench.vocabulary.roles import role_in

from ..plan import PARAMETERS, Wire
from ..scenario.loader import Connection
from ..scenario.quantities import conversion, measure_of, parse_unit, unit_of
from ..scenario.yaml_lines import KeyPath, dotted
from ..signal_names import SignalName, alike, matching
from .constants import Constant, Input
from .context import WiringContext
from .order import in_order


class Connector:
    """Finds the source of every input.

    Args:
        system: the system that is connected.
        symbols: see `Domain`.
    """

    def __init__(self, system: WiringContext, symbols: Mapping[str, str]) -> None:
        self._system, self._symbols = system, symbols
        self._scenario = system.scenario
        self._fmus = system.fmus
        self._outputs, self._inputs = system.outputs, system.inputs
        self._report = system.report
        self._having: dict[str, list[str]] = {}  # name of an output -> instances that have it
        for instance, outputs in self._outputs.items():
            for name in outputs:
                self._having.setdefault(name, []).append(instance)
        self._preferring: dict[str, list[tuple[list[str], KeyPath]]] = {}  # instance -> lists of sources
        self._preferred: dict[str, list[tuple[str, KeyPath]]] = {}  # instance -> preferred sources, in order
        self._refused: set[Input] = set()  # not to be driven by equal names (`from: null`)
        self._fitting: dict[object, dict[str, list[str]]] = {}  # kind of an input -> see `_fitting_outputs`

    def connect(self, by_input: Mapping[Input, Constant]) -> tuple[list[Wire], list[Input]]:
        """Return all wires, and the inputs that keep their start values.

        Args:
            by_input: the constant of each input, which counts where no wire takes precedence.
        """
        wires = self._by_connections()
        self._put_in_order()
        own = {target for target, constant in by_input.items() if constant.of_instance}
        self._note_overruled(own - wires.keys())
        ambiguous = self._by_names(wires, own | self._refused)
        self._refuse_overruled(by_input, wires)
        fed = wires.keys() | by_input.keys() | ambiguous
        kept = []
        untold: dict[str, list[Variable]] = {}  # instance -> its inputs that nothing resembles
        for instance, inputs in self._inputs.items():
            for name, variable in inputs.items():
                if (instance, name) in fed:
                    continue
                if (variable.optional or self._explicit(instance)) and variable.start is not None:
                    kept.append((instance, name))
                elif self._keeps_start(instance, variable):
                    kept.append((instance, name))
                    untold.setdefault(instance, []).append(variable)
                else:
                    self._report(("units", instance), self._undriven(instance, variable), "input-undriven")
        self._note_untold(untold)
        fitted = [self._fitted(wire, key) for wire, key in wires.values()]
        self._note_units(wire for wire, key in wires.values() if self._scale(key) is None)
        return fitted, kept

    def _note_overruled(self, inputs: Set[Input]) -> None:
        """Note inputs with a constant that takes precedence over an output of the same name."""
        overruled: dict[Input, list[str]] = {}  # unit and source -> names
        for instance, name in inputs:
            sources = [] if self._explicit(instance) else self._sources(instance, name)[0]
            for source in sources[:1]:
                overruled.setdefault((instance, source), []).append(name)
        for (instance, source), names in sorted(overruled.items()):
            for name in fold([v for v in self._inputs[instance] if v in names]):
                self._system.note(
                    "wire-overruled",
                    f"{instance}.{name} has a value of its own: {source}.{name} does not drive it",
                )

    def _explicit(self, instance: str) -> bool:
        """Return whether inputs of an instance are connected by the scenario's connections only."""
        return self._scenario.explicit and instance not in self._scenario.replaced

    def _by_connections(self) -> dict[Input, tuple[Wire, KeyPath]]:
        """Return the wires of the scenario's connections, each with the key of its connection."""
        wires: dict[Input, tuple[Wire, KeyPath]] = {}
        for i, connection in enumerate(self._scenario.connections):
            key: KeyPath = ("connections", i)
            for wire in self._expand(connection, key):
                other, its_key = wires.setdefault((wire.target, wire.input), (wire, key))
                if other is not wire:
                    self._report(
                        key,
                        f"{wire.target}.{wire.input} has a source already, {other.source}.{other.output} "
                        f"by {dotted(its_key)}",
                        "input-ambiguous",
                    )
        return wires

    def _expand(self, connection: Connection, key: KeyPath) -> list[Wire]:
        """Return the wires of a connection; store lists of instances and null for `_by_names`."""
        ends = connection.source, connection.target
        if isinstance(ends[1], list):
            assert isinstance(ends[0], list)
            self._prefer(ends[0], ends[1], key)
            return []
        (target, to_pattern) = ends[1]
        single = ends[0] if isinstance(ends[0], SignalName) else None
        sources = [single.instance] if single else list(ends[0] or ())
        if target in sources:
            self._report(key, f"connects {target} to itself", "connection-invalid")
            return []
        inputs = self._system.matching_inputs(target, to_pattern)
        if single and (wires := self._between_arrays(single, ends[1], key)) is not None:
            return wires
        if not inputs:
            self._no_such((*key, "to"), target, to_pattern, "input")
        if ends[0] is None:
            self._refused.update((target, name) for name in inputs.values())
            return []
        from_pattern = single.variable if single else "*"
        self._refuse_twice(sources, (*key, "from"))
        matches = [(source, matching(from_pattern, self._outputs[source])) for source in sources]
        if single and not matches[0][1]:
            self._no_such((*key, "from"), single.instance, from_pattern, "output")
        outputs: dict[str, tuple[str, str]] = {}  # part -> first instance that has it, and output
        for source, named in matches:
            outputs = {part: (source, name) for part, name in named.items()} | outputs
        if not (outputs and inputs):
            return []
        if "*" in from_pattern and "*" not in to_pattern:
            self._report(
                key,
                f"a * in 'from' ({connection.source}) needs one in 'to' ({connection.target})",
                "connection-invalid",
            )
            return []
        if "*" in from_pattern:
            pairs = [(outputs[part], n) for part, n in inputs.items() if part in outputs]
        else:
            pairs = [(outputs[""], n) for n in inputs.values()]
        if not pairs:
            in_from, in_to = listed(outputs, last="or"), listed(inputs, last="or")
            self._report(
                key,
                f"nothing matches: in 'from' the * can be {in_from}, in 'to' {in_to}",
                "connection-matches-nothing",
            )
        return [Wire(source, output, target, name) for (source, output), name in pairs]

    def _between_arrays(self, source: SignalName, target: SignalName, key: KeyPath) -> list[Wire] | None:
        """Return the wires between two arrays of one size, None if no end is a whole array; report others."""
        if "*" in source.variable + target.variable:
            return None
        ends = (source, "output", self._outputs), (target, "input", self._inputs)
        scalars = [[v for v in (known[n.instance].get(n.variable),) if v] for n, _, known in ends]
        arrays = [self._fmus[n.instance].elements_of(n.variable, kind) for n, kind, _ in ends]
        outputs, inputs = (array or scalar for array, scalar in zip(arrays, scalars, strict=True))
        if not (any(arrays) and outputs and inputs):
            return None
        of, to = ([v.name[len(v.array) :] for v in end] for end in (outputs, inputs))
        if of != to:
            has, takes = (end[-1].strip("[]").replace(",", "x") or "one" for end in (of, to))
            sentence = (
                f"cannot connect {source} to {target}: the former has {has} elements, the latter {takes}"
            )
            self._report(key, sentence, "wiring-size-mismatch")
            return []
        return [
            Wire(source.instance, output.name, target.instance, element.name)
            for output, element in zip(outputs, inputs, strict=True)
        ]

    def _refuse_twice(self, names: list[str], key: KeyPath) -> None:
        if twice := next((name for name in names if names.count(name) > 1), None):
            self._report(key, f"names {twice} twice", "name-duplicate")

    def _prefer(self, sources: list[str], targets: list[str], key: KeyPath) -> None:
        """Store which sources instances prefer; report lists without any effect."""
        for end, names in (("from", sources), ("to", targets)):
            self._refuse_twice(names, (*key, end))
        for instance in targets:
            self._preferring.setdefault(instance, []).append((sources, key))
        ends = [(s, t) for s in sources for t in targets if s != t]
        if any(self._outputs[s].keys() & self._inputs[t].keys() for s, t in ends):
            return
        if self._scenario.replaced.keys() & {*sources, *targets}:
            self._system.left_out(dotted(key), "no names are equal any more")
            return
        from_names, to_names = listed(sources, last="or"), listed(targets, last="or")
        self._report(
            key,
            f"nothing matches: no output of {from_names} has the name of an input of {to_names}",
            "connection-matches-nothing",
        )

    def _put_in_order(self) -> None:
        """Sort the preferred sources of each instance into an order that agrees with all of its lists."""
        for instance, lists in self._preferring.items():
            keys: dict[str, KeyPath] = {}
            edges: dict[tuple[str, str], KeyPath] = {}
            for sources, key in lists:
                for source in sources:
                    keys.setdefault(source, key)
                for pair in pairwise(dict.fromkeys(sources)):
                    edges.setdefault(pair, key)
            try:
                order = in_order(keys, edges)
            except CycleError as error:
                order = list(keys)  # avoids further errors about this instance
                circle = [f"{a} to {b} ({dotted(edges[a, b])})" for a, b in pairwise(error.args[1])]
                self._report(
                    lists[-1][1], f"{instance} cannot prefer {listed(circle)}", "connection-circular"
                )
            self._preferred[instance] = [(source, keys[source]) for source in order]

    def _no_such(self, key: KeyPath, instance: str, pattern: str, kind: str) -> None:
        """Report a pattern without a match; only note it if the replaced FMU has a match."""
        if self._system.had([instance], pattern, kind):
            self._system.left_out(dotted(key[:2]), f"{instance} has no {kind} {pattern!r} any more")
            return
        fmu = self._fmus[instance]
        variable = fmu.variables.get(pattern)
        if variable is not None:
            more = f", and {variable.variability}" if variable.causality in PARAMETERS else ""
            sentence = f"{instance}.{pattern} is not an {kind}: its causality is {variable.causality}{more}"
            self._report(key, sentence, "variable-wrong-kind")
        elif pattern in fmu.refused:
            self._report(key, f"{instance}.{pattern} {fmu.refused[pattern]}", "variable-unsupported")
        else:
            likely = hint(pattern, fold([v.name for v in fmu.of(kind)]), lead="it has")
            self._report(key, f"{instance} has no {kind} {pattern!r}{likely}", "variable-unknown")

    def _by_names(self, wires: dict[Input, tuple[Wire, KeyPath]], taken: Set[Input]) -> set[Input]:
        """Add wires between equal names, except to inputs `taken`; return inputs with several candidates."""
        ambiguous = set()
        for instance, inputs in self._inputs.items():
            if self._explicit(instance):
                continue
            for name in inputs:
                if (instance, name) in wires or (instance, name) in taken:
                    continue
                names = [name, *(a for a, of in self._system.aliases[instance].items() if of == name)]
                output = next((known for known in names if self._sources(instance, known)[0]), name)
                sources, key = self._sources(instance, output)
                if len(sources) == 1:
                    wires[(instance, name)] = (Wire(sources[0], output, instance, name), key)
                elif sources:
                    ambiguous.add((instance, name))
                    choices = listed(f"{source}.{name}" for source in sources)
                    self._report(
                        key,
                        f"{instance}.{name} has more than one source: {choices}; "
                        "name one under 'connections'",
                        "input-ambiguous",
                    )
        return ambiguous

    def _sources(self, instance: str, name: str) -> tuple[list[str], KeyPath]:
        """Return the candidate instances for an input by its name, and the key responsible for them."""
        having = [source for source in self._having.get(name, ()) if source != instance]
        for preferred, key in self._preferred.get(instance, ()):
            if preferred in having:
                return [preferred], key
        return having, ("units", instance)

    def _refuse_overruled(
        self, by_input: Mapping[Input, Constant], wires: Mapping[Input, tuple[Wire, KeyPath]]
    ) -> None:
        """Report the constants of inputs with a wire.

        Facts are not reported: they apply to those inputs of theirs that nothing drives.
        """
        for target in [target for target in by_input if target in wires]:
            wire, constant = wires[target][0], by_input[target]
            if constant.of_fact:
                continue
            unless = "" if constant.of_instance else f", unless its key names {wire.target}"
            driven = f"{wire.target}.{wire.input} is driven by {wire.source}.{wire.output}"
            self._report(
                constant.given.where,
                f"{driven}: a constant is for inputs that no instance drives{unless}",
                "constant-overruled",
            )

    def _keeps_start(self, instance: str, variable: Variable) -> bool:
        """Return whether an input without a source may keep its start value: of an FMU made elsewhere.

        One that has the name of a role is made to be wired; and where an output resembles the input, it is
        more likely that a connection was forgotten.
        """
        fmu = self._fmus[instance]
        if variable.start is None or fmu.role or role_in(fmu.name):
            return False
        return not self._similar(instance, variable)

    def _note_untold(self, untold: Mapping[str, Sequence[Variable]]) -> None:
        for instance, inputs in untold.items():
            values = ", ".join(f"{v.name} = {v.start}{f' {v.unit}' if v.unit else ''}" for v in inputs)
            what, have = "input", "has no source and keeps its start value"
            if len(inputs) > 1:
                what, have = "inputs", "have no source and keep their start values"
            self._system.note("input-kept", f"{what} of {instance} {have}: {values}")

    def _similar(self, instance: str, variable: Variable) -> list[str]:
        """Return the outputs of other instances that resemble an input most."""
        shared = {
            f"{source}.{name}": alike(name, variable.name, self._symbols)
            for source, names in self._fitting_outputs(variable).items()
            if source != instance
            for name in names
        }
        most = max(shared.values(), default=0)
        return [output for output, words in shared.items() if words == most > 0]

    def _undriven(self, instance: str, variable: Variable) -> str:
        """Return the message for an input without a source."""
        choices = self._similar(instance, variable)
        connect = f"connect {listed(choices, last='or')}, or give" if 0 < len(choices) <= 8 else "give"
        measure = f" [{variable.unit}]" if variable.unit else ""
        return (
            f"{instance}.{variable.name}{measure} has no source: no instance has an output of this name; "
            f"{connect} a constant under 'inputs'"
        )

    def _fitting_outputs(self, target: Variable) -> dict[str, list[str]]:
        """Return the outputs that an input could take, those of four wheels as one with `*`, by unit."""
        kind = target.type, target.unit, target.definition
        if kind not in self._fitting:
            self._fitting[kind] = {
                source: fold([n for n, v in outputs.items() if fits(v, target)])
                for source, outputs in self._outputs.items()
            }
        return self._fitting[kind]

    def _scale(self, key: KeyPath) -> tuple[float, float] | None:
        """Return the gain and offset of the connection at `key`, None if it has none."""
        return self._scenario.connections[key[1]].scale if key[0] == "connections" else None  # type: ignore[index]

    def _fitted(self, wire: Wire, key: KeyPath) -> Wire:
        """Return a wire with its gain and offset; report incompatible ends."""
        source, target = self._outputs[wire.source][wire.output], self._inputs[wire.target][wire.input]
        between, scaling = conversion_between(source, target), self._scale(key)
        scale = scaling or between
        differing = difference(source, target, scale)
        if differing is not None:
            what, of, to = differing
            ends = f"{wire.source}.{wire.output} [{of}] to {wire.target}.{wire.input} [{to}]"
            way_out = "; a connection with a gain takes plain numbers" if what == "units" else ""
            self._report(key, f"cannot connect {ends}: the {what} differ{way_out}", DIFFERENCES[what])
            return wire
        assert scale is not None
        self._check_relative(wire, key, source, target)
        whole = source.type == "Integer" and all(x.is_integer() for x in scale)
        if scaling and target.type != "Real" and not whole:
            self._report(
                key,
                f"gain and offset are for Real, and whole ones for Integer, not for {source.type}",
                "value-wrong-type",
            )
        if scaling and between not in (None, (1.0, 0.0), scaling):
            self._system.note(
                "conversion-replaced",
                f"{dotted(key)}: its gain and offset replace the conversion "
                f"from {source.unit} to {target.unit}",
            )
        delayed = key[0] == "connections" and self._scenario.connections[key[1]].delay is not None  # type: ignore[index]
        if delayed and target.type != "Real":
            sentence = (
                f"a delay is for inputs of type Real, not for {wire.target}.{wire.input} [{target.type}]"
            )
            self._report(key, sentence, "value-wrong-type")
        if delayed and target.start is None:
            sentence = f"{wire.target}.{wire.input} has no start value to begin with, which a delay needs"
            self._report(key, sentence, "connection-invalid")
        return replace(wire, gain=scale[0], offset=scale[1], delayed=delayed)

    def _check_relative(self, wire: Wire, key: KeyPath, source: Variable, target: Variable) -> None:
        """Report a difference that meets an absolute quantity on a wire without a gain, see `mixed`."""
        how = None if self._scale(key) else mixed(source, target)
        if how is None:
            return
        ends = [f"{wire.source}.{wire.output} [{source.unit}]", f"{wire.target}.{wire.input} [{target.unit}]"]
        one, other = ends if source.relative else reversed(ends)
        sentence = f"{one} is a difference (relativeQuantity) and {other} is not"
        if how:
            sentence = (
                f"cannot connect {' to '.join(ends)}: {sentence}, so the offset of the units is ambiguous"
            )
            way = "; give the connection the gain and offset that are meant"
            self._report(key, sentence + way, "wiring-relative-mismatch")
        else:
            sentence += "; the number is passed on as it is"
            self._system.note("wiring-relative-mismatch", sentence, "warning")

    def _note_units(self, wires: Iterable[Wire]) -> None:
        """Note variables without a unit, and units that an FMU defines otherwise than usual."""
        missing: dict[str, list[str]] = {}
        odd: dict[tuple[str, str], None] = {}
        for wire in wires:
            ends = (
                (wire.source, self._outputs[wire.source][wire.output]),
                (wire.target, self._inputs[wire.target][wire.input]),
            )
            lacking = [(instance, v.name) for instance, v in ends if v.unit is None]
            if len(lacking) == 1 and all(v.type == "Real" for _, v in ends):
                missing.setdefault(lacking[0][0], []).append(lacking[0][1])
            odd.update(
                {(instance, v.unit): None for instance, v in ends if v.unit and contradicts_its_name(v)}
            )
        for instance, names in missing.items():
            what = f"declares no unit for {listed(fold(list(dict.fromkeys(names))))}: not checked"
            self._system.note("unit-missing", f"{instance} ({self._fmus[instance].name}) {what}")
        for instance, measure in odd:
            what = f"defines {measure} otherwise than usual: taken as it defines it"
            self._system.note("unit-unusual", f"{instance} ({self._fmus[instance].name}) {what}")


def conversion_between(source: Variable, target: Variable) -> tuple[float, float] | None:
    """Return gain and offset between the units of two variables, None if the units are incompatible.

    A variable without a unit is taken to have that of the other.
    """
    ends = (source.unit, source.definition), (target.unit, target.definition)
    if source.unit is None or target.unit is None or ends[0] == ends[1]:
        return 1.0, 0.0
    of, to = unit_of(source), unit_of(target)
    if of is None or to is None:
        return (1.0, 0.0) if source.unit == target.unit else None
    return conversion(of, to)


_KELVIN = parse_unit("K")


def mixed(source: Variable, target: Variable) -> str | None:
    """Return how a difference meets an absolute quantity: "offset" if a conversion between them is ambiguous.

    "" if their units have no offset between them, None where it makes no difference: both ends are of the
    same kind, or their quantity has no units with an offset.
    """
    of, to = (measure_of(v.unit, v.definition) for v in (source, target))
    if source.relative == target.relative or of is None or to is None or of.powers != to.powers:
        return None
    if of.offset != to.offset:
        return "offset"
    return "" if of.offset or of.powers == _KELVIN.powers else None


DIFFERENCES = {
    "types": "wiring-type-mismatch",
    "units": "wiring-unit-mismatch",
    "enumerations": "wiring-enumeration-mismatch",
}
"""Property in which the ends of a wire differ -> code."""


def contradicts_its_name(variable: Variable) -> bool:
    usual, defined = measure_of(variable.unit), measure_of(variable.unit, variable.definition)
    return usual is not None and usual != defined


LOSSLESS = {("Integer", "Real"), ("Boolean", "Real"), ("Integer", "Enumeration"), ("Enumeration", "Integer")}
"""Types of output and input that differ, and whose wires convert without loss: false and true are 0 and 1, an
Integer that is the number of an item is that item."""


def compatible(source: Variable, target: Variable) -> bool:
    """Return whether the type of an output can feed that of an input."""
    return source.type == target.type or (source.type, target.type) in LOSSLESS


def difference(
    source: Variable, target: Variable, scale: tuple[float, float] | None
) -> tuple[str, str | None, str | None] | None:
    """Return why two variables cannot be connected (what differs, the source's, the target's), else None."""
    if not compatible(source, target):
        return "types", source.type, target.type
    if scale is None:
        return "units", source.unit, target.unit
    if target.type != "Enumeration":
        return None
    known = target.items or {}
    if source.type == "Enumeration":
        sent = source.items or {}
        return None if sent.items() <= known.items() else ("enumerations", _listed(sent), _listed(known))
    if source.variability == "constant" and source.start is not None and source.start not in known.values():
        return "enumerations", str(source.start), _listed(known)
    return None


def _listed(items: Mapping[str, int]) -> str:
    return listed(f"{name} {value}" for name, value in items.items())


def fits(source: Variable, target: Variable) -> bool:
    alike_in_units = (source.unit is None) == (target.unit is None)
    return alike_in_units and compatible(source, target) and conversion_between(source, target) is not None
