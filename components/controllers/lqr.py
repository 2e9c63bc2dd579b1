"""Linear-quadratic yaw-moment control of sideslip and yaw rate, scheduled by speed.

    M = k_beta(v_x) (beta_ref - beta) + k_r(v_x) (r_ref - r)

The gains are optimal for the linear single-track car at the current speed; `control_laws.linear_feedback`
has their closed form. Below `scheduling_speed` they are constant, and the moment fades out below walking
pace.

A baseline, not from a paper. The limit is applied after the law, so a limited moment is not optimal;
`controllers.mpc` takes the limit into account.
"""

from dataclasses import dataclass

from ..cars.published_cars import PaperASingleTrack
from ..cars.single_track_car import SingleTrackCar
from ..control_laws.linear_feedback import error_dynamics, optimal_gains
from ..control_laws.moment_limit import LimitParameters, limit
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter
from .pid import SEEN


@dataclass(frozen=True)
class LqrParameters(PaperASingleTrack):
    """Parameters of the single-track car, weights (as values of equal cost) and limits."""

    sideslip_scale: float = parameter(
        0.02,
        "rad",
        "Sideslip error beta_0 of cost 1",
        "chosen: small enough for a moment against the sideslip of an understeering car above 8 m/s",
        minimum=1e-6,
        tunable=True,
    )
    yaw_rate_scale: float = parameter(
        0.2,
        "rad/s",
        "Yaw-rate error r_0 of cost 1",
        "chosen: 11 degrees per second, so that actuators of 50 ms can follow",
        minimum=1e-6,
        tunable=True,
    )
    moment_scale: float = parameter(
        5000.0, "N.m", "Moment M_0 of cost 1", "chosen: equal to the limit", minimum=1e-3, tunable=True
    )
    scheduling_speed: float = parameter(
        8.0, "m/s", "Speed below which the gains are constant", "chosen: slower cars are safe", minimum=0.1
    )
    moment_limit: float = like(LimitParameters, "moment_limit")
    fade_speed: float = like(LimitParameters, "fade_speed")


class Lqr(Component):
    """Linear-quadratic yaw-moment controller of sideslip and yaw rate, scheduled by speed."""

    Parameters = LqrParameters
    sampled = True
    inputs = (*SEEN, "velocity_x")
    outputs = (output("yaw_moment", *SEEN, "velocity_x"),)

    def configure(self) -> None:
        self.car = SingleTrackCar.of(self.p, self.p.yaw_inertia)

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        p = self.p
        r_ref, r, beta_ref, beta, speed = u
        k_beta, k_r = optimal_gains(
            error_dynamics(self.car, max(speed, p.scheduling_speed)),
            p.yaw_inertia,
            beta_0=p.sideslip_scale,
            r_0=p.yaw_rate_scale,
            moment_0=p.moment_scale,
        )
        moment = k_beta * (beta_ref - beta) + k_r * (r_ref - r)
        return (limit(moment, p, speed),)
