"""Signal pool: all values of a run in one array of outputs and one of inputs; injects faults into them.

The pool stores, one after the other, the outputs of all instances at their last step (`now`), the same at
the step before (`before`), samples of fast sources kept for slow instances (`kept`), the constants of
undriven inputs, and the time. So every value that an input needs, and every row of the results, is one
indexed read of one array. Instances of period 1 come first: what they need at once is contiguous. Values
that are not Real live in a separate dictionary, which costs nothing if there are no such wires. If such an
output feeds a Real input, its samples are also in the array, after those of its instance's Real outputs,
and are coupled as these are.

Faults disturb an instance's outputs after they are read, or its inputs before they are set. An output is
disturbed as of the time of its sample, so all receivers and the results get the same faulty value. An input
is disturbed as of the time that it is taken for (see `coupling_algorithms`), after the coupling has combined
several samples into one value. At initialization both are disturbed as of the start, however many passes it
takes: calling a fault twice for the same time discards its first observation. What each kind does to a value
is in `fault_kinds`.
"""

from __future__ import annotations

import ctypes
import functools
import itertools
import math
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np

from yawbench.fmus.fmu import Value, Variable, integer_limits
from yawbench.foundation.errors import SimulationError
from yawbench.foundation.messages import listed

from ..coupling_algorithms import ALGORITHMS, WireTiming
from ..fault_kinds import KINDS, Disturbance, LinearDisturbance
from ..plan import Instance, Plan, Wire
from .compiled_loop import Kind, OperationData
from .instance import FmuInstance, Status, StepCalls
from .log import OK

EXACT = 2.0**53
"""Whole numbers up to this are exact in a Real."""


