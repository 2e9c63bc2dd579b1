"""The signal dictionary: the name, unit and meaning of everything units say to each other.

Axes and signs are those of ISO 8855: x forward, y left, z up; angles and moments positive
counter-clockwise seen from above. `*` stands for the four wheels fl, fr, rl, rr.
"""

from __future__ import annotations

SIGNALS: dict[str, tuple[str, str]] = {
    "velocity_x": ("m/s", "Longitudinal velocity v_x of the centre of mass, vehicle axes"),
    "velocity_y": ("m/s", "Lateral velocity v_y of the centre of mass, vehicle axes"),
    "yaw_rate": ("rad/s", "Yaw rate r"),
    "sideslip": ("rad", "Sideslip angle beta = atan2(v_y, v_x) of the centre of mass"),
    "sideslip_rate": ("rad/s", "Time derivative of the sideslip angle"),
    "acceleration_x": ("m/s2", "Longitudinal acceleration of the centre of mass, vehicle axes"),
    "acceleration_y": ("m/s2", "Lateral acceleration of the centre of mass, vehicle axes"),
    "roll_angle": ("rad", "Roll angle, positive with the left side up"),
    "roll_rate": ("rad/s", "Roll rate"),
    "pitch_angle": ("rad", "Pitch angle, positive with the nose down"),
    "position_x": ("m", "Position of the centre of mass, earth axes, x"),
    "position_y": ("m", "Position of the centre of mass, earth axes, y"),
    "yaw_angle": ("rad", "Yaw angle psi"),
    "steer_angle": ("rad", "Road-wheel steer angle delta of the front axle"),
    "steering_wheel_angle": ("rad", "Hand-wheel angle"),
    "drive_force": ("N", "Sum of the longitudinal tyre forces the driver asks for"),
    "friction": ("1", "Friction coefficient mu of the road, as known to reference and controller"),
    "friction_*": ("1", "Friction coefficient mu under the wheel"),
    "yaw_rate_ref": ("rad/s", "Yaw rate the driver asks for"),
    "sideslip_ref": ("rad", "Sideslip angle the driver asks for"),
    "yaw_acceleration_ref": ("rad/s2", "Time derivative of yaw_rate_ref"),
    "sideslip_rate_ref": ("rad/s", "Time derivative of sideslip_ref"),
    "yaw_moment": ("N.m", "Yaw moment M_z asked of the wheels' longitudinal forces"),
    "force_request_*": ("N", "Longitudinal tyre force asked for, wheel axes"),
    "torque_request_*": ("N.m", "Wheel torque asked for, positive when driving"),
    "wheel_torque_*": ("N.m", "Torque at the wheel, positive when driving"),
    "tyre_force_x_*": ("N", "Longitudinal tyre force, wheel axes, at the contact point"),
    "tyre_force_y_*": ("N", "Lateral tyre force, wheel axes, at the contact point"),
    "aligning_moment_*": ("N.m", "Self-aligning moment of the tyre about its vertical axis"),
    "overturning_moment_*": ("N.m", "Overturning moment of the tyre about its longitudinal axis"),
    "slip_stiffness_*": ("N", "Slope dF_x/dkappa of the tyre's force at tyre_slip_ratio; 0: not told"),
    "tyre_slip_ratio_*": ("1", "Longitudinal slip that the tyre's force and slip_stiffness belong to"),
    "slip_angle_*": ("rad", "Slip angle alpha = atan2(v_y, v_x) in wheel axes"),
    "inclination_angle_*": (
        "rad",
        "Inclination angle gamma of the wheel, positive: top to the right",
    ),
    "slip_ratio_*": ("1", "Longitudinal slip kappa = (w R - v) / max(|w R|, |v|)"),
    "vertical_load_*": ("N", "Vertical load F_z on the tyre, positive upwards"),
    "wheel_speed_*": ("rad/s", "Angular velocity w of the wheel"),
    "wheel_velocity_*": ("m/s", "Longitudinal velocity v of the wheel, wheel axes"),
}

LEAST: dict[str, float] = {"friction": 0.0, "friction_*": 0.0}
"""Lower limits: a smaller value is a mistake, not a strange road."""
