"""Driver for a double lane change between cones: optimal path, followed by optimal preview control.

The path through the cones minimizes the tyre forces (`driving.lane_path`); it is computed once for the car,
its speed and the road. The rate of the hand wheel is optimal for the linear single-track car with the path
known for `preview_time` (`mathematics.preview_control`):

    x = (y, psi, v_y, r, delta)             d delta / dt = the input
    least   sum of  ((y - path) / e_0)^2 + (i_s d delta / dt)^2

with gains computed at whole metres per second and interpolated linearly. Real tyres give the front side force
of the linear car, F = C_f (delta - eta), eta = (v_y + a r) / v, at a larger slip angle alpha, after Fiala:

    F = F_max (1 - (1 - C_f alpha / (3 F_max))^3),      F_max = grip_share mu m g b / L

so the hand-wheel angle is i_s (eta + alpha), and F is limited to F_max, beyond which more steering does not
help. The driver has neither lag nor delay, only the largest angle and rate of a skilled driver.

The speed is held, or the accelerator is released `coasting_after` the first cones, as in ISO 3888-2
(`driving.speed_holding`). `path_offset` is the distance of the centre of mass from the path, `cone_overrun`
that of the body beyond the cones.

Source: R. S. Sharp, V. Valtetsiotis, Optimal preview car steering control, Vehicle System Dynamics 35
(supplement), 2001; C. C. MacAdam, Application of an optimal preview control for simulation of closed-loop
automobile driving, IEEE Trans. Systems, Man, and Cybernetics 11(6), 1981; E. Fiala,
Seitenkräfte am rollenden Luftreifen, VDI-Zeitschrift 96, 1954. The path and the correction for the tyres are
ours.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import copysign, cos, sin

from yawbench.vocabulary.gravity import G

from ..cars.published_cars import PaperA, PaperC
from ..cars.single_track_car import SingleTrackCar
from ..driving.lane_path import LanePath
from ..driving.speed_holding import HeldSpeedParameters, SpeedHold
from ..driving.track import TRACK_OUTPUTS, LaneChangeParameters, Track
from ..fmi.component import Component
from ..fmi.variables import like, parameter
from ..mathematics.preview_control import TrackingLaw, discrete
from .double_lane_change import DoubleLaneChangeParameters

STEP = 0.03
"""Time step of the preview [s]. Chosen: half a metre at 18 m/s."""
SLOWEST = 2.0
"""Speed below which the gains are constant [m/s]."""
MOST = 0.99
"""Largest share of F_max; chosen: 0.78 of the slip at which Fiala's force saturates."""
STATES = 5
"""Number of states (y, psi, v_y, r, hand wheel) of the linear car."""
KEPT = 3
"""Number of speeds whose gains are kept; chosen: two are interpolated, also when a whole speed is crossed."""


