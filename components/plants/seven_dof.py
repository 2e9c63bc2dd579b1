"""Car with seven degrees of freedom: plane motion of the body, spin of the four wheels.

    m (dv_x/dt - v_y r) = X,    m (dv_y/dt + v_x r) = Y_f + Y_r                             (5), (6)
    I_z dr/dt = M                                                                           (7)
    J dw_i/dt = T_i - F_xi R                                                                (8)

with the resultants X, Y_f, Y_r, M of the tyre forces (`cars.plane_body`), to which those of inclines and wind
are added (`cars.road_plane`), and quasi-static loads from a_x = X / m, a_y = (Y_f + Y_r) / m
(`cars.load_transfer`, equations (17), (18)). Roll, pitch and suspension are neglected.

Source: paper A, equations (5)-(8), (13)-(20). Ours differs: the lifted wheel; slips at rest, see
`cars.wheel_kinematics`. Errata: (7) prints the rear-track term with the opposite sign; (13)-(16) print
sideslip for yaw rate; (17), (18) print b where a is meant.

Coupling: tyre forces and wheel torques enter only the integration: they are held over the step, and the
master should supply their values at its middle. The steer angle feeds through to the slip angles, so its
value belongs to the end of the step; the forces are rotated by the mean of the last two steer angles. The
loads depend on the accelerations, these on the forces, and the forces on the loads: to avoid this algebraic
loop, the accelerations, known at the middle of each step, are extrapolated to its end by the least-squares
line through the last three (`mathematics.carry`). The result is of second order in the step, which may vary.
The body's motion is solved by `cars.plane_body`, the wheels by `cars.wheel_spin`, which also covers slow,
braked wheels.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from yawbench.vocabulary.gravity import G

from ..cars.car import DRIVEN_WHEELS, MOTION, DrivenCar, DrivenCarParameters, StartParameters
from ..cars.load_transfer import quasi_static_loads
from ..cars.plane_body import move, resultants
from ..cars.published_cars import PaperA
from ..fmi.variables import like, parameter
from ..mathematics.carry import Values


@dataclass(frozen=True)
class SevenDofParameters(StartParameters, PaperA):
    """Parameters of paper A's car, table 1."""

    initial_speed: float = parameter(25.0, "m/s", "Speed at the start", "paper A: 15, 25, 40 m/s")
    slip_stiffness_per_load: float = like(
        DrivenCarParameters, "slip_stiffness_per_load", 15.0, "chosen: paper A's tyre at rest"
    )


class SevenDof(DrivenCar):
    """Car with seven degrees of freedom (plane motion, four wheel spins), quasi-static loads."""

    Parameters = SevenDofParameters
    outputs = (*MOTION, *DRIVEN_WHEELS)

    def rest(self, signals: Sequence[Any]) -> Values:
        return self._accelerations(signals[0], signals)[:2]

    def move(self, h: float, delta: float, signals: Sequence[Any]) -> Values:
        a_x, a_y, dr = self._accelerations(delta, signals)
        pull = self.pull
        dr += pull.turn / self.p.yaw_inertia
        self.motion = move(self.motion, h, a_x=a_x + pull.x, a_y=a_y + pull.y, dr=dr)
        return a_x, a_y

    def finish(self, carried: Values) -> None:
        a_x, a_y = carried
        pull = self.pull
        self.end = a_x + pull.x, a_y + pull.y
        self.loads = quasi_static_loads(a_x, a_y, self.p, G - pull.lighter)

    def _accelerations(self, delta: float, signals: Sequence[Any]) -> tuple[float, float, float]:
        """Return a_x, a_y [m/s2] and dr/dt [rad/s2] by the tyre forces; equations (5)-(7)."""
        p = self.p
        x, front, rear, moment = resultants(delta, signals[1], signals[2], p, signals[6])
        return x / p.mass, (front + rear) / p.mass, moment / p.yaw_inertia
