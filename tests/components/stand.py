"""A stand that drives one component through its FMI entry points, without an FMU."""

from __future__ import annotations

from typing import Any

from yawbench.components.fmi.component import Component
from yawbench.vocabulary.wheels import WHEELS


class Stand:
    """One instance of a component class, addressed by variable names.

    >>> stand = Stand(Dugoff, longitudinal_stiffness=4e4)
    >>> stand.start(slip_angle_fl=0.01)
    >>> stand.step(0.001, slip_angle_fl=0.02)["tyre_force_y_fl"]
    """

    def __init__(self, component: type[Component], **parameters: Any) -> None:
        self.unit = component(instance_name="stand", resources=None)
        self.reference = {v.name: i for i, v in enumerate(component.variables)}
        kinds = {v.name: v.fmi_type.replace("Enumeration", "Integer") for v in component.variables}
        self.type = {name: kind.lower() for name, kind in kinds.items()}
        self.choices = {v.name: v.choices for v in component.variables if v.fmi_type == "Enumeration"}
        self.setters = {kind: getattr(self.unit, f"set_{kind}") for kind in {*self.type.values()}}
        self.answers = {v.name: i for i, v in enumerate(component.variables) if v.causality == "output"}
        self.time = 0.0
        self.set(**parameters)

    def set(self, **values: Any) -> None:
        for kind, setter in self.setters.items():
            names = [name for name in values if self.type[name] == kind]
            if names:
                given = [self._number(name, values[name]) for name in names]
                setter([self.reference[name] for name in names], given)
        self._check()

    def start(self, **inputs: float) -> dict[str, float]:
        """Set the inputs, run the initialization and return all outputs."""
        self.set(**inputs)
        self.unit.enter_initialization_mode()
        self.unit.exit_initialization_mode()
        self._check()
        return self.outputs()

    def step(self, h: float, **inputs: float) -> dict[str, float]:
        """Set the inputs, take one step of `h` seconds and return all outputs."""
        self.set(**inputs)
        self.unit.do_step(self.time, h)
        self._check()
        self.time += h
        return self.outputs()

    def outputs(self) -> dict[str, float]:
        return dict(zip(self.answers, self.unit.get_real([*self.answers.values()]), strict=True))

    def __getitem__(self, name: str) -> Any:
        getter = getattr(self.unit, f"get_{self.type[name]}")
        value = getter([self.reference[name]])[0]
        return self.choices[name][value - 1] if name in self.choices else value

    def _number(self, name: str, value: Any) -> Any:
        """Return a value as a host gives it: of a choice its number, 0 if there is no such choice."""
        if name not in self.choices or not isinstance(value, str):
            return value
        return self.choices[name].index(value) + 1 if value in self.choices[name] else 0

    def _check(self) -> None:
        messages = [m.msg for m in self.unit.log_queue if m.status >= 3]
        if messages:
            raise AssertionError("\n".join(messages))


def four(name: str, *values: float) -> dict[str, float]:
    """Return a signal of four wheels: one value for all, or one for each."""
    values = values * 4 if len(values) == 1 else values
    return {f"{name}_{wheel}": value for wheel, value in zip(WHEELS, values, strict=True)}


def wheel_values(outputs: dict[str, float], name: str) -> list[float]:
    return [outputs[f"{name}_{wheel}"] for wheel in WHEELS]
