"""What the control side of a car is given: the truth, measurements, estimates.

The role of its source determines what a signal is: an estimator gives estimates, a sensor measurements; a
signal from elsewhere (the plant, the driver), but not from the control side itself, is the truth, exact and
without delay, which no real car has.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from yawbench.foundation.errors import Diagnostic
from yawbench.foundation.messages import fold, listed

from ..plan import SENSING, Instance, Wire

CONTROL = ("reference", "controller", "allocator", "wheel_control", "monitor")
"""Roles that command the car."""
TRUTH = "truth"


def seen_as(wire: Wire, instances: Iterable[Instance]) -> str:
    """Return the kind of a wire to the control side: "truth", "late truth", "measurement" or "estimate".

    "" if the source is on the control side itself, or the target is not.
    """
    roles = {instance.name: instance.role for instance in instances}
    if roles[wire.target] not in (*CONTROL, "estimator") or roles[wire.source] in CONTROL:
        return ""
    truth = "late truth" if wire.output.endswith("_delayed") else TRUTH
    return SENSING.get(roles[wire.source], truth)


def exact(instances: Sequence[Instance], wires: Iterable[Wire]) -> list[Diagnostic]:
    """Return a note on signals that the control side gets exactly although there is a sensor.

    Instances that only observe, such as a reference for comparison, may use the truth: they do not affect
    the car.
    """
    wires = list(wires)
    if not any(instance.role == "sensor" for instance in instances):
        return []
    steering = _steering(instances, wires)
    inputs: dict[tuple[str, str], list[str]] = {}
    for wire in wires:
        if wire.target in steering and seen_as(wire, instances) == TRUTH:
            inputs.setdefault((wire.target, wire.source), []).append(wire.input)
    parts = [f"{listed(fold(names))} of {to} (from {of})" for (to, of), names in inputs.items()]
    sentence = f"exact, though there is a sensor: {'; '.join(parts)}"
    return [Diagnostic("sensor-bypassed", sentence, "info")] if parts else []


def _steering(instances: Iterable[Instance], wires: Iterable[Wire]) -> set[str]:
    """Return the instances that affect, directly or through others, one outside the control side."""
    inside = {instance.name for instance in instances if instance.role in (*CONTROL, "estimator")}
    reached = {instance.name for instance in instances} - inside
    while more := {w.source for w in wires if w.target in reached} - reached:
        reached |= more
    return reached
