"""The roles a unit can play and the signals each of them must show.

A unit that keeps this contract can replace any other of its role. The folder a component
stands in gives its role, folder and file name together the name of its FMU:
`controllers/fnn.py` becomes `controller_fnn`.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Role:
    """A role: its name and the signals that every unit of it declares (`*` = four wheels)."""

    name: str
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()


ROLES: dict[str, Role] = {
    "drivers": Role("driver", outputs=("steer_angle",)),
    "references": Role(
        "reference", inputs=("steer_angle", "velocity_x"), outputs=("yaw_rate_ref", "sideslip_ref")
    ),
    "controllers": Role("controller", outputs=("yaw_moment",)),
    "allocators": Role("allocator", inputs=("yaw_moment",), outputs=("force_request_*",)),
    "wheel_controls": Role("wheel_control", inputs=("force_request_*",), outputs=("torque_request_*",)),
    "actuators": Role("actuator", inputs=("torque_request_*",), outputs=("wheel_torque_*",)),
    "plants": Role(
        "plant",
        inputs=("steer_angle", "tyre_force_x_*", "tyre_force_y_*"),
        outputs=(
            "velocity_x",
            "velocity_y",
            "yaw_rate",
            "sideslip",
            "acceleration_x",
            "acceleration_y",
            "position_x",
            "position_y",
            "yaw_angle",
            "slip_angle_*",
            "slip_ratio_*",
            "vertical_load_*",
        ),
    ),
    "tyres": Role(
        "tyre",
        inputs=("slip_angle_*", "slip_ratio_*", "vertical_load_*", "friction_*"),
        outputs=("tyre_force_x_*", "tyre_force_y_*"),
    ),
    "roads": Role("road", outputs=("friction_*", "friction")),
    "sensors": Role("sensor"),
    "estimators": Role("estimator", outputs=("velocity_x", "sideslip")),
    "monitors": Role("monitor", inputs=("yaw_moment_wanted",), outputs=("yaw_moment",)),
}
"""Folder below `components/` -> role."""
