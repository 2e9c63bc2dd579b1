"""Roles of instances, and the signals that each role requires.

An FMU with these signals can replace any other FMU of its role. The folder of a component determines its
role; the name of its FMU is composed of role and file name: `controllers/fnn.py` becomes `controller_fnn`.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Role:
    """Role: its name, and the signals that its FMUs must declare (`*` = four wheels)."""

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
    "steering_actuators": Role("steering_actuator", inputs=("steer_angle",), outputs=("total_steer_angle",)),
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


def role_in(fmu: str) -> str:
    """Return the role in the name of an FMU, `<role>_<name>`; "" if there is none."""
    return next((role.name for role in ROLES.values() if fmu.startswith(f"{role.name}_")), "")


def without_role(fmu: str) -> str:
    """Return the name of an FMU without its role."""
    return fmu.removeprefix(f"{role_in(fmu)}_")


def role_of(instance: str, fmu: str, declared: str = "") -> str:
    """Return the role of an instance: declared by the FMU, else in the FMU's name, else the instance's name.

    Args:
        instance: its name in the scenario.
        fmu: the name of its FMU.
        declared: the role in the FMU's model description, "" if there is none.
    """
    return declared or role_in(fmu) or instance
