"""Signal dictionary: name, unit, meaning and symbol of the signals that components exchange.

Axes and signs follow ISO 8855: x forward, y left, z up; angles and moments are positive
counter-clockwise seen from above. `*` means the four wheels fl, fr, rl, rr.
"""

import math
from typing import NamedTuple


class SignalEntry(NamedTuple):
    """Properties of a signal."""

    unit: str
    text: str
    """Meaning: the description of its variables in FMUs."""
    symbol: str = ""
    """Symbol as used in papers; `_` begins a subscript. The symbol of `x_ref` follows from that of `x`."""
    words: str = ""
    """Name in headings, if it differs from the words of the identifier."""
    minimum: float | None = None
    """Smallest valid value."""
    largest: float | None = None
    """Largest plausible magnitude in a measurement; larger values are probably in another unit. Chosen."""


SYMBOLS = {
    "psi": "yaw",
    "beta": "sideslip",
    "delta": "steer",
    "phi": "roll",
    "theta": "pitch",
    "mu": "friction",
    "dot": "rate",
    "mz": "yaw_moment",
    "fz": "vertical_load",
    "vx": "velocity",
    "vy": "velocity",
    "ax": "acceleration",
    "ay": "acceleration",
}
"""Symbol in variable names of other tools -> the words used here."""

