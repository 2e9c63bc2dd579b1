"""Operating point of a run, from which a step is repeated with other states and inputs.

The components run in Python, where every value inside them, an attribute or an item of an attribute, can be
read and changed. The library of a native FMU computes the same bits, but does not expose them.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import as_strided

from yawbench._controller import PythonComponent
from yawbench._scenario import Scenario
from yawbench.components.fmi.component import Component
from yawbench.fmus.build import find_components
from yawbench.fmus.build_stamp import read_stamp
from yawbench.foundation.errors import Diagnostic, Location, ScenarioError, SimulationError
from yawbench.foundation.interrupts import StopFlag
from yawbench.foundation.messages import hint, short
from yawbench.orchestrator.master.log import OK, WARNING, Log
from yawbench.orchestrator.master.step_loop import Master
from yawbench.orchestrator.master.step_program import SeriesFeed
from yawbench.orchestrator.plan import Plan
from yawbench.orchestrator.signal_names import SignalName

SMALL = 1e-5
"""Size of a displacement, relative to a value of at least 1. Chosen: the cube root of the machine precision,
where errors by rounding and curvature are equal."""
LARGE = {"N": 1.0, "N.m": 1.0, "Pa": 1e3}
"""Unit -> size of a displacement if the effect of 1e-5 would be lost in rounding. Chosen: a thousandth of the
values of a wheel brake or a tyre."""
QUIET = 3
"""Steps without newly affected values after which no more are expected. Chosen: longer than any delay."""


class Inside(NamedTuple):
    """Location of a value inside a component: the instance, and the path of keys and attributes."""

    instance: str
    path: tuple[Any, ...]

    def __str__(self) -> str:
        return f"{self.instance}: " + "".join(
            f"[{key!r}]" if isinstance(key, int) else f".{key}" for key in self.path
        ).lstrip(".")


StateKey = int | Inside
"""Location of a value of the state: an index of the signal pool, or inside a component."""


class OperatingPoint:
    """State of a scenario at a time.

    Args:
        scenario: the scenario.
        time: [s], rounded down to a step of all instances.
        inputs: signals or inputs of instances to which deviations are added.
        outputs: signals.

    Attributes:
        time: [s].
        dt: the step of all instances, over which inputs are held [s].
        inputs, outputs: name -> unit of measurement.

    Raises:
        ScenarioError: as for `linearize`.
    """

    def __init__(
        self, scenario: Scenario, time: float, inputs: Sequence[str], outputs: Sequence[str]
    ) -> None:
        self._file, log = scenario.path, Log()
        plan = self._plan = _recording(scenario.plan(), [*inputs, *outputs])
        if plan.faults:
            raise self._refusal("option-invalid", "linearize takes no faults: remove them")
        components = self._components(scenario)
        self._running: dict[str, Any] = {
            instance.name: components[instance.name].open(instance, log) for instance in plan.instances
        }
        self._master = Master(plan, self._running, log, StopFlag())
        self._pool, cycle = self._master.signals, self._master.program.cycle
        reached = (time - plan.time(0)) / float(plan.step) + 1e-6
        steps = int(min(reached, plan.n_steps + cycle))  # a time far beyond the end overflows
        self._k = steps - steps % cycle
        self.time, self.dt = plan.time(max(self._k, 0)), float(cycle * plan.step)
        if time < plan.time(0) or self._k + cycle > plan.n_steps:
            last = plan.time(plan.n_steps - cycle)
            text = f"at: must be from {plan.time(0):g} to {last:g} s, within the run (got {time:g})"
            raise self._refusal("argument-invalid", text)
        pool = self._pool
        self.inputs = {name: self._unit_of(name, "input") for name in inputs}
        self.outputs = {name: self._unit_of(name, "output") for name in outputs}
        self.signals = {
            pool.index[s.name, v.name]: (f"{s.name}.{v.name}", v.unit or "")
            for s in pool.slots
            for v in s.outputs
        }
        row = np.empty(1 + len(plan.record))
        with np.errstate(all="ignore"):
            self._master.initialize(row, [])
            self._master.advance(self._k, as_strided(row, (self._k, row.size), (0, row.itemsize)), [])
        self._operations = [  # a series is held
            [op for op in self._master.program.at(k) if not isinstance(op.call, SeriesFeed)]
            for k in range(self._k + 1, self._k + 1 + cycle)
        ]
        self._start = self._state()

    def key_of(self, signal: str) -> StateKey:
        """Return the key of a signal."""
        return self._pool.index[_pair(signal)]

    def size(self, key: StateKey, value: float) -> float:
        """Return the displacement of a value."""
        unit = self.signals.get(key, ("", ""))[1] if isinstance(key, int) else ""
        return LARGE.get(unit, SMALL * max(1.0, abs(value)))

    def values(self, keys: Sequence[StateKey]) -> np.ndarray:
        """Return values of the state, shape (keys,)."""
        states, pool, _ = self._start
        return _read(keys, states, pool)

    def after(
        self, keys: Sequence[StateKey], *, displaced: Mapping[StateKey, float], added: Mapping[str, float]
    ) -> np.ndarray:
        """Return values after a step from the point, shape (keys,).

        Args:
            keys: of the values.
            displaced: key -> the value of the state to step from.
            added: input -> deviation during the step.
        """
        states, pool, others = self._start
        changed, signals = dict(states), pool.copy()
        for key, value in displaced.items():
            if isinstance(key, int):
                signals[key] = value
            else:
                changed[key.instance] = _with(changed[key.instance], key.path, value)
        self._restore((changed, signals, others))
        self._step(added)
        after = {name: instance.component.__dict__ for name, instance in self._running.items()}
        return _read(keys, after, self._pool.pool)

    def reached(self) -> list[StateKey]:
        """Return the keys of all values that the inputs affect, immediately or later.

        A signal that is an input is not included: its value is always that of the input.
        """
        held = {self._pool.index.get(_pair(name)) for name in self.inputs}
        changing = len(self._pool.pool) - 1 - len(self._pool.inputs)
        runs: list[dict[str, float]] = [{}]
        runs += [{n: way * LARGE.get(u, SMALL)} for n, u in self.inputs.items() for way in (1.0, -1.0)]
        states, reached, quiet = [self._start] * len(runs), dict[StateKey, None](), 0
        while quiet < QUIET:
            before = len(reached)
            for i, added in enumerate(runs):
                self._restore(states[i])
                self._step(added)
                states[i] = self._state()
            undisturbed = dict(_leaves(states[0][0]))
            for leaves, pool, _ in states[1:]:
                moved = np.flatnonzero(pool[:changing] != states[0][1][:changing]).tolist()
                reached |= dict.fromkeys(at for at in moved if at not in held)
                reached |= {key: None for key, x in _leaves(leaves) if x != undisturbed.get(key)}
            quiet = quiet + 1 if len(reached) == before else 0
        there = dict(_leaves(self._start[0]))
        return [key for key in reached if isinstance(key, int) or key in there]

    def name(self, key: StateKey) -> str:
        """Return the displayed name of a value."""
        if isinstance(key, Inside):
            return str(key)
        if key in self.signals:
            return self.signals[key][0]
        return f"earlier sample {key}"

    def _refusal(self, code: str, text: str) -> ScenarioError:
        return ScenarioError(Diagnostic(code, text, location=Location(self._file)))

    def _components(self, scenario: Scenario) -> dict[str, PythonComponent]:
        """Return the component of every instance."""
        known = find_components()
        components = {}
        for instance in self._plan.instances:
            if (program := scenario._programs.get(instance.fmu.path)) is None:
                stamp = read_stamp(instance.fmu.path)
                if instance.fmu.name not in known or stamp is None or not stamp.is_component:
                    text = (
                        f"{instance.name}: {instance.fmu.path.name} hides its state: linearize takes plain "
                        "Python, and FMUs of the components in Python that yawbench brings along"
                    )
                    raise self._refusal("fmu-not-supported", text)
                module = import_module(".".join(("yawbench.components", *known[instance.fmu.name])))
                classes = [value for value in vars(module).values() if isinstance(value, type)]
                made = [c for c in classes if issubclass(c, Component) and c.__module__ == module.__name__]
                program = PythonComponent(made[-1], instance=instance.name, role=instance.fmu.role or "")
            components[instance.name] = program
        return components

    def _unit_of(self, name: str, what: str) -> str:
        """Return the unit of measurement of a signal, or of an input that is driven or constant."""
        owner, variable = _pair(name)
        if (station := self._pool.of.get(owner)) is not None:
            for each in [*station.outputs, *(station.inputs if what == "input" else ())]:
                if each.name == variable:
                    return each.unit or ""
        every = [
            f"{instance.name}.{each}" for instance in self._plan.instances for each in instance.fmu.variables
        ]
        text = f"{what}s: there is no {what} {short(name)}{hint(name, every, lead=what + 's')}"
        raise self._refusal("signal-unknown", text)

    def _state(self) -> tuple[dict[str, Any], np.ndarray, dict[Any, Any]]:
        states = {name: instance.component._get_fmu_state() for name, instance in self._running.items()}
        return states, self._pool.pool.copy(), dict(self._pool.others)

    def _restore(self, state: tuple[dict[str, Any], np.ndarray, dict[Any, Any]]) -> None:
        states, pool, others = state
        for name, instance in self._running.items():
            instance.component._set_fmu_state(states[name])
        self._pool.pool[:] = pool
        self._pool.others.clear()
        self._pool.others.update(others)

    def _step(self, added: Mapping[str, float]) -> None:
        """Execute a step from the operating point, with deviations of inputs."""
        pool, start = self._pool, self._start[1]
        into: dict[str, list[tuple[int, float]]] = {}
        of: dict[str, list[tuple[int, float]]] = {}
        for name, value in added.items():
            owner, variable = _pair(name)
            if (at := pool.index.get((owner, variable))) is not None:
                pool.pool[at] = start[at] + value
                of.setdefault(owner, []).append((at, value))
            else:
                names = [v.name for v in pool.of[owner].inputs]
                into.setdefault(owner, []).append((names.index(variable), value))
        for k, operations in enumerate(self._operations, self._k + 1):
            for period, clock in self._master.clocks.items():
                if k % period == 0:
                    clock.value = self._plan.time(k - period)
            for op in operations:
                u = pool.of[op.instance].u if op.kind == "set" and op.instance in into else None
                if u is None:
                    status = op.call()
                else:
                    kept = u.copy()
                    for at, value in into[op.instance]:
                        u[at] += value
                    status = op.call()
                    u[:] = kept
                if op.kind == "get":
                    for at, value in of.get(op.instance, ()):
                        pool.pool[at] += value
                if status not in (None, OK, WARNING):
                    text = f"{op.instance}: fails next to the operating point"
                    raise SimulationError(text, instance=op.instance, time=self.time, code="fmu-call-failed")


def _pair(name: str) -> tuple[str, str]:
    owner, _, variable = name.partition(".")
    return owner, variable


def _recording(plan: Plan, names: Iterable[str]) -> Plan:
    """Return the plan with those of the names recorded that are outputs."""
    outputs = {(instance.name, v.name) for instance in plan.instances for v in instance.fmu.of("output")}
    more = [SignalName(*_pair(name)) for name in names if _pair(name) in outputs]
    return replace(plan, record=tuple(dict.fromkeys((*plan.record, *more))))


def _leaves(states: Mapping[str, Any]) -> Iterator[tuple[Inside, float]]:
    """Yield all floating-point values of saved states, except those of variables, which are signals."""
    for name, state in states.items():
        visited: set[int] = set()
        own = {key: value for key, value in state.items() if key != "_values"}
        yield from ((Inside(name, path), x) for path, x in _inside(own, (), visited))


def _inside(value: Any, path: tuple[Any, ...], visited: set[int]) -> Iterator[tuple[tuple[Any, ...], float]]:
    if isinstance(value, (float, np.floating)):
        yield path, float(value)
    elif not isinstance(value, (str, bytes, int, type(None))) and id(value) not in visited:
        visited.add(id(value))
        for key, item in _items(value):
            yield from _inside(item, (*path, key), visited)


def _items(value: Any) -> Iterable[tuple[Any, Any]]:
    """Return the items of a container or the attributes of an object."""
    if isinstance(value, dict):
        return value.items()
    if isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.dtype.kind in "fO"):
        return enumerate(value)
    slots = [slot for cls in type(value).__mro__ for slot in getattr(cls, "__slots__", ())]
    names = [*slots, *(vars(value) if hasattr(value, "__dict__") and not callable(value) else ())]
    return [(name, getattr(value, name)) for name in names if hasattr(value, name)]


def _read(keys: Sequence[StateKey], states: Mapping[str, Any], pool: np.ndarray) -> np.ndarray:
    return np.array([pool[at] if isinstance(at, int) else _at(states[at.instance], at.path) for at in keys])


def _at(value: Any, path: tuple[Any, ...]) -> float:
    for key in path:
        value = _item(value, key)
    return float(value)


def _item(value: Any, key: Any) -> Any:
    return value[key] if isinstance(value, (dict, list, tuple, np.ndarray)) else getattr(value, key)


def _with(value: Any, path: tuple[Any, ...], new: float) -> Any:
    """Return a copy of a container or an object with another value at a path."""
    if not path:
        return new
    key, item = path[0], _with(_item(value, path[0]), path[1:], new)
    if isinstance(value, tuple):
        items = (*value[:key], item, *value[key + 1 :])
        return type(value)(*items) if hasattr(value, "_fields") else items
    changed = copy.copy(value)
    if isinstance(value, (dict, list, np.ndarray)):
        changed[key] = item
    else:
        object.__setattr__(changed, key, item)  # works for frozen dataclasses, too
    return changed
