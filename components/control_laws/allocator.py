"""Base class of allocators: longitudinal forces for a yaw moment, added to the driver's force.

The driver's force is equal left and right on each axle, as from a pedal, and is not part of the requested
moment: with steered front wheels it turns the car by itself, as it does without control.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from yawbench.vocabulary.wheels import Four

from ..cars.wheel_kinematics import lever_arms
from ..fmi.component import Component
from ..fmi.variables import of_car, output, parameter, signal
from .moment_sharing import add_drive_force

BASIC = ("yaw_moment", "drive_force", "steer_angle")
"""Inputs of every allocator."""


@dataclass(frozen=True)
class DriveParameters:
    """Parameters of the driver's force."""

    drive_front_share: float = of_car(
        0.5, "chosen: equal motors", text="Share of the driver's force in front", maximum=1.0
    )
    brake_front_share: float = parameter(
        -1.0,
        "1",
        "Share of the driver's braking force in front; if negative, that of the driving force",
        "chosen: the same share for both",
        minimum=-1.0,
        maximum=1.0,
    )


class Allocator(Component):
    """Base class of allocators, which share the yaw moment among the wheels and add the driver's force."""

    sampled = True
    inputs: ClassVar[Any] = ("yaw_moment", signal("drive_force", optional=True), "steer_angle")
    outputs = (output("force_request_*", *BASIC),)

    least_arm: float
    """Arm [m] below which a wheel's share fades (`moment_sharing`): an eighth of the track."""

    def configure(self) -> None:
        self.half_track = 0.5 * self.p.track_width
        self.least_arm = 0.25 * self.half_track

    def share(self, u: list[float], arms: Four) -> Four:
        """Return the forces [N] of fl, fr, rl, rr that give the moment, with lever arms `arms` [m]."""
        raise NotImplementedError

    def output(self, t: float, u: list[float]) -> Four:
        p, drive = self.p, u[1]
        forces = self.share(u, lever_arms(u[2], p.cg_to_front_axle, self.half_track))
        if drive == 0.0:
            return forces
        braking = drive < 0.0 and p.brake_front_share >= 0.0
        return add_drive_force(forces, drive, p.brake_front_share if braking else p.drive_front_share)