SIGNALS: dict[str, SignalEntry] = {
    "velocity_x": SignalEntry(
        "m/s",
        "Longitudinal velocity v_x of the centre of mass, vehicle axes",
        "v_x",
        "Longitudinal velocity",
        largest=70.0,  # above the top speed of nearly all cars
    ),
    "velocity_y": SignalEntry(
        "m/s",
        "Lateral velocity v_y of the centre of mass, vehicle axes",
        "v_y",
        "Lateral velocity",
        largest=70.0,
    ),
    "yaw_rate": SignalEntry("rad/s", "Yaw rate r", "r", largest=5.0),  # 4 times that of a spinning car
    "sideslip": SignalEntry(
        "rad",
        "Sideslip angle beta = atan2(v_y, v_x) of the centre of mass",
        "β",
        "Sideslip angle",
        largest=math.pi,
    ),
    "sideslip_rate": SignalEntry("rad/s", "Time derivative of the sideslip angle", "dβ/dt"),
    "acceleration_x": SignalEntry(
        "m/s2",
        "Longitudinal acceleration of the centre of mass, vehicle axes",
        "a_x",
        "Longitudinal acceleration",
        largest=30.0,  # three times the grip of road tyres
    ),
    "acceleration_y": SignalEntry(
        "m/s2",
        "Lateral acceleration of the centre of mass, vehicle axes",
        "a_y",
        "Lateral acceleration",
        largest=30.0,
    ),
    "roll_angle": SignalEntry("rad", "Roll angle, positive with the left side up", "φ", largest=math.pi),
    "roll_rate": SignalEntry("rad/s", "Roll rate", largest=5.0),
    "pitch_angle": SignalEntry("rad", "Pitch angle, positive with the nose down", "θ", largest=math.pi),
    "position_x": SignalEntry(
        "m", "Position of the centre of mass, earth axes, x", "x", "Longitudinal position"
    ),
    "position_y": SignalEntry("m", "Position of the centre of mass, earth axes, y", "y", "Lateral position"),
    "yaw_angle": SignalEntry("rad", "Yaw angle psi", "ψ"),
    "steer_angle": SignalEntry(
        "rad",
        "Road-wheel steer angle delta of the front axle",
        "δ",
        largest=1.05,  # 60 degrees, above the lock of all cars
    ),
    "added_steer_angle_request": SignalEntry(
        "rad", "Requested angle that steering adds to the driver's", "δ_a*"
    ),
    "added_steer_angle": SignalEntry("rad", "Angle that steering adds to the driver's", "δ_a"),
    "total_steer_angle": SignalEntry(
        "rad", "Road-wheel steer angle, the driver's and the added one", "δ_total"
    ),
    "steering_wheel_angle": SignalEntry(
        "rad",
        "Hand-wheel angle",
        "δ_H",
        "Hand-wheel angle",
        largest=4.0 * math.pi,  # two turns
    ),
    "drive_force": SignalEntry("N", "Sum of the longitudinal tyre forces requested by the driver"),
    "friction": SignalEntry(
        "1",
        "Friction coefficient mu of the road, as known to reference and controller",
        minimum=0.0,
        largest=2.0,
    ),
    "friction_*": SignalEntry("1", "Friction coefficient mu under the wheel", minimum=0.0),
    "friction_delayed": SignalEntry(
        "1", "Friction coefficient mu of the road, known with a delay", minimum=0.0
    ),
    "slope": SignalEntry("rad", "Angle by which the road rises along the vehicle's x axis", "θ_road"),
    "bank": SignalEntry(
        "rad", "Angle by which the road rises along the vehicle's y axis, to the left", "φ_road"
    ),
    "wind_force_y": SignalEntry("N", "Side force of the wind, vehicle axes, at the centre of mass", "F_wind"),
    "wind_moment_z": SignalEntry("N.m", "Moment of the wind about the vertical axis", "M_wind"),
    "yaw_rate_ref": SignalEntry("rad/s", "Yaw rate requested by the driver"),
    "sideslip_ref": SignalEntry("rad", "Sideslip angle requested by the driver"),
    "yaw_acceleration_ref": SignalEntry("rad/s2", "Time derivative of yaw_rate_ref"),
    "sideslip_rate_ref": SignalEntry("rad/s", "Time derivative of sideslip_ref"),
    "yaw_moment": SignalEntry("N.m", "Requested yaw moment M_z of the longitudinal wheel forces", "M_z"),
    "engine_reduction": SignalEntry(
        "1", "Share of the driver's driving force that stability control takes from the engine", minimum=0.0
    ),
    "brake_preparation": SignalEntry(
        "1", "1 while brakes are to be filled because an intervention is near or on, else 0", minimum=0.0
    ),
    "force_request_*": SignalEntry(
        "N", "Requested longitudinal tyre force, wheel axes", "F_x", "Requested longitudinal force"
    ),
    "torque_request_*": SignalEntry(
        "N.m", "Requested wheel torque, positive when driving", "T", "Requested wheel torque"
    ),
    "wheel_torque_*": SignalEntry("N.m", "Torque at the wheel, positive when driving", "T"),
    "tyre_force_x_*": SignalEntry(
        "N", "Longitudinal tyre force, wheel axes, at the contact point", "F_x", "Longitudinal tyre force"
    ),
    "tyre_force_y_*": SignalEntry(
        "N", "Lateral tyre force, wheel axes, at the contact point", "F_y", "Lateral tyre force"
    ),
    "aligning_moment_*": SignalEntry("N.m", "Self-aligning moment of the tyre about its vertical axis"),
    "tyre_moment_z_*": SignalEntry("N.m", "Moment of the tyre about its vertical axis that turns the car"),
    "overturning_moment_*": SignalEntry("N.m", "Overturning moment of the tyre about its longitudinal axis"),
    "slip_stiffness_*": SignalEntry(
        "N", "Derivative dF_x/dkappa of the tyre force at tyre_slip_ratio; 0: unknown"
    ),
    "tyre_slip_ratio_*": SignalEntry(
        "1", "Longitudinal slip to which the tyre force and slip_stiffness belong"
    ),
    "slip_angle_*": SignalEntry("rad", "Slip angle alpha = atan2(v_y, v_x) in wheel axes", "α"),
    "inclination_angle_*": SignalEntry(
        "rad", "Inclination angle gamma of the wheel, positive: top to the right", "γ"
    ),
    "slip_ratio_*": SignalEntry(
        "1", "Longitudinal slip kappa = (w R - v) / max(|w R|, |v|)", "κ", "Longitudinal slip"
    ),
    "vertical_load_*": SignalEntry("N", "Vertical load F_z on the tyre, positive upwards", "F_z"),
    "wheel_speed_*": SignalEntry("rad/s", "Angular velocity w of the wheel", "ω"),
    "wheel_velocity_*": SignalEntry("m/s", "Longitudinal velocity v of the wheel, wheel axes"),
}
