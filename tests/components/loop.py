"""The master's three algorithms over component objects in one process, without FMUs.

Wires follow equal names. Used to measure coupling errors of components by themselves; the real
master is tested elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from yawbench.components.fmi.component import Component
from yawbench.components.fmi.variables import output, parameter

from .stand import four


class Straight(Component):
    """Torque requests become wheel torques."""

    inputs = ("torque_request_*",)
    outputs = (output("wheel_torque_*", "torque_request_*"),)
    sampled = True

    def output(self, t: float, u: list[float]) -> list[float]:
        return u


@dataclass(frozen=True)
class HoldParameters:
    angle: float = parameter(1e-4, "rad", "Steer angle")


class Hold(Component):
    """Steer angle held."""

    Parameters = HoldParameters
    outputs = ("steer_angle",)

    def output(self, t: float, u: list[float]) -> list[float]:
        return [self.p.angle]


class Unit:
    """One instance: its wires, and its last two outputs."""

    def __init__(self, component: type[Component], parameters: dict[str, Any]) -> None:
        self.slave = component(instance_name=component.fmu_name, resources=None)
        self.variables = component.variables
        reference = {v.name: i for i, v in enumerate(self.variables)}
        for name, value in parameters.items():
            variable = self.variables[reference[name]]
            kind = variable.fmi_type.replace("Enumeration", "Integer").lower()
            number = variable.choices.index(value) + 1 if variable.fmi_type == "Enumeration" else value
            getattr(self.slave, f"set_{kind}")([reference[name]], [number])
        self.inputs = [v.name for v in self.variables if v.causality == "input"]
        outputs = [v for v in self.variables if v.causality == "output"]
        self.outputs = [v.name for v in outputs]
        self.direct = {name for v in outputs for name in v.depends_on}
        self.discrete = component.sampled
        self.in_refs = list(range(len(self.inputs)))
        self.out_refs = list(range(len(self.inputs), len(self.inputs) + len(self.outputs)))
        self.before: list[float] = []
        self.now: list[float] = []

    def read(self) -> None:
        self.before, self.now = self.now, self.slave.get_real(self.out_refs)


class Loop:
    """Units in evaluation order, coupled by `algorithm`; `constants` feed undriven inputs."""

    def __init__(
        self,
        units: Sequence[tuple[type[Component], dict[str, Any]]],
        *,
        algorithm: str,
        constants: dict[str, float] | None = None,
    ) -> None:
        self.algorithm = algorithm
        self.units = [Unit(component, parameters) for component, parameters in units]
        self.constants = constants or {}
        self.source = {n: (k, i) for k, unit in enumerate(self.units) for i, n in enumerate(unit.outputs)}
        self.time = 0.0
        self._initialize()

    def __getitem__(self, name: str) -> float:
        k, i = self.source[name]
        return self.units[k].now[i]

    def _initialize(self) -> None:
        for unit in self.units:
            unit.slave.setup_experiment(0.0)
            unit.slave.enter_initialization_mode()
            unit.read()
        for _ in range(100):
            last = [unit.now for unit in self.units]
            for unit in self.units:
                unit.slave.set_real(unit.in_refs, [self._latest(name) for name in unit.inputs])
                unit.read()
            if last == [unit.now for unit in self.units]:
                break
        else:
            raise AssertionError("initialization does not settle")
        for unit in self.units:
            unit.slave.exit_initialization_mode()
            unit.before = unit.now
            self._check(unit)

    def _latest(self, name: str) -> float:
        return self[name] if name in self.source else self.constants.get(name, 0.0)

    def step(self, h: float) -> None:
        """Take all units from `time` to `time + h`."""
        for k, unit in enumerate(self.units):
            unit.slave.set_real(unit.in_refs, [self._input(k, unit, name) for name in unit.inputs])
            unit.slave.do_step(self.time, h)
            self._check(unit)
            unit.read()
        self.time += h

    def _input(self, target: int, unit: Unit, name: str) -> float:
        if name not in self.source:
            return self.constants.get(name, 0.0)
        k, i = self.source[name]
        source, stepped, direct = self.units[k], k < target, name in unit.direct
        now = source.now[i]  # at the end of the step if the source has been stepped
        before = source.before[i]
        if self.algorithm == "jacobi":
            return before if stepped else now
        if self.algorithm == "gauss_seidel":
            return now
        if source.discrete:
            return before if stepped and not direct else now
        if direct:
            return now if stepped else 2.0 * now - before
        return 0.5 * (before + now) if stepped else 1.5 * now - 0.5 * before

    def run(self, until: float, steps: int, each: Callable[[Loop], Any]) -> list[Any]:
        """Step `steps` times to `until` [s]; return what `each` gives, at the start and after each step."""
        h = until / steps
        results = [each(self)]
        for k in range(1, steps + 1):
            self.step(h)
            self.time = k * h
            results.append(each(self))
        return results

    def rows(self, until: float, h: float, names: Sequence[str]) -> np.ndarray:
        """Return signals (rows) at every multiple of `h` [s], from the start on."""
        return np.array(self.run(until, round(until / h), lambda now: [now[name] for name in names])).T

    @staticmethod
    def _check(unit: Unit) -> None:
        messages = [m.msg for m in unit.slave.log_queue if m.status >= 3]
        if messages:
            raise AssertionError("\n".join(messages))


def drive_on(
    units: Sequence[tuple[type[Component], dict[str, Any]]],
    *,
    until: float,
    record: Sequence[str],
    h: float = 1e-3,
    mu: float = 1.0,
    torque: Sequence[float] = (0.0,),
    algorithm: str = "extrapolated",
    **constants: float,
) -> np.ndarray:
    """Return the recorded signals (rows) of units on a road of friction `mu` under a torque at each wheel."""
    given = {**four("friction", mu), **four("wheel_torque", *torque), **constants}
    return Loop(units, algorithm=algorithm, constants=given).rows(until, h, record)
