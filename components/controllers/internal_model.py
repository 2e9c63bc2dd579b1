"""Internal-model control of the yaw rate.

    model     x = (beta_m, r_m):  dx/dt = A(v) x + (0, 1 / I_z) M            cars.single_track_car, delta = 0
    law       M = I_z [(r_ref - r) / lambda - a_21 beta_m - a_22 r_m]

This is M = Q (r_ref - (r - r_m)) with Q = F / G, where G is the model from M to r and F = 1 / (lambda s +
1): the difference of car and model, r - r_m, is the disturbance, which holds all that the driver, the road
and the tyres do, and the model's inverse, filtered by F, cancels it. As long as the moment is not limited,
dr_m/dt = (r_ref - r) / lambda, so that r_m integrates the error; a car like the model has r = F r_ref + (1
- F) (disturbance). The model has the limited moment, so nothing winds up.

The inverse of G is stable at any speed, but G is not for an oversteering car beyond its critical speed: the
model then runs at `CRITICAL_SHARE` of that.

After M. Canale, L. Fagiano, M. Milanese, P. Borodani, Robust vehicle yaw control using an active
differential and IMC techniques, Control Engineering Practice 15(8), 2007, 923-941. It was not at hand: as
we know it, its Q is optimal in the H-infinity sense for a bound on the difference of car and model, a
feedforward of the steer angle is added, and the limited moment is treated by enhanced internal-model
control. Ours has the inverse and one filter (M. Morari, E. Zafiriou, Robust Process Control, 1989, chapters
3 and 4), no feedforward, and the model of the current speed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

from ..cars.published_cars import PaperASingleTrack
from ..cars.single_track_car import SingleTrackCar
from ..control_laws.moment_limit import LimitParameters, limit
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter
from ..mathematics.integrators import rk4
from .lqr import LqrParameters

CRITICAL_SHARE = 0.9
"""Largest speed of the model over the critical speed of an oversteering car [1]; chosen."""


@dataclass(frozen=True)
class InternalModelParameters(PaperASingleTrack):
    """Parameters of the model, of the filter, and limits."""

    filter_time: float = parameter(
        0.1, "s", "Time constant lambda of the filter", "chosen: twice that of brakes", minimum=0.001
    )
    scheduling_speed: float = like(LqrParameters, "scheduling_speed")
    moment_limit: float = like(LimitParameters, "moment_limit")
    fade_speed: float = like(LimitParameters, "fade_speed")


class InternalModel(Component):
    """Internal-model yaw-moment controller of the yaw rate, after Canale et al."""

    Parameters = InternalModelParameters
    sampled = True
    inputs = ("yaw_rate_ref", "yaw_rate", "velocity_x")
    outputs = (output("yaw_moment", "yaw_rate_ref", "yaw_rate", "velocity_x"),)

    def configure(self) -> None:
        self.car = SingleTrackCar.of(self.p, self.p.yaw_inertia)
        k = self.car.stability_factor()
        self.fastest = CRITICAL_SHARE * sqrt(-1.0 / k) if k < 0.0 else 1e9  # [m/s]

    def start(self, t: float, u: list[float]) -> None:
        self.state = 0.0, 0.0
        self.decide(u)

    def advance(self, t: float, h: float, u: list[float]) -> None:
        v, push = self.speed, self.moment / self.p.yaw_inertia
        derivatives = self.car.derivatives

        def moved(time: float, state: Sequence[float]) -> tuple[float, float]:
            beta_rate, r_rate = derivatives(state[0], state[1], delta=0.0, v=v)
            return beta_rate, r_rate + push

        beta, r = rk4(moved, 0.0, h, self.state)
        self.state = beta, r
        self.decide(u)

    def decide(self, u: list[float]) -> None:
        """Compute the moment and the speed of the model."""
        p = self.p
        r_ref, r, speed = u
        self.speed = max(min(speed, self.fastest), min(p.scheduling_speed, self.fastest))
        _, damped = self.car.derivatives(*self.state, delta=0.0, v=self.speed)
        self.moment = limit(p.yaw_inertia * ((r_ref - r) / p.filter_time - damped), p, speed)

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        return (self.moment,)
