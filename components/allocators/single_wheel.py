"""Yaw-moment allocation by braking a single wheel, chosen by steer angle and yaw-rate error.

    delta > 0,  dr > 0   oversteer    front right        delta <= 0,  dr > 0   understeer   rear right
    delta > 0,  dr <= 0  understeer   rear left          delta <= 0,  dr <= 0  oversteer    front left

with dr = r - r_ref: oversteer brakes the outer front wheel, understeer the inner rear wheel. The chosen
wheel supplies the whole moment through its own arm, F = -|M / arm|; at delta = 0 that is 2 |M| / d. The
driver's force is added unchanged.

The rule ignores the requested moment, so it may choose a wheel that turns the car the other way. Four
readings:

    printed     brake the wheel of the rule, whatever the sign of M
    guarded     brake it only if its moment has the sign of M
    moment      replace dr by -M: the side follows the moment, the axle the driving state
    rotation    replace dr by -M and delta by r: a moment against the car's rotation brakes the outer front
                wheel, one that supports it the inner rear wheel, also while the driver steers against a slide

`other_wheel_share` of the moment comes from the other wheel of the same side.

Straight ahead, delta = 0, the printed rule brakes a front wheel on one side but a rear wheel on the other.
The other readings choose the front wheel on both: a driver who does not steer requests no turn, so any
yaw rate is oversteer, and left and right are treated alike.

Dead band with hysteresis: braking begins when |M| and |dr| both exceed their thresholds, and ends when
either falls below `release_share` of its threshold.

Source: paper C, table 3, equations (7)-(9). Erratum: (7)-(9) share the moment between two wheels, which would
give the single wheel of section 2.3 only half. Ours differs: the true arm, the guard, the rotation, the other
wheel, straight ahead, the dead band.
"""

from dataclasses import dataclass

from yawbench.vocabulary.wheels import Four

from ..cars.published_cars import PaperC
from ..control_laws.allocator import BASIC, Allocator, DriveParameters
from ..control_laws.moment_sharing import NO_FORCE, share_moment
from ..fmi.variables import like, output, parameter

FL, FR, RL, RR = range(4)
BEHIND = (RL, RR, FL, FR)
"""The other wheel of the same side."""


@dataclass(frozen=True)
class SingleWheelParameters:
    """Geometry of the car, reading of the rule and dead band."""

    cg_to_front_axle: float = like(PaperC, "cg_to_front_axle")
    track_width: float = like(PaperC, "track_width")
    wheel_choice: str = parameter(
        "guarded",
        None,
        "Reading of the rule",
        "chosen: guarded, brake only a wheel whose moment has the sign of M",
        choices=("printed", "guarded", "moment", "rotation"),
    )
    other_wheel_share: float = parameter(
        0.0,
        "1",
        "Share of the moment from the other wheel of the side",
        "paper C: a single wheel",
        minimum=0.0,
        maximum=1.0,
    )
    moment_threshold: float = parameter(
        200.0, "N.m", "Moment above which a wheel is braked", "chosen", minimum=0.0
    )
    yaw_rate_threshold: float = parameter(
        0.005, "rad/s", "Yaw-rate error above which a wheel is braked", "chosen: sensor noise", minimum=0.0
    )
    release_share: float = parameter(
        0.5, "1", "Share of a threshold below which braking ends", "chosen: half", minimum=0.0, maximum=1.0
    )
    drive_front_share: float = like(DriveParameters, "drive_front_share", 0.0, "chosen: rear drive")
    brake_front_share: float = like(DriveParameters, "brake_front_share")


def chosen_wheel(delta: float, dr: float, *, printed: bool = False) -> int:
    """Return the index of the wheel of table 3 for a steer angle [rad] and yaw-rate error [rad/s].

    Args:
        printed: apply the rule as printed also straight ahead.
    """
    if delta > 0.0:
        return FR if dr > 0.0 else RL
    if delta == 0.0 and not printed:
        return FR if dr > 0.0 else FL
    return RR if dr > 0.0 else FL


def brake_forces(
    moment: float, wheel: int, *, guarded: bool, arms: Four, least_arm: float, other_share: float = 0.0
) -> Four:
    """Return the longitudinal forces [N] that brake `wheel` for `moment` [N.m].

    Args:
        guarded: brake only if that gives a moment of the sign of `moment`.
        arms, least_arm: as in `share_moment` [m].
        other_share: share of the moment from the other wheel of the side [1].
    """
    weights = [0.0, 0.0, 0.0, 0.0]
    weights[wheel] = 1.0 - other_share
    weights[BEHIND[wheel]] = other_share
    forces = share_moment(moment, (weights[0], weights[1], weights[2], weights[3]), arms, least_arm)
    if forces[wheel] <= 0.0:
        return forces
    if guarded:
        return NO_FORCE
    fl, fr, rl, rr = forces
    return -fl, -fr, -rl, -rr


class SingleWheel(Allocator):
    """Yaw-moment allocation by braking a single wheel, chosen by steer angle and yaw-rate error."""

    Parameters = SingleWheelParameters
    inputs = (*Allocator.inputs, "yaw_rate", "yaw_rate_ref")
    outputs = (output("force_request_*", *BASIC, "yaw_rate", "yaw_rate_ref"),)

    def start(self, t: float, u: list[float]) -> None:
        self.braking = False
        self._decide(u)

    def advance(self, t: float, h: float, u: list[float]) -> None:
        self._decide(u)

    def share(self, u: list[float], arms: Four) -> Four:
        if not self.braking:
            return NO_FORCE
        moment, _, delta, r, r_ref = u
        choice = self.p.wheel_choice
        printed = choice == "printed"
        dr = -moment if choice in ("moment", "rotation") else r - r_ref
        wheel = chosen_wheel(r if choice == "rotation" else delta, dr, printed=printed)
        return brake_forces(
            moment,
            wheel,
            guarded=not printed,
            arms=arms,
            least_arm=self.least_arm,
            other_share=self.p.other_wheel_share,
        )

    def _decide(self, u: list[float]) -> None:
        p = self.p
        share = p.release_share if self.braking else 1.0
        self.braking = abs(u[0]) > share * p.moment_threshold and (
            abs(u[3] - u[4]) > share * p.yaw_rate_threshold
        )
