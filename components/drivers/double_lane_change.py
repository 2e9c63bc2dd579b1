"""Closed-loop driver for a double lane change by single-point preview, with speed control.

    p        = (x, y) + L (cos psi, sin psi),        L = v T_p                  preview point
    e        = (path(p_x) - p_y) cos psi             its distance from the path
    kappa    = 2 e / L^2                             curvature of the arc to the path there
    delta_h* = steering_ratio kappa l (1 + K v^2)    within +-largest hand-wheel angle
    tau d(delta_h)/dt = delta_h*(t - delay) - delta_h,    |d(delta_h)/dt| <= largest hand-wheel rate

l is the wheelbase, K the stability factor: the driver inverts the steady-state steering of the car with
linear tyres. A car without lag would approach the path like an oscillator with natural frequency
sqrt(2) / T_p and damping ratio 0.7. Path and cones: `driving.track`. Speed: `driving.speed_holding`.

`path_offset` is the distance of the centre of mass from the path, `cone_overrun` that of the body beyond the
cones.

Source: the single-point preview of C. C. MacAdam, IEEE Trans. Systems, Man, and Cybernetics 11(6), 1981,
393-399, with an arc in place of an optimal control. Paper C does not describe CarSim's driver.
"""

from dataclasses import dataclass
from math import cos, sin

from ..cars.published_cars import PaperC
from ..cars.single_track_car import SingleTrackCar
from ..driving.speed_holding import HeldSpeedParameters, SpeedHold
from ..driving.track import TRACK_OUTPUTS, LaneChangeParameters, Track
from ..fmi.component import Component
from ..fmi.variables import like, of_car, parameter
from ..mathematics.first_order_lag import Stage


@dataclass(frozen=True)
class DoubleLaneChangeParameters(HeldSpeedParameters, LaneChangeParameters):
    """Parameters of the driver, of the driver's model of the car, and of the track."""

    preview_time: float = parameter(
        0.78, "s", "Preview T_p", "chosen: through the cones at 70 km/h on mu 0.4", minimum=0.05
    )
    least_preview: float = parameter(
        4.0, "m", "Shortest preview distance L", "chosen: just ahead of the bumper", minimum=0.1
    )
    reaction_delay: float = parameter(
        0.0, "s", "Pure delay of the driver", "chosen: none, contained in the lag", minimum=0.0
    )
    steering_lag: float = parameter(
        0.1, "s", "Lag tau of arms and steering", "chosen: a practised driver", minimum=0.0
    )
    steering_wheel_limit: float = parameter(
        6.0, "rad", "Largest hand-wheel angle", "chosen: nearly one turn", minimum=0.0
    )
    steering_wheel_rate_limit: float = parameter(
        12.0, "rad/s", "Fastest turn of the hand wheel", "chosen: a skilled driver", minimum=0.01
    )
    steering_ratio: float = of_car(17.0, "chosen: large saloon")
    mass: float = like(PaperC, "mass")
    cg_to_front_axle: float = like(PaperC, "cg_to_front_axle")
    cg_to_rear_axle: float = like(PaperC, "cg_to_rear_axle")
    cornering_stiffness_front: float = parameter(
        62618.0, "N/rad", "Stiffness C_f of the front axle", "paper C, table 1", minimum=1.0
    )
    cornering_stiffness_rear: float = parameter(
        110185.0, "N/rad", "Stiffness C_r of the rear axle", "paper C, table 1", minimum=1.0
    )


def arc(x: float, y: float, psi: float, *, track: Track, preview: float) -> float:
    """Return the curvature [1/m] of the arc to the path `preview` [m] ahead of x, y [m], psi [rad]."""
    c = cos(psi)
    return 2.0 * c * (track.path(x + preview * c) - (y + preview * sin(psi))) / (preview * preview)


class DoubleLaneChange(Component):
    """Closed-loop driver for a double lane change by single-point preview, with speed control."""

    Parameters = DoubleLaneChangeParameters
    inputs = ("velocity_x", "position_x", "position_y", "yaw_angle")
    outputs = ("steer_angle", "drive_force", "steering_wheel_angle", *TRACK_OUTPUTS)

    def configure(self) -> None:
        self.track = Track(self.p)
        self.car = SingleTrackCar.of(self.p)

    def start(self, t: float, u: list[float]) -> None:
        p = self.p
        self.speed = SpeedHold(p, u[0])
        self.hands = Stage(tau=p.steering_lag, delay=p.reaction_delay, rate=p.steering_wheel_rate_limit)
        self.wanted = self._wanted(u)

    def advance(self, t: float, h: float, u: list[float]) -> None:
        self.speed.advance(t, h, u[0])
        before = self.wanted
        self.wanted = self._wanted(u)  # from positions at the end of the step
        self.hands.advance(t, h, 0.5 * (before + self.wanted))

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        hand = self.hands.value
        return (
            hand / self.p.steering_ratio,
            self.speed.force,
            hand,
            u[2] - self.track.path(u[1]),
            self.track.overrun(u[1], u[2], u[3]),
        )

    def _wanted(self, u: list[float]) -> float:
        """Return the desired hand-wheel angle [rad]."""
        p = self.p
        v, x, y, psi = u
        preview = max(v * p.preview_time, p.least_preview)
        yaw_gain, _ = self.car.gains(max(v, 0.1))
        kappa = arc(x, y, psi, track=self.track, preview=preview)
        delta = kappa * max(v, 0.1) / yaw_gain
        wanted: float = min(max(p.steering_ratio * delta, -p.steering_wheel_limit), p.steering_wheel_limit)
        return wanted
