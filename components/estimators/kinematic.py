"""Kinematic estimator of sideslip: integrated lateral acceleration with washout.

    dv_y/dt = a_y - v_x r - v_y / washout

The estimator needs no tyre model and no friction. Any bias left in a_y or r and any bank of the road appear
in v_y, multiplied by the washout time; sideslip that lasts longer is forgotten. v_y decays while the car
drives straight ahead. It is the baseline for other estimators.

Zero points, roll compensation, speed, slips and loads: `estimation.estimator`.

Source: the equation of lateral motion, (1) of `plants.two_dof` solved for the velocity; the washout is
chosen.
"""

from dataclasses import dataclass

from ..estimation.estimator import Estimator
from ..estimation.estimator_parameters import EstimatorParameters
from ..estimation.straight_ahead import faded
from ..fmi.variables import parameter


@dataclass(frozen=True)
class KinematicParameters(EstimatorParameters):
    """Parameters of the washout."""

    washout: float = parameter(
        2.0, "s", "Time constant of the washout", "chosen: a lane change is shorter", minimum=0.05
    )


class Kinematic(Estimator):
    """Kinematic estimator: sideslip by integrated acceleration with washout; speed, slips, loads."""

    Parameters = KinematicParameters

    def lateral(
        self, h: float, *, r: float, delta: float, a_x: float, a_y: float, straight: float
    ) -> tuple[float, float]:
        p = self.p
        rate = a_y - self.speed.v * r - self.v_y / p.washout
        return faded(self.v_y + h * rate, h, straight, p), rate
