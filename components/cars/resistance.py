"""Driving resistance: aerodynamic drag of the body and rolling resistance of the wheels.

    F = 1/2 rho C_D A v_x |v_x|         on the body
    M = f F_z R                         on a wheel of load F_z, friction against its rotation

M is the moment M_y of H. B. Pacejka, Tyre and Vehicle Dynamics, 2nd ed. 2006, equation 4.E70, constant over
speed. The tyre forces that keep free wheels turning against it slow the car, by m g f in total; on a driven
wheel the torque overcomes it, and the tyre force is smaller by that much. A car at rest stays at rest,
because M is friction (`cars.wheel_spin`). Neglected: M is due to loads that act f R ahead of the wheels,
which shifts f R / L of the weight from axle to axle, about a thousandth.
"""

from dataclasses import dataclass

from ..fmi.variables import of_car


@dataclass(frozen=True)
class ResistanceParameters:
    """Parameters of driving resistance; defaults from paper B, table 1."""

    drag_coefficient: float = of_car(0.3, "paper B, table 1")
    frontal_area: float = of_car(1.8, "paper B, table 1")
    air_density: float = of_car(1.2258, "paper B: contained in its 1 / 21.15")
    rolling_resistance: float = of_car(0.008, "paper B, table 1")


def drag_of(p: ResistanceParameters) -> float:
    """Return the drag divided by v_x |v_x| [kg/m]."""
    return 0.5 * p.air_density * p.drag_coefficient * p.frontal_area
