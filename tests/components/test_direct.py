"""Torque from force times radius."""

from __future__ import annotations

from yawbench.components.wheel_controls.direct import Direct

from .stand import Stand


def torques(*forces, **parameters):
    stand = Stand(Direct, **parameters)
    inputs = dict(zip(("fl", "fr", "rl", "rr"), forces, strict=True))
    return list(stand.start(**{f"force_request_{w}": f for w, f in inputs.items()}).values())


def test_torque_is_force_times_radius():
    assert torques(100.0, -200.0, 0.0, 1000.0, wheel_radius=0.25) == [25.0, -50.0, 0.0, 250.0]


def test_torque_stops_at_the_limit_on_both_sides_of_zero():
    assert torques(1e5, -1e5, 401.0, -401.0, wheel_radius=1.0) == [400.0, -400.0, 400.0, -400.0]
    assert torques(1e5, -1e5, 1.0, -1.0, torque_limit=0.0) == [0.0, 0.0, 0.0, 0.0]
