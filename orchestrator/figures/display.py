"""Signals and numbers as people read them: symbols, degrees, km/h, per cent, few digits."""

from __future__ import annotations

import math

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

_SHOWN: dict[str, tuple[str, float]] = {
    "rad": ("°", 180 / math.pi),
    "rad/s": ("°/s", 180 / math.pi),
    "rad/s2": ("°/s²", 180 / math.pi),
    "rad/s3": ("°/s³", 180 / math.pi),
    "m/s": ("km/h", 3.6),
    "m/s2": ("m/s²", 1.0),
    "N.m": ("N·m", 1.0),
    "N.m/s": ("kN·m/s", 1e-3),
    "N.m.s": ("N·m·s", 1.0),
    "Pa": ("bar", 1e-5),
    "Pa/s": ("bar/s", 1e-5),
    "1": ("", 1.0),
    "%": ("%", 100.0),
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


def in_formula(signal: str) -> str:
    """Return the symbol of a signal as matplotlib sets it, or nothing where the field has none."""
    if symbol(signal) == variable_of(signal):
        return ""
    head, _, index = symbol(signal).partition("_")
    return f"${head}_\\mathrm{{{index}}}$" if index else f"${head}$"


def words(signal: str) -> str:
    """Return the signal in words, with a capital."""
    name = variable_of(signal)
    return WORDS.get(name, name.replace("_*", "").replace("_", " ").capitalize())


def shown_unit(unit: str) -> tuple[str, float]:
    """Return the unit that people read and the factor from SI; `%` stands for a ratio in per cent."""
    return _SHOWN.get(unit, (unit.replace(".", "·"), 1.0))


def shown(value: float, unit: str, *, digits: int = 3) -> str:
    """Return a value given in SI as text in the unit that people read, e.g. `3.94 %`."""
    text, factor = shown_unit(unit)
    number = digits_of(value * factor, digits)
    return f"{number} {text}".rstrip() if math.isfinite(value) else number


def digits_of(value: float, digits: int = 3) -> str:
    """Return a number with so many significant digits, whole digits all kept, no exponent if readable."""
    if math.isinf(value):
        return "never" if value > 0 else "-∞"
    if math.isnan(value):
        return "no number"
    if value == 0:
        return "0"
    rounded = float(f"{value:.{digits - 1}e}")
    decimals = digits - 1 - math.floor(math.log10(abs(rounded)))
    return f"{value:.{digits - 1}e}" if decimals > 6 else f"{value:.{max(decimals, 0)}f}"
