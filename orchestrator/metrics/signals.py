"""Signals in symbols and words: what the field calls a variable of the signal dictionary."""

from __future__ import annotations

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
