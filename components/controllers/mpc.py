"""Model-predictive yaw-moment control of sideslip and yaw rate.

The motion of the linear single-track car is predicted over `moves * steps_per_move * prediction_step`
(`control_laws.predictive_law`). A quadratic program (`mathematics.quadratic_program`) finds the moments of
least cost within the limit, and the first of them is the output. Weights are those of `controllers.lqr`,
which is the limit of this law for a long horizon without active constraints. The bound of the sideslip is
that of `control_laws.sideslip_bound`. The car is linearized at the speeds of a grid of spacing `SPACING`; the
program of the latest grid speed is cached.

A baseline, not from a paper.
"""

from dataclasses import dataclass

from ..cars.single_track_car import SingleTrackCar
from ..control_laws.linear_feedback import error_dynamics
from ..control_laws.moment_limit import limit
from ..control_laws.predictive_law import CostWeights, PredictiveLaw
from ..control_laws.sideslip_bound import sideslip_bound
from ..fmi.component import Component
from ..fmi.variables import output, parameter, signal
from .lqr import LqrParameters
from .pid import SEEN

SPACING = 0.5
"""Spacing of the speed grid [m/s]. Chosen: gains change by 1 to 2 % between neighbours."""


@dataclass(frozen=True)
class MpcParameters(LqrParameters):
    """Parameters of `lqr`, and of the horizon."""

    prediction_step: float = parameter(
        0.02, "s", "Prediction step", "chosen: a tenth of the car's time constants", minimum=1e-4
    )
    steps_per_move: int = parameter(4, None, "Steps per held moment", "chosen: 80 ms", minimum=1, maximum=100)
    moves: int = parameter(
        5,
        None,
        "Moments in the horizon",
        "chosen: 0.4 s in all, half a yaw oscillation",
        minimum=1,
        maximum=50,
    )
    sideslip_penalty: float = parameter(
        10.0,
        "1",
        "Weight of the excess over the sideslip bound",
        "chosen: ten errors",
        minimum=1e-6,
        tunable=True,
    )


class Mpc(Component):
    """Model-predictive yaw-moment controller of sideslip and yaw rate, with a bounded sideslip."""

    Parameters = MpcParameters
    sampled = True
    inputs = (*SEEN, "velocity_x", signal("friction", start=1.0))
    outputs = (output("yaw_moment", *SEEN, "velocity_x", "friction"),)

    def configure(self) -> None:
        p = self.p
        self.car = SingleTrackCar.of(p, p.yaw_inertia)
        self.weights = CostWeights(
            beta_0=p.sideslip_scale,
            r_0=p.yaw_rate_scale,
            moment_0=p.moment_scale,
            penalty=p.sideslip_penalty,
            step=p.prediction_step,
            moves=p.moves,
            steps_per_move=p.steps_per_move,
        )
        self.place = 0  # the cached law has the old parameters
        self.law_at(p.scheduling_speed)

    def law_at(self, speed: float) -> PredictiveLaw:
        """Return the law at the grid speed nearest to `speed` [m/s], cached."""
        place = max(round(max(speed, self.p.scheduling_speed) / SPACING), 1)  # singular at rest
        if place != self.place:
            self.place = place
            dynamics = error_dynamics(self.car, place * SPACING)
            self.law = PredictiveLaw(dynamics, self.p.yaw_inertia, self.weights)
        return self.law

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        p = self.p
        r_ref, r, beta_ref, beta, speed, mu = u
        moment = self.law_at(speed).moment(
            beta, r, beta_ref, r_ref, most=p.moment_limit, bound=sideslip_bound(mu)
        )
        return (limit(moment, p, speed),)
