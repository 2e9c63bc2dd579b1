"""Linear-quadratic-Gaussian yaw-moment control: the regulator of `controllers.lqr` on estimated states.

    M = k_beta(v_x) (beta_ref - beta_hat) + k_r(v_x) (r_ref - r_hat)

Sideslip and yaw rate are those of a Kalman filter of the linear single-track car, from measured yaw rate and
lateral acceleration, steer angle, speed and the law's own moment of the sample before
(`estimation.linear_filter`). So no sideslip need be measured. Regulator and filter are optimal for the linear
car, each by itself (separation principle); once the tyres slide, the estimated sideslip stays at what a
linear car needs for the measured acceleration.

Source: the Riccati solutions in `control_laws.linear_feedback` and `estimation.linear_filter`; their
combination: M. Athans, The role and use of the stochastic linear-quadratic-Gaussian problem in control
system design, IEEE Transactions on Automatic Control 16(6), 1971, 529-552; that it has no guaranteed
margins: J. C. Doyle, Guaranteed margins for LQG regulators, IEEE Transactions on Automatic Control 23(4),
1978, 756-757. Neither was at hand. Scales and noise are ours.
"""

from dataclasses import dataclass

from ..cars.single_track_car import SingleTrackCar
from ..control_laws.linear_feedback import error_dynamics, optimal_gains
from ..control_laws.moment_limit import limit
from ..estimation.linear_filter import LinearFilter, Noise
from ..fmi.component import Component
from ..fmi.variables import output, parameter
from .lqr import LqrParameters

SEEN = ("yaw_rate_ref", "yaw_rate", "sideslip_ref", "acceleration_y", "steer_angle", "velocity_x")


@dataclass(frozen=True)
class LqgParameters(LqrParameters):
    """Parameters of `lqr`, and noise of model and sensors."""

    sideslip_wander: float = parameter(
        0.05,
        "rad",
        "Random walk of the sideslip, per square root of a second",
        "chosen: of the linear car, which a sliding one leaves by degrees within a second",
        minimum=1e-9,
    )
    yaw_rate_wander: float = parameter(
        1.0,
        "rad/s",
        "Random walk of the yaw rate, per square root of a second",
        "chosen: of the linear car; tyres that slide change its acceleration by some rad/s2",
        minimum=1e-9,
    )
    yaw_rate_deviation: float = parameter(
        0.005, "rad/s", "Standard deviation of the gyro", "chosen: that of production sensors", minimum=1e-9
    )
    acceleration_deviation: float = parameter(
        0.5,
        "m/s2",
        "Standard deviation of the measured a_y from the model's",
        "chosen: that of estimation.single_track_filter",
        minimum=1e-9,
    )


class Lqg(Component):
    """Linear-quadratic-Gaussian yaw-moment controller: optimal gains on the states of a Kalman filter."""

    Parameters = LqgParameters
    sampled = True
    inputs = SEEN
    outputs = (
        output("yaw_moment", *SEEN),
        output(
            "estimated_sideslip",
            *(name for name in SEEN if not name.endswith("_ref")),
            unit="rad",
            text="Sideslip angle of the law's own filter",
        ),
    )

    def configure(self) -> None:
        p = self.p
        self.car = SingleTrackCar.of(p, p.yaw_inertia)
        wander = p.sideslip_wander, p.yaw_rate_wander
        self.noise = Noise(*wander, p.yaw_rate_deviation, p.acceleration_deviation)

    def start(self, t: float, u: list[float]) -> None:
        self.filter = LinearFilter(self.car, self.noise)
        self.filter.r = u[1]
        self.decide(u)

    def advance(self, t: float, h: float, u: list[float]) -> None:
        self.filter.predict(h, v=self.speed, delta=self.delta, moment=self.moment)
        self.decide(u)

    def decide(self, u: list[float]) -> None:
        """Use the measurements and compute the moment."""
        p = self.p
        r_ref, r, beta_ref, a_y, self.delta, speed = u
        self.speed = max(speed, p.scheduling_speed)
        self.filter.correct(v=self.speed, delta=self.delta, r=r, a_y=a_y)
        k_beta, k_r = optimal_gains(
            error_dynamics(self.car, self.speed),
            p.yaw_inertia,
            beta_0=p.sideslip_scale,
            r_0=p.yaw_rate_scale,
            moment_0=p.moment_scale,
        )
        moment = k_beta * (beta_ref - self.filter.beta) + k_r * (r_ref - self.filter.r)
        self.moment = limit(moment, p, speed)

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        return self.moment, self.filter.beta