@dataclass(frozen=True)
class OptimalPreviewParameters(HeldSpeedParameters, LaneChangeParameters):
    """Parameters of the driver, of the driver's model of the car, and of the track."""

    path_margin: float = parameter(
        0.1, "m", "Desired margin between body and cones", "chosen: tuned", minimum=0.0
    )
    path_give: float = parameter(
        0.06,
        "m",
        "Lack of margin s_0 with the same cost as the side force path_effort",
        "chosen: tuned",
        minimum=1e-3,
    )
    path_effort: float = parameter(
        0.75, "1", "Share of the friction that the path uses unless the cones require more", "chosen: tuned",
        minimum=0.01,
    )  # fmt: skip
    path_deceleration: float = parameter(
        0.7,
        "m/s2",
        "Assumed deceleration of the coasting car by tyres and drag, for the path",
        "chosen: 60 to 53 km/h through ISO 3888-2",
        minimum=0.0,
    )
    preview_time: float = parameter(1.5, "s", "Preview time", "chosen: longer changes nothing", minimum=0.05)
    offset_scale: float = parameter(
        0.005,
        "m",
        "Distance e_0 from the path with the same cost as 1 rad/s of the hand wheel",
        "chosen: tuned",
        minimum=1e-5,
    )
    base_friction: float = parameter(
        0.9,
        "1",
        "Friction coefficient of the road that the driver assumes",
        "chosen: dry asphalt",
        minimum=0.01,
    )
    grip_share: float = parameter(
        0.9,
        "1",
        "Share of the friction available to the front axle",
        "chosen: load transfer takes a tenth",
        minimum=0.1,
    )
    steering_wheel_limit: float = like(DoubleLaneChangeParameters, "steering_wheel_limit")
    steering_wheel_rate_limit: float = parameter(
        20.0,
        "rad/s",
        "Largest rate of the hand wheel",
        "chosen: 1150 deg/s, as in an emergency; with 12 rad/s the driver would be the limit, not the tyres",
        minimum=0.01,
    )
    steering_ratio: float = like(DoubleLaneChangeParameters, "steering_ratio")
    coasting_after: float = parameter(
        -1.0,
        "m",
        "Distance after the first cones at which the accelerator is released; negative: never",
        "chosen: the speed is held",
    )
    mass: float = like(PaperC, "mass")
    yaw_inertia: float = like(PaperA, "yaw_inertia", 3234.0, "paper C, table 1")
    cg_to_front_axle: float = like(PaperC, "cg_to_front_axle")
    cg_to_rear_axle: float = like(PaperC, "cg_to_rear_axle")
    cornering_stiffness_front: float = like(DoubleLaneChangeParameters, "cornering_stiffness_front")
    cornering_stiffness_rear: float = like(DoubleLaneChangeParameters, "cornering_stiffness_rear")


class OptimalPreview(Component):
    """Driver for a double lane change between cones: optimal path, followed by optimal preview control."""

    Parameters = OptimalPreviewParameters
    inputs = ("velocity_x", "velocity_y", "yaw_rate", "position_x", "position_y", "yaw_angle")
    outputs = ("steer_angle", "drive_force", "steering_wheel_angle", *TRACK_OUTPUTS)

    def configure(self) -> None:
        self.track = Track(self.p)
        self.car = SingleTrackCar.of(self.p, self.p.yaw_inertia)
        self.steps = max(1, round(self.p.preview_time / STEP))
        self.path = planned(self.p)

    def start(self, t: float, u: list[float]) -> None:
        self.speed = SpeedHold(self.p, u[0])
        self.linear = self.hand = 0.0  # hand wheel of the linear and of the real car [rad]
        self.speeds = [-1] * KEPT  # whole speeds [m/s] of the gains, that of v at v % KEPT
        self.gains: list[float] = []  # of states and steps, for each of the speeds

    def advance(self, t: float, h: float, u: list[float]) -> None:
        p: OptimalPreviewParameters = self.p
        v, x = u[0], u[3]
        self.speed.advance(t, h, v)
        if p.coasting_after >= 0.0 and x >= p.track_start + p.coasting_after:
            self.speed.let_go = min(self.speed.let_go, t + h)
        fastest = p.steering_wheel_rate_limit * h
        self.linear += min(max(h * self._rate(u), -fastest), fastest)
        wanted = self._hand(u)
        wanted = min(max(wanted, self.hand - fastest), self.hand + fastest)
        self.hand = min(max(wanted, -p.steering_wheel_limit), p.steering_wheel_limit)

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        x, y, psi = u[3:]
        return (
            self.hand / self.p.steering_ratio,
            self.speed.force,
            self.hand,
            y - self.path(x),
            self.track.overrun(x, y, psi),
        )

    def _rate(self, u: list[float]) -> float:
        """Return the optimal rate of the linear car's hand wheel [rad/s], with interpolated gains."""
        v, v_y, r, x, y, psi = u
        along = STEP * (v * cos(psi) - v_y * sin(psi))
        level = max(v, SLOWEST)
        lower = int(level)
        share = level - lower
        first, second = self._place_of_gains(lower), self._place_of_gains(lower + 1)
        rate = above = 0.0
        for k, state in enumerate((y, psi, v_y, r, self.linear)):
            rate += self.gains[first + k] * -state
            above += self.gains[second + k] * -state
        for k in range(1, self.steps + 1):
            ahead = self.path(x + k * along)
            rate += self.gains[first + STATES - 1 + k] * ahead
            above += self.gains[second + STATES - 1 + k] * ahead
        return rate + share * (above - rate)

    def _place_of_gains(self, v: int) -> int:
        """Return the index of the first gain at a whole speed [m/s]; computes the gains if necessary."""
        count: int = STATES + self.steps
        while len(self.gains) < KEPT * count:
            self.gains.append(0.0)
        place = v % KEPT * count
        if self.speeds[v % KEPT] != v:
            self.speeds[v % KEPT] = v
            p: OptimalPreviewParameters = self.p
            law = tracking_law(v, self.car, p.steering_ratio, p.offset_scale)
            for k, gain in enumerate(law.gains):
                self.gains[place + k] = gain
            line = law.line
            for k in range(self.steps):
                self.gains[place + STATES + k] = law.gain_ahead(line)
                line = law.further(line)
        return place

    def _hand(self, u: list[float]) -> float:
        """Return the hand-wheel angle [rad] for the front side force of the linear car, with real tyres."""
        p: OptimalPreviewParameters = self.p
        car, ratio = self.car, p.steering_ratio
        v, v_y, r = u[0], u[1], u[2]
        eta = ratio * (v_y + car.a * r) / max(v, SLOWEST)
        largest = p.grip_share * p.base_friction * car.m * G * car.b / (car.a + car.b)
        change = MOST * ratio * largest / car.c_f
        self.linear = min(max(self.linear, eta - change), eta + change)
        share = (self.linear - eta) / ratio * car.c_f / largest
        alpha: float = 3.0 * largest / car.c_f * (1.0 - (1.0 - abs(share)) ** (1.0 / 3.0))
        return eta + copysign(ratio * alpha, share)