@dataclass
class InstanceSlot:
    """An instance with its variables, its views of the pool, its faults and its step calls."""

    instance: Instance
    fmu_instance: FmuInstance
    position: int  # in the evaluation order
    inputs: list[Variable]  # Real and driven, in declared order
    wires: list[Wire | None]  # that drive the inputs; None: a constant
    outputs: list[Variable]  # Real and needed, in declared order
    other_inputs: list[tuple[Variable, Wire | None]]  # not Real; None: a constant
    other_outputs: list[Variable]
    converted: list[Variable]  # of `other_outputs`, those that feed a Real input
    sources: np.ndarray = field(default_factory=lambda: np.empty(0, np.intp))  # pool index per input
    kept: np.ndarray = field(default_factory=lambda: np.empty(0))  # pool view, one per input
    kept_at: int = 0  # pool index of kept[0]
    u: np.ndarray = field(default_factory=lambda: np.empty(0))  # view of the array of inputs
    y: np.ndarray = field(default_factory=lambda: np.empty(0))  # view of the outputs in the pool
    samples: np.ndarray = field(default_factory=lambda: np.empty(0))  # `y`, then the converted outputs
    samples_before: np.ndarray = field(default_factory=lambda: np.empty(0))
    output_faults: FaultInjector | None = None
    input_faults: FaultInjector | None = None
    calls: StepCalls = field(init=False)

    @functools.cached_property
    def scale(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Gain and offset of each input, None if no wire converts.

        Inputs that are not converted have 1 and -0.0, which preserve every number, even the sign of zero.
        """
        if not any(wire and wire.converts for wire in self.wires):
            return None
        pairs = [(w.gain, w.offset) if w and w.converts else (1.0, -0.0) for w in self.wires]
        gains, offsets = np.array(pairs).T.copy()
        return gains, offsets

    @functools.cached_property
    def starts(self) -> dict[int, float]:
        """Start values of the inputs whose wires have a declared delay, by their index."""
        delayed = [
            (i, v) for i, (v, w) in enumerate(zip(self.inputs, self.wires, strict=True)) if w and w.delayed
        ]
        return {i: float(v.start) for i, v in delayed if v.start is not None}

    @property
    def name(self) -> str:
        return self.instance.name

    @property
    def driven(self) -> bool:
        """Whether any Real input may change during a run."""
        return any(self.wires) or any(v.name in self.instance.series for v in self.inputs)

    @functools.cached_property
    def sampled(self) -> bool:
        """Whether it is a sampled system: it has outputs and all of them are discrete."""
        outputs = self.instance.fmu.of("output")
        return bool(outputs) and all(v.discrete for v in outputs)

    @functools.cached_property
    def feedthrough(self) -> frozenset[str] | None:
        """Inputs on which outputs depend directly; None if an output may depend on any of them."""
        depending = [v.depends_on for v in self.instance.fmu.of("output")]
        return None if None in depending else frozenset(itertools.chain(*filter(None, depending)))

    def direct(self, variable: Variable) -> bool:
        """Return whether an input is needed at the end of the step (see `coupling_algorithms`)."""
        if variable.discrete or self.sampled:
            return True
        return self.feedthrough is None or variable.name in self.feedthrough


class SignalPool:
    """The arrays of a run and the slots of its instances, in evaluation order."""

    def __init__(self, plan: Plan, fmu_instances: Mapping[str, FmuInstance]) -> None:
        self.plan = plan
        self.slots = _make_slots(plan, fmu_instances)
        self.of = {s.name: s for s in self.slots}
        self.placed = sorted(self.slots, key=lambda s: s.instance.period > 1)
        n_out = sum(len(s.outputs) + len(s.converted) for s in self.slots)
        n_in = sum(len(s.inputs) for s in self.slots)
        self.n_outputs = n_out
        self.pool = np.zeros(2 * n_out + 2 * n_in + 1)
        self.now = self.pool[:n_out]
        self.inputs = np.full(n_in, np.nan)
        self.index: dict[tuple[str, str], int] = {}  # (instance, Real output) -> index of its last sample
        self.converted: dict[tuple[str, str], int] = {}  # the same for outputs that are converted to Real
        self.others: dict[tuple[str, str], Value] = {}
        self._allowed = _allowed_numbers(plan)
        self.time_at = len(self.pool) - 1
        self.time = ctypes.c_double.from_buffer(self.pool.data, 8 * self.time_at)
        self.time.value = plan.time(0)
        self._place_outputs()
        self._place_inputs(2 * n_out, 2 * n_out + n_in)
        for s in self.slots if plan.faults else ():
            s.output_faults = faulting(self, s, of_output=True)
            s.input_faults = faulting(self, s, of_output=False)

    def _place_outputs(self) -> None:
        at = 0
        for s in self.placed:
            end = at + len(s.outputs)
            s.y = self.pool[at:end]
            self.index.update(((s.name, v.name), at + i) for i, v in enumerate(s.outputs))
            self.converted.update(((s.name, v.name), end + i) for i, v in enumerate(s.converted))
            end += len(s.converted)
            s.samples = self.pool[at:end]
            s.samples_before = self.pool[self.n_outputs + at : self.n_outputs + end]
            at = end

    def _place_inputs(self, kept_at: int, constants_at: int) -> None:
        at = 0
        for s in self.placed:
            end = at + len(s.inputs)
            s.u = self.inputs[at:end]
            s.kept = self.pool[kept_at + at : kept_at + end]
            s.kept_at = kept_at + at
            sources = []
            for i, (variable, wire) in enumerate(zip(s.inputs, s.wires, strict=True)):
                if wire is None:
                    self.pool[constants_at + at + i] = float(s.instance.constants[variable.name])
                    sources.append(constants_at + at + i)
                else:
                    key = wire.source, wire.output
                    sources.append(self.index[key] if key in self.index else self.converted[key])
            s.sources = np.array(sources, np.intp)
            at = end

    def taken(self, s: InstanceSlot) -> np.ndarray:
        """Return the Real inputs of an instance, computed from the current outputs, at initialization.

        An input whose wire has a declared delay has its start value: there is nothing earlier.
        """
        values: np.ndarray = self.pool[s.sources]
        values = values if s.scale is None else values * s.scale[0] + s.scale[1]
        values[list(s.starts)] = list(s.starts.values())
        if s.input_faults is not None:
            s.input_faults.begin(values)
        return values

    def other(self, wire: Wire) -> Value:
        """Return the value of a wire that is not of type Real.

        Raises:
            KeyError: its source has not been read yet.
            SimulationError: the input cannot be this number.
        """
        value = self.others[wire.source, wire.output]
        if wire.converts:
            value = int(wire.gain) * value + int(wire.offset)  # type: ignore[operator]
        allowed = self._allowed.get((wire.target, wire.input))
        if allowed is None or value in allowed:
            return value
        raise self._unfit(wire, value)

    def _unfit(self, wire: Wire, value: Value) -> SimulationError:
        """Return the exception for a number that an input cannot be."""
        items = self.of[wire.target].instance.fmu.variables[wire.input].items
        sentence, now = f"{wire.target}: {wire.input} would be {value}", self.time.value
        if items is None:
            sentence += ", more than an Integer holds"
            return SimulationError(sentence, instance=wire.target, time=now, code="value-too-large")
        numbers = listed(f"{name} {number}" for name, number in items.items())
        sentence += f", which is not the number of an item ({numbers})"
        return SimulationError(sentence, instance=wire.target, time=now, code="value-not-an-item")

    def store_converted(self, s: InstanceSlot) -> Callable[[], Status]:
        """Return the call that stores an instance's outputs of other types as the Reals that they feed.

        It raises SimulationError if a Real does not hold one of them exactly.
        """
        others, reals = self.others, s.samples[len(s.outputs) :]
        keys = [(s.name, v.name) for v in s.converted]
        pick = operator.itemgetter(*keys)

        def store() -> Status:
            reals[:] = pick(others)
            if np.abs(reals).max() >= EXACT:
                for (name, output), number in ((key, others[key]) for key in keys):
                    if float(number) != number:
                        sentence = f"{name}: {output} is {number}, which a Real does not hold exactly"
                        raise SimulationError(
                            sentence, instance=name, time=self.time.value, code="value-too-large"
                        )
            return OK

        return store

    def given_others(self, s: InstanceSlot) -> dict[str, Value]:
        """Return an instance's inputs that are not Real, as far as their sources have been read and fit."""
        values = {}
        for variable, wire in s.other_inputs:
            if wire is None:
                constant = s.instance.constants[variable.name]
                values[variable.name] = self.others.get((s.name, variable.name), constant)
            elif (wire.source, wire.output) in self.others:
                with suppress(SimulationError):
                    values[variable.name] = self.other(wire)
        return values

    def timings(self, target: InstanceSlot) -> list[WireTiming | None]:
        """Return what the weights of each wire to a Real input of an instance depend on; None: no wire."""
        return [
            None if wire is None else self._timing(target, variable, wire)
            for variable, wire in zip(target.inputs, target.wires, strict=True)
        ]

    def _timing(self, target: InstanceSlot, variable: Variable, wire: Wire) -> WireTiming:
        source = self.of[wire.source]
        return WireTiming(
            source_period=source.instance.period,
            target_period=target.instance.period,
            earlier=source.position < target.position,
            direct=target.direct(variable),
            discrete=source.instance.fmu.variables[wire.output].discrete,
        )

    def start_history(self) -> None:
        """Set all earlier samples to the current ones."""
        self.pool[self.n_outputs : 2 * self.n_outputs] = self.now
        for s in self.slots:
            self.pool.take(s.sources, None, s.kept, "clip")


def by_type(variables: Iterable[Variable]) -> Iterable[list[Variable]]:
    """Group variables by type, so that one FMI call can set or get each group."""
    groups: dict[str, list[Variable]] = {}
    for variable in variables:
        groups.setdefault(variable.ref.type, []).append(variable)
    return groups.values()


def _make_slots(plan: Plan, fmu_instances: Mapping[str, FmuInstance]) -> list[InstanceSlot]:
    """Return the slots, in evaluation order, without their arrays."""
    driver = {(w.target, w.input): w for w in plan.wires}
    needed = {(w.source, w.output) for w in plan.wires} | set(plan.record)
    of = {instance.name: instance.fmu.variables for instance in plan.instances}
    to_reals = {(w.source, w.output) for w in plan.wires if of[w.target][w.input].type == "Real"}
    slots = []
    for position, instance in enumerate(plan.instances):
        driven = [
            (v, driver.get((instance.name, v.name)))
            for v in instance.fmu.of("input")
            if (instance.name, v.name) in driver or v.name in instance.constants
        ]
        read = [v for v in instance.fmu.variables.values() if (instance.name, v.name) in needed]
        slots.append(
            InstanceSlot(
                instance,
                fmu_instances[instance.name],
                position,
                [v for v, _ in driven if v.type == "Real"],
                [wire for v, wire in driven if v.type == "Real"],
                [v for v in read if v.type == "Real"],
                [(v, w) for v, w in driven if v.type != "Real"],
                [v for v in read if v.type != "Real"],
                [v for v in read if v.type != "Real" and (instance.name, v.name) in to_reals],
            )
        )
    return slots


def _allowed_numbers(plan: Plan) -> dict[tuple[str, str], range | frozenset[int]]:
    """Return the whole numbers that an input can be, by instance and input, where its wire may bring others.

    Numbers that no wire has changed are checked when they are set.
    """
    of = {instance.name: instance.fmu.variables for instance in plan.instances}
    allowed: dict[tuple[str, str], range | frozenset[int]] = {}
    for wire in plan.wires:
        source, target = of[wire.source][wire.output], of[wire.target][wire.input]
        if target.type == "Enumeration" and source.type == "Integer":
            allowed[wire.target, wire.input] = frozenset((target.items or {}).values())
        elif target.type == "Integer" and wire.converts:
            lowest, highest = integer_limits(target.encoding or "Int32")
            allowed[wire.target, wire.input] = range(lowest, highest + 1)
    return allowed


class FaultInjector:
    """Applies the faults of an instance's outputs or of its inputs.

    Args:
        plan: its start and step define the times.
        period: of the instance, in communication steps.
        at: per fault, the index of the value, the time that the value is for, in halves of a communication
            step after the beginning of an instance's step, and the disturbance.
    """

    def __init__(self, plan: Plan, period: int, at: Sequence[tuple[int, int, Disturbance]]) -> None:
        scale = 2 * math.lcm(plan.start.denominator, plan.step.denominator)
        self._start = plan.time(0)
        half = int(plan.step * scale) // 2
        begin = int(plan.start * scale)
        self._at = [(i, begin + ahead * half, disturb) for i, ahead, disturb in at]
        self._further = 2 * period * half
        self._scale = scale
        self._longest = 2 * plan.n_steps * half

    def begin(self, values: np.ndarray) -> None:
        """Disturb values at the start of the run."""
        for i, _, disturb in self._at:
            values[i] = disturb(self._start, float(values[i]))

    def acting(self, values: np.ndarray) -> Callable[[], Status]:
        """Return the call that disturbs `values`, to be made once per step of the instance."""
        at, scale, further, item = self._at, self._scale, self._further, values.item
        passed = 0

        def act() -> Status:
            nonlocal passed
            for i, first, disturb in at:
                values[i] = disturb((first + passed) / scale, item(i))
            passed += further
            return OK

        return act

    def data(self, values: np.ndarray) -> OperationData | None:
        """Return the same for the compiled loop; None if only Python can make one of the disturbances."""
        linear = [disturb for _, _, disturb in self._at if isinstance(disturb, LinearDisturbance)]
        latest = max(abs(first) + self._longest for _, first, _ in self._at)
        if len(linear) < len(self._at) or max(latest, self._further, self._scale) >= EXACT:
            return None
        return OperationData(
            Kind.DISTURB,
            len(linear),
            values=values,
            first=np.array([i for i, _, _ in self._at], np.int64),
            second=np.array([first for _, first, _ in self._at], np.int64),
            factors=np.array([(fault.begin, fault.end, fault.gain, fault.offset) for fault in linear]),
            row=ctypes.c_int64(0),
            further=self._further,
            scale=self._scale,
        )


def faulting(signals: SignalPool, s: InstanceSlot, *, of_output: bool) -> FaultInjector | None:
    """Return the injector for the faults of an instance's outputs or inputs, None if it has none."""
    plan, period = signals.plan, s.instance.period
    by_name = {v.name: (i, v) for i, v in enumerate(s.outputs if of_output else s.inputs)}
    disturbances = []
    for signal in plan.faults:
        if (signal.instance, signal.of_output) != (s.name, of_output) or signal.variable not in by_name:
            continue
        i, variable = by_name[signal.variable]
        ahead, held = 2 * period, variable.discrete
        if not of_output:
            wire = s.wires[i]
            assert wire is not None
            ahead = ALGORITHMS[plan.algorithm].halves_ahead(period, s.direct(variable))
            ahead = min(ahead, 2 * period - 2) if wire.delayed else ahead
            held = signals.of[wire.source].instance.fmu.variables[wire.output].discrete
        disturbances.append((i, ahead, KINDS[signal.fault.kind].disturbance(signal, held)))
    return FaultInjector(plan, period, disturbances) if disturbances else None
