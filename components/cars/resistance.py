"""What slows a car besides its tyres' slip: air, on the body, and rolling resistance, on the wheels.

    F = 1/2 rho C_D A v_x |v_x|         on the body
    M = f F_z R                         on a wheel of load F_z, friction against its rotation

M as the moment M_y of H. B. Pacejka, Tyre and Vehicle Dynamics, 2nd ed. 2006, equation 4.E70, constant over
speed. The tyre force that turns a free wheel in spite of it slows the car, by m g f in all; a driven wheel's
torque overcomes it, and the tyre then carries that much less. A car at rest stays at rest: M is friction
(`cars.wheel_spin`). Left out: M comes of loads that act f R ahead of the wheels, which shifts f R / L of the
weight from axle to axle, about a thousandth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from ..fmi.variables import parameter


@dataclass(frozen=True)
class ResistanceParameters:
    """Those of paper B, table 1."""

    drag_coefficient: float = parameter(0.3, "1", "Drag coefficient C_D", "paper B, table 1", minimum=0.0)
    frontal_area: float = parameter(1.8, "m2", "Frontal area A", "paper B, table 1", minimum=0.0)
    air_density: float = parameter(
        1.2258, "kg/m3", "Air density rho", "paper B: what its 1 / 21.15 stands for", minimum=0.0
    )
    rolling_resistance: float = parameter(0.008, "1", "Rolling resistance f", "paper B, table 1", minimum=0.0)


class Drag(NamedTuple):
    """The drag of one car."""

    per_speed_squared: float  # [kg/m]

    @classmethod
    def of(cls, p: Any) -> Drag:
        """Return that of a car with `ResistanceParameters`."""
        return cls(0.5 * p.air_density * p.drag_coefficient * p.frontal_area)

    def force(self, v_x: float) -> float:
        """Return the resisting force [N] along x at the speed `v_x` [m/s]; it has the sign of v_x."""
        return self.per_speed_squared * v_x * abs(v_x)
