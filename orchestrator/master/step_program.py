"""Step programs: the flat list of calls that make up one communication step, compiled before the run.

Each call takes no arguments and returns an FMI status; the master walks the list and stops at the first
that is not OK. Which instances take part, and with which coupling weights, repeats after the least common
multiple of the instances' periods, so there is one program per phase of that cycle.

Inputs that follow a time series are part of the program. A series is known at all times, so nothing has to
be extrapolated: `jacobi` takes its value at the beginning of an instance's step, `gauss_seidel` at its end,
`extrapolated` in the middle of the step for an input that enters an integration and at the end for any
other (see `coupling_algorithms`).
"""

from __future__ import annotations

import ctypes
import functools
import math
from collections.abc import Callable, Iterator
from typing import Any, Literal, NamedTuple

import numpy as np

from yawbench.fmus.fmu import ValueRef, Variable

from ..coupling_algorithms import ALGORITHMS, CouplingWeights, WireTiming, delayed
from ..plan import InputSeries, Plan
from .compiled_loop import Kind, OperationData
from .instance import PlainCall, Status
from .log import OK
from .signal_pool import FaultInjector, InstanceSlot, SignalPool, by_type

BLOCK = 1024
"""Steps for which series are sampled at a time; chosen: some kilobytes per input."""
LATE = 1e-9
"""Fraction of a step by which a time may fall short of a time in the series file and still count as it."""


class SeriesFeed:
    """The call that updates the series inputs of an instance, once for each of its steps.

    Samples are made in blocks; those of Reals are read from there by the compiled loop, too.
    """

    def __init__(self, signals: SignalPool, s: InstanceSlot) -> None:
        real = [(i, v) for i, v in enumerate(s.inputs) if v.name in s.instance.series]
        others = [v for v, _ in s.other_inputs if v.name in s.instance.series]
        self._pool, self._kept = signals.pool, signals.others
        self._slots = s.sources[[i for i, _ in real]] if real else np.empty(0, np.intp)
        self._others = [(s.name, v.name) for v in others]
        self._columns = [_column(signals.plan, s, v, s.instance.series[v.name]) for _, v in real]
        self._other_columns = [_column(signals.plan, s, v, s.instance.series[v.name]) for v in others]
        self._block = np.empty((BLOCK, len(real)))
        self._row = ctypes.c_int64(BLOCK)
        self.data: OperationData | None = None
        if not others:
            fields = {"first": self._slots, "factors": self._block, "row": self._row}
            self.data = OperationData(Kind.SERIES, len(real), n_references=BLOCK, **fields)

    def __call__(self) -> Status:
        if self._row.value == BLOCK:
            self._sample()
        row = self._row.value
        self._pool[self._slots] = self._block[row]
        for key, samples in zip(self._others, self._other_samples, strict=True):
            self._kept[key] = samples[row]
        self._row.value = row + 1
        return OK

    def _sample(self) -> None:
        for i, column in enumerate(self._columns):
            self._block[:, i] = next(column)
        self._other_samples = [next(column).tolist() for column in self._other_columns]
        self._row.value = 0


def _column(plan: Plan, s: InstanceSlot, variable: Variable, series: InputSeries) -> Iterator[np.ndarray]:
    """Yield the values of a series input, step by step, in blocks."""
    period, first = s.instance.period, 0
    ahead = ALGORITHMS[plan.algorithm].halves_ahead(period, s.direct(variable))
    halves, start = plan.step / 2, float(plan.start)
    while True:
        k = np.arange(first, first + period * BLOCK, period)
        times = start + (2 * k + ahead) * halves.numerator / halves.denominator
        yield series.at(times + LATE * float(plan.step) * series.held)
        first += period * BLOCK


KEPT = 1024
"""Programs cached. Periods without a common factor have cycles longer than any run; then every program is
needed only once. Chosen: more than the phases of any usual set of periods."""

OperationKind = Literal["gather", "set", "step", "keep", "get", "fault"]


class Operation(NamedTuple):
    """One call on behalf of an instance ("" for all instances at once).

    `data` say the same to the compiled loop; None: only Python can make the call.
    """

    instance: str
    kind: OperationKind
    call: Callable[[], Status | None]
    data: OperationData | None = None


def _of_fmu(s: InstanceSlot, kind: OperationKind, call: Callable[[], Status]) -> Operation:
    """Return the operation of a step call of an instance."""
    return Operation(s.name, kind, call, call.data if isinstance(call, PlainCall) else None)


