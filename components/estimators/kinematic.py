"""Kinematic estimator of sideslip: integrated lateral acceleration that is washed out.

    dv_y/dt = a_y - v_x r - v_y / washout

It needs to know nothing of the tyres and nothing of friction, and finds out nothing: whatever bias is left in
a_y or r, and whatever bank the road has, ends in v_y times the washout; sideslip that lasts longer than that
is forgotten. The baseline that others have to beat. v_y fades once the car goes straight ahead.

Zero points, roll compensation, speed, slips and loads: `estimation.estimator`.

Source: the equation of lateral motion, (1) of `plants.two_dof` solved for the velocity; the washout chosen.
"""

from dataclasses import dataclass

from ..estimation.estimator import Estimator
from ..estimation.estimator_parameters import EstimatorParameters
from ..estimation.zero_points import faded
from ..fmi.variables import parameter


@dataclass(frozen=True)
class KinematicParameters(EstimatorParameters):
    """Parameters of the washout."""

    washout: float = parameter(
        2.0, "s", "Time constant of the washout", "chosen: a lane change is shorter", minimum=0.05
    )


class Kinematic(Estimator):
    """Kinematic estimator: sideslip from integrated acceleration with washout; speed, slips, loads."""

    Parameters = KinematicParameters

    def lateral(
        self, h: float, *, r: float, delta: float, a_x: float, a_y: float, straight: float
    ) -> tuple[float, float]:
        p = self.p
        rate = a_y - self.speed.v * r - self.v_y / p.washout
        return faded(self.v_y + h * rate, h, straight, p), rate
