"""Yaw-moment allocation by weighted least squares within the force that each tyre can give.

    minimize    sum_i ((F_i - F_d,i) / (mu F_zi))^2
                + gamma ((M(F) - M_z - M_d) / m_0)^2 + gamma_x ((X(F) - X_d) / f_0)^2
    subject to  -mu F_zi <= F_i <= highest,     M(F) = sum(F_i arm_i),     X(F) = sum(F_i)

with the driver's forces F_d (equal left and right, `control_laws.allocator`), their sum X_d and their moment
M_d, m_0 = mu m g d/2 and f_0 = mu m g. gamma is large, so the moment is missed only if the tyres cannot give
it; then it is the nearest one. A wheel uses its grip in proportion to its load, so unloaded wheels do not
lock. `highest` is zero with brakes, where a car slows in exchange for its moment (gamma_x small), and +mu
F_zi with motors. Lateral forces are left out: wheels at their grip are for the slip control.

Source: O. Haerkegaard, 2002 (`mathematics.bounded_least_squares`), where actuators are control surfaces; T.
A. Johansen, T. I. Fossen, Control allocation: a survey, Automatica 49(5), 2013, 1087-1103. For cars, P.
Toendel, T. A. Johansen, Control allocation for yaw stabilization in automotive vehicles using multiparametric
nonlinear programming, American Control Conference, 2005, with the same aim, smallest use of tyres for a
moment, and J. Wang, R. G. Longoria, IEEE TCST 17(3), 2009. The last three were not read. Ours differs:
longitudinal forces alone; without weights of wheels, since all tyres are alike.
"""

from dataclasses import dataclass

from yawbench.vocabulary.wheels import Four, wheels

from ..cars.published_cars import PaperC
from ..cars.wheel_kinematics import lever_arms
from ..control_laws.allocator import BASIC, Allocator, DriveParameters
from ..control_laws.moment_sharing import NO_FORCE, add_drive_force
from ..fmi.variables import like, output, parameter, signal
from ..mathematics.bounded_least_squares import bounded

LEAST_LOAD = 0.01
"""Share of the total load [1] that every wheel is taken to carry at least. Chosen: keeps weights finite."""


@dataclass(frozen=True)
class WeightedLeastSquaresParameters:
    """Geometry of the car, weights and limits."""

    cg_to_front_axle: float = like(PaperC, "cg_to_front_axle")
    track_width: float = like(PaperC, "track_width")
    moment_weight: float = parameter(
        1e4, "1", "Weight gamma of the moment", "chosen: misses 1 % where tyres can give it", minimum=1e-6
    )
    force_weight: float = parameter(
        0.0, "1", "Weight gamma_x of the driver's force", "chosen: none, brakes may slow the car", minimum=0.0
    )
    usable_grip: float = parameter(
        1.0, "1", "Share of mu F_z that a wheel may be asked for", "chosen: all", minimum=0.01, maximum=1.5
    )
    motors: bool = parameter(False, None, "Wheels can drive, too", "chosen: brakes alone")
    drive_front_share: float = like(DriveParameters, "drive_front_share", 0.0, "chosen: rear drive")
    brake_front_share: float = like(DriveParameters, "brake_front_share")


class WeightedLeastSquares(Allocator):
    """Yaw-moment allocation by weighted least squares within the grip of each tyre."""

    Parameters = WeightedLeastSquaresParameters
    inputs = (*Allocator.inputs, "vertical_load_*", signal("friction", start=1.0))
    outputs = (output("force_request_*", *BASIC, *wheels("vertical_load_*"), "friction"),)

    def output(self, t: float, u: list[float]) -> Four:
        p = self.p
        moment, drive, delta = u[0], u[1], u[2]
        braking = drive < 0.0 and p.brake_front_share >= 0.0
        pedal = add_drive_force(NO_FORCE, drive, p.brake_front_share if braking else p.drive_front_share)
        mu = max(u[7], 0.0)
        total = max(u[3], 0.0) + max(u[4], 0.0) + (max(u[5], 0.0) + max(u[6], 0.0))
        if moment == 0.0 or mu * total <= 0.0:
            return pedal
        grips = [p.usable_grip * mu * max(load, LEAST_LOAD * total) for load in u[3:7]]
        arms = lever_arms(delta, p.cg_to_front_axle, self.half_track)
        whole = mu * total
        turn = whole * self.half_track
        wanted = moment + (
            pedal[0] * arms[0] + pedal[1] * arms[1] + (pedal[2] * arms[2] + pedal[3] * arms[3])
        )
        x = bounded(
            [1.0 / (grip * grip) for grip in grips],
            pedal,
            (arms, (1.0, 1.0, 1.0, 1.0)),
            (p.moment_weight / (turn * turn), p.force_weight / (whole * whole)),
            (wanted, drive),
            [-grip for grip in grips],
            [max(force, grip if p.motors else 0.0) for grip, force in zip(grips, pedal, strict=True)],
        )
        return x[0], x[1], x[2], x[3]