class StepProgram:
    """The step programs of all phases, each built when it is first needed."""

    def __init__(self, signals: SignalPool) -> None:
        self._signals = signals
        self._algorithm = ALGORITHMS[signals.plan.algorithm]
        self.cycle = math.lcm(*(s.instance.period for s in signals.slots))
        self._made: dict[int, list[Operation]] = {}
        self._gathers: dict[tuple[str, int], list[Operation]] = {}
        feeds = {s.name: SeriesFeed(signals, s) for s in signals.slots if s.instance.series}
        self._feeds = {name: Operation(name, "gather", feed, feed.data) for name, feed in feeds.items()}
        self._delayed = {wire.source for wire in signals.plan.wires if wire.delayed}  # instances
        self._of_outputs = {s.name: _acting(s, s.output_faults, s.y) for s in signals.slots}
        self._of_inputs = {s.name: _acting(s, s.input_faults, s.u) for s in signals.slots}

    @functools.cached_property
    def _timings(self) -> dict[str, list[WireTiming | None]]:
        """Instance -> timing of the wire of each Real input; every phase needs the same."""
        return {s.name: self._signals.timings(s) for s in self._signals.slots}

    @functools.cached_property
    def _cycles(self) -> dict[str, int]:
        """Instance -> number of communication points after which the weights of all its wires repeat."""
        return {
            s.name: math.lcm(s.instance.period, *(t.source_period for t in self._timings[s.name] if t))
            for s in self._signals.slots
        }

    def at(self, k: int) -> list[Operation]:
        """Return the operations that lead from communication point `k` - 1 to `k`."""
        phase = k % self.cycle
        if phase not in self._made:
            _make_room(self._made)
            made = self._at_once if self._algorithm.at_once else self._in_sequence
            self._made[phase] = made(phase)
        return self._made[phase]

    def _at_once(self, k: int) -> list[Operation]:
        """Gather all inputs before any instance steps, a slow instance's at the start of its period."""
        m = self._signals
        beginning = [s for s in m.placed if (k - 1) % s.instance.period == 0]
        ending = [s for s in m.slots if k % s.instance.period == 0]
        fast = [s for s in beginning if s.instance.period == 1 and s.inputs]
        operations = [self._feeds[s.name] for s in beginning if s.instance.series]
        if fast:
            sources = np.concatenate([s.sources for s in fast])
            operations.append(_copying(m, "", sources, m.inputs[: len(sources)]))
        slow = [s for s in beginning if s.instance.period > 1 and s.inputs]
        operations += [_copying(m, s.name, s.sources, s.u) for s in slow]
        operations += [op for s in beginning for op in _converting(s)]
        operations += [op for s in beginning for op in self._of_inputs[s.name]]
        operations += [op for s in beginning for op in _setting(m, s)]
        for s in ending:
            operations += [_of_fmu(s, "step", s.calls.step), *getting(m, s)]
            operations += self._of_outputs[s.name]
        return operations

    def _in_sequence(self, k: int) -> list[Operation]:
        """Step the instances in order, each with the newest values; slow ones at the end of their period."""
        operations: list[Operation] = []
        for s in self._signals.slots:
            if k % s.instance.period == 0:
                operations += [self._feeds[s.name]] if s.instance.series else []
                operations += [*self._gathering(s, k), *self._of_inputs[s.name], *self._stepping[s.name]]
        return operations

    @functools.cached_property
    def _stepping(self) -> dict[str, list[Operation]]:
        """Instance -> the operations of its step after its inputs are gathered, the same in every phase."""
        m, stepping = self._signals, {}
        for s in m.slots:
            stepping[s.name] = [*_setting(m, s), _of_fmu(s, "step", s.calls.step)]
            if (self._algorithm.needs_before or s.name in self._delayed) and s.samples.size:
                stepping[s.name].append(_keeping_outputs(m, s))
            stepping[s.name] += [*getting(m, s), *self._of_outputs[s.name]]
        return stepping

    def _gathering(self, s: InstanceSlot, k: int) -> list[Operation]:
        m = self._signals
        if not s.driven:
            return []
        key = s.name, k % self._cycles[s.name]
        if key not in self._gathers:
            _make_room(self._gathers)
            per_input = [*self._weights(s, k)]
            operations = [_gather(m, s, per_input), *_converting(s)]
            if any(w.kept for w in per_input):
                operations.append(_copying(m, s.name, s.sources, s.kept)._replace(kind="keep"))
            self._gathers[key] = operations
        return self._gathers[key]

    def _weights(self, s: InstanceSlot, k: int) -> Iterator[CouplingWeights]:
        """Yield the weights of each Real input of an instance."""
        for wire, timing in zip(s.wires, self._timings[s.name], strict=True):
            if wire is None or timing is None:
                yield CouplingWeights()
            else:
                weights = delayed if wire.delayed else self._algorithm.weights
                # `k` is a phase; shifted so that no sample lies before the start
                yield weights(timing, k + 2 * self.cycle)


def _make_room(kept: dict[Any, list[Operation]]) -> None:
    if len(kept) >= KEPT:
        del kept[next(iter(kept))]  # the oldest, which is needed again last