def lane_dynamics(
    car: SingleTrackCar, v: float, steering_ratio: float
) -> tuple[list[list[float]], list[float]]:
    """Return A and b of the state (y, psi, v_y, r, hand wheel) at `v` [m/s]; input: the hand wheel's rate."""
    columns = []
    for v_y, r, delta in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0 / steering_ratio)):
        turning, yawing = car.derivatives(v_y / v, r, delta=delta, v=v)
        columns.append((v * turning, yawing))
    (a_33, a_43), (a_34, a_44), (a_35, a_45) = columns
    return [
        [0.0, v, 1.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, a_33, a_34, a_35],
        [0.0, 0.0, a_43, a_44, a_45],
        [0.0, 0.0, 0.0, 0.0, 0.0],
    ], [0.0, 0.0, 0.0, 0.0, 1.0]  # fmt: skip


@lru_cache(maxsize=256)
def tracking_law(v: int, car: SingleTrackCar, steering_ratio: float, offset_scale: float) -> TrackingLaw:
    """Return the law that tracks a known path at `v` [m/s]."""
    phi, gamma = discrete(*lane_dynamics(car, float(v), steering_ratio), STEP)
    first = (1.0, 0.0, 0.0, 0.0, 0.0)  # y
    return TrackingLaw(phi, gamma, first, offset_scale**-2)


@lru_cache(maxsize=16)
def planned(p: OptimalPreviewParameters) -> LanePath:
    """Compute the path through the cones for the car, its target speed and the road."""
    track, car, v = Track(p), SingleTrackCar.of(p), max(p.target_speed, SLOWEST)
    yaw_gain, slip_gain = car.gains(v)
    lost = 2.0 * p.path_deceleration / (v * v) if p.coasting_after >= 0.0 else 0.0

    def easing(x: float) -> float:
        return max(1.0 - lost * max(0.0, x - p.track_start - p.coasting_after), 0.1)

    return LanePath(
        track.lanes,
        track.outline,
        margin=p.path_margin,
        give=p.path_give,
        bend=p.path_effort * p.base_friction * G / (v * v),
        levers=(p.yaw_inertia / (car.m * car.b), -p.yaw_inertia / (car.m * car.a)),
        slip=slip_gain * v / yaw_gain,
        easing=easing,
    )
