"""Signals in symbols and words: what the field calls a variable of the signal dictionary."""

from __future__ import annotations

from functools import cache

from ..scenario.measurement_units import conversion, measure_of, parse_unit

SYMBOLS: dict[str, str] = {
    "steer_angle": "δ",
    "steering_wheel_angle": "δ_H",
    "sideslip": "β",
    "sideslip_rate": "dβ/dt",
    "yaw_rate": "r",
    "yaw_angle": "ψ",
    "roll_angle": "φ",
    "pitch_angle": "θ",
    "velocity_x": "v_x",
    "velocity_y": "v_y",
    "acceleration_x": "a_x",
    "acceleration_y": "a_y",
    "position_x": "x",
    "position_y": "y",
    "yaw_moment": "M_z",
    "wheel_torque_*": "T",
    "torque_request_*": "T",
    "force_request_*": "F_x",
    "tyre_force_x_*": "F_x",
    "tyre_force_y_*": "F_y",
    "vertical_load_*": "F_z",
    "slip_angle_*": "α",
    "slip_ratio_*": "κ",
    "wheel_speed_*": "ω",
}
"""Signal -> the field's symbol, as the papers write it; `_` begins a subscript."""

WORDS: dict[str, str] = {
    "steer_angle": "Steer angle",
    "steering_wheel_angle": "Hand-wheel angle",
    "sideslip": "Sideslip angle",
    "sideslip_rate": "Sideslip rate",
    "yaw_rate": "Yaw rate",
    "yaw_angle": "Yaw angle",
    "roll_angle": "Roll angle",
    "velocity_x": "Longitudinal velocity",
    "acceleration_x": "Longitudinal acceleration",
    "acceleration_y": "Lateral acceleration",
    "position_x": "Longitudinal position",
    "position_y": "Lateral position",
    "yaw_moment": "Yaw moment",
    "wheel_torque_*": "Wheel torque",
    "torque_request_*": "Wheel torque asked for",
    "force_request_*": "Longitudinal force asked for",
    "tyre_force_x_*": "Longitudinal tyre force",
    "tyre_force_y_*": "Lateral tyre force",
    "vertical_load_*": "Vertical load",
    "slip_angle_*": "Slip angle",
    "slip_ratio_*": "Longitudinal slip",
    "wheel_speed_*": "Wheel speed",
}


SI = ("1", "s", "m", "kg", "N", "Pa", "rad", "m/s", "rad/s", "m/s2", "rad/s2", "N.m")
"""Units that the signals of the dictionary have."""


@cache
def si_of(unit: str) -> tuple[str, float]:
    """Return the unit of the dictionary that measures the same, and the factor to it."""
    measure = measure_of(unit)
    for si in SI if measure is not None and unit not in SI else ():
        factors = conversion(measure, parse_unit(si))  # type: ignore[arg-type]
        if factors is not None and factors[1] == 0.0:
            return si, factors[0]
    return unit, 1.0


def variable_of(column: str) -> str:
    """Return the variable's name of `unit.variable`, or the name itself."""
    return column.rpartition(".")[2]


def symbol(signal: str) -> str:
    """Return the symbol of a signal, or its name where the field has none."""
    name = variable_of(signal)
    if name.endswith("_ref"):
        return f"{symbol(name.removesuffix('_ref'))}_ref"
    return SYMBOLS.get(name, name)


def words(signal: str) -> str:
    """Return the signal in words, with a capital."""
    name = variable_of(signal)
    return WORDS.get(name, name.replace("_*", "").replace("_", " ").capitalize())