def _gather(m: SignalPool, s: InstanceSlot, per_input: list[CouplingWeights]) -> Operation:
    """Return the operation that computes an instance's inputs from weighted samples."""
    first, second, factors = [], [], []
    for i, w in enumerate(per_input):
        now = int(s.sources[i])
        past = s.kept_at + i if w.kept else now + m.n_outputs
        if w == CouplingWeights(0.0, 1.0):
            first.append(past)
            second.append(past)
            factors.append((1.0, 0.0))
        else:
            first.append(now)
            second.append(past if w.before or w.kept else now)
            factors.append((w.now, w.before + w.kept))
    if all(factor == (1.0, 0.0) for factor in factors):
        return _copying(m, s.name, np.array(first, np.intp), s.u)
    return _blending(m, s.name, np.array([first, second], np.intp), np.array(factors).T.copy(), s.u)


def _copying(m: SignalPool, instance: str, sources: np.ndarray, target: np.ndarray) -> Operation:
    """Return the operation that copies values of the pool, by index, into a target."""
    take = m.pool.take

    def copy() -> Status:
        take(sources, None, target, "clip")
        return OK

    data = OperationData(Kind.COPY, len(sources), first=sources, values=target)
    return Operation(instance, "gather", copy, data)


def _blending(
    m: SignalPool, instance: str, pairs: np.ndarray, factors: np.ndarray, target: np.ndarray
) -> Operation:
    """Return the operation that writes weighted sums of two samples each into a target."""
    take, multiply, add = m.pool.take, np.multiply, np.add
    terms = np.empty(pairs.shape)
    first, second = terms

    def blend() -> Status:
        take(pairs, None, terms, "clip")
        multiply(terms, factors, terms)
        add(first, second, target)
        return OK

    data = OperationData(
        Kind.BLEND,
        len(target),
        first=pairs[0],
        second=pairs[1],
        factors=factors[0],
        terms=factors[1],
        values=target,
    )
    return Operation(instance, "gather", blend, data)


def _converting(s: InstanceSlot) -> list[Operation]:
    """Return the operation, if needed, that converts inputs to the instance's units of measurement."""
    if s.scale is None:
        return []
    (gains, offsets), values = s.scale, s.u
    multiply, add = np.multiply, np.add

    def convert() -> Status:
        multiply(values, gains, values)
        add(values, offsets, values)
        return OK

    data = OperationData(Kind.CONVERT, len(values), factors=gains, terms=offsets, values=values)
    return [Operation(s.name, "gather", convert, data)]


def _acting(s: InstanceSlot, faults: FaultInjector | None, values: np.ndarray) -> list[Operation]:
    """Return the operation, if any, that applies faults to outputs or inputs; all programs share it."""
    return [] if faults is None else [Operation(s.name, "fault", faults.acting(values), faults.data(values))]


def _keeping_outputs(m: SignalPool, s: InstanceSlot) -> Operation:
    """Return the operation that keeps the outputs of an instance's last step."""
    slots = [m.index[s.name, v.name] for v in s.outputs]
    slots += [m.converted[s.name, v.name] for v in s.converted]
    here = np.array(slots, np.intp)
    data = OperationData(Kind.COPY, len(here), first=here, values=s.samples_before)
    return Operation(s.name, "keep", copying(s.samples, s.samples_before), data)


def copying(source: np.ndarray, target: np.ndarray) -> Callable[[], None]:
    """Return the call that copies one buffer into another."""
    return functools.partial(target.data.__setitem__, slice(None), source.data)


def _setting(m: SignalPool, s: InstanceSlot) -> list[Operation]:
    """Return the operations that set an instance's inputs."""
    operations = []
    if s.driven:
        operations.append(_of_fmu(s, "set", s.calls.set))
    moving = [v for v, wire in s.other_inputs if wire is not None or v.name in s.instance.series]
    driven = {v.ref[:2] for v in moving}  # all elements of an array are set together
    wires = {v.name: wire for v, wire in s.other_inputs}
    for chosen in by_type(v for v, _ in s.other_inputs if v.ref[:2] in driven):
        refs, ends = [v.ref for v in chosen], [((s.name, v.name), wires[v.name]) for v in chosen]

        def put(refs: list[ValueRef] = refs, ends: list[Any] = ends) -> Status:
            values = [m.others[key] if wire is None else m.other(wire) for key, wire in ends]
            return s.fmu_instance.put(refs, values)

        operations.append(Operation(s.name, "set", put))
    return operations


def getting(m: SignalPool, s: InstanceSlot) -> list[Operation]:
    """Return the operations that read an instance's outputs."""
    operations = []
    if s.outputs:
        operations.append(_of_fmu(s, "get", s.calls.get))
    for chosen in by_type(s.other_outputs):
        refs, keys = [v.ref for v in chosen], [(s.name, v.name) for v in chosen]

        def fetch(refs: list[ValueRef] = refs, keys: list[tuple[str, str]] = keys) -> Status:
            status, values = s.fmu_instance.fetch(refs)
            m.others.update(zip(keys, values, strict=True))
            return status

        operations.append(Operation(s.name, "get", fetch))
    if s.converted:
        operations.append(Operation(s.name, "get", m.store_converted(s)))
    return operations
