"""Steer of the wheels by roll, wheel travel and side force, and the lag of slip angles behind them.

    steer_i = e_i c_i / y_i - k Y_axle       sigma / |v_i| dalpha_i' / dt + alpha_i' = alpha_i - steer_i

e is the roll steer of the axle, c_i the travel of the wheel at y_i (to the left), positive in bump, or
-phi y_i in a plant without wheel travel; k the axle's compliance to its side force Y, sigma the relaxation
length of the tyres. alpha_i' is the slip angle that a plant gives. All three are off by default: then
alpha_i' = alpha_i.

With e > 0 an axle understeers: its front wheels steer out of the turn as the body rolls (toe-out in bump),
its rear wheels into the turn (toe-in in bump). So roll steer and bump steer are one: a wheel's steer over its
travel. With k > 0 wheels yield to the side force; this understeers in front and oversteers at the rear.

The steer by compliance follows the force with `LAG`, as wheel and linkage have inertia; without it the loop
of force and steer would have no time of its own. Angles are small: the tyre forces keep the directions of the
wheels without these angles, which neglects Y sin(steer) along the car, 2 % of Y at one degree.

Sources: roll steer and compliance as in R. T. Bundorf, R. L. Leffert, The cornering compliance concept for
description of vehicle directional control properties, SAE 760713, 1976 (not read; as encyclopaedias quote
it); relaxation as in H. B. Pacejka, Tyre and Vehicle Dynamics, 2nd ed. 2006, section 7.1, of the slip angle
alone. Slip ratios do not lag.
"""

from dataclasses import dataclass
from math import exp

from yawbench.vocabulary.wheels import Four

from ..fmi.variables import of_car

LAG = 0.01
"""Time constant [s] of the steer by compliance; chosen: a front wheel on its linkage swings at about 15 Hz."""


@dataclass(frozen=True)
class WheelYieldParameters:
    """Compliance of both axles to side force, and relaxation of the slip angle."""

    steer_compliance_front: float = of_car(0.0, "chosen: rigid")
    steer_compliance_rear: float = of_car(0.0, "chosen: rigid")
    tyre_relaxation_length: float = of_car(0.0, "chosen: at once")


@dataclass(frozen=True)
class RollSteerParameters:
    """Roll steer of both axles."""

    roll_steer_front: float = of_car(0.0, "chosen: none", minimum=-1.0, maximum=1.0)
    roll_steer_rear: float = of_car(0.0, "chosen: none", minimum=-1.0, maximum=1.0)


def steer_by_travel(
    left: float, right: float, half_track: float, *, coefficient: float
) -> tuple[float, float]:
    """Return the steer angles [rad] of the left and right wheel of an axle from their travel [m].

    Args:
        left, right: travel, positive in bump [m].
        half_track: [m].
        coefficient: e of a front axle, -e of a rear one [1].
    """
    share = coefficient / half_track
    return share * left, -share * right


class Yielding:
    """Steer by compliance of both axles, and the slip angles that lag."""

    def __init__(self, p: WheelYieldParameters) -> None:
        self.front, self.rear = p.steer_compliance_front, p.steer_compliance_rear
        self.length = p.tyre_relaxation_length
        self.steers = 0.0, 0.0
        self.angles: Four = (0.0, 0.0, 0.0, 0.0)

    def begin(self, angles: Four) -> None:
        """Set the state at start time: wheels without side force, slip angles `angles` [rad]."""
        self.steers = 0.0, 0.0
        self.angles = angles

    def advance(self, h: float, side: Four, angles: Four, speeds: Four) -> None:
        """Advance by `h` > 0 [s].

        Args:
            h: step [s].
            side: lateral forces of the wheels, held over the step [N].
            angles: slip angles of wheels that do not yield, at the end of the step [rad].
            speeds: longitudinal velocities of the wheels [m/s].
        """
        fl, fr, rl, rr = side
        weight = h / (h + LAG)
        front, rear = self.steers
        front += weight * (-self.front * (fl + fr) - front)
        rear += weight * (-self.rear * (rl + rr) - rear)
        self.steers = front, rear
        a_fl, a_fr, a_rl, a_rr = angles
        a_fl, a_fr, a_rl, a_rr = a_fl - front, a_fr - front, a_rl - rear, a_rr - rear
        if self.length > 0.0:
            v_fl, v_fr, v_rl, v_rr = speeds
            b_fl, b_fr, b_rl, b_rr = self.angles
            rate = -h / self.length
            a_fl += (b_fl - a_fl) * exp(rate * abs(v_fl))
            a_fr += (b_fr - a_fr) * exp(rate * abs(v_fr))
            a_rl += (b_rl - a_rl) * exp(rate * abs(v_rl))
            a_rr += (b_rr - a_rr) * exp(rate * abs(v_rr))
        self.angles = a_fl, a_fr, a_rl, a_rr
