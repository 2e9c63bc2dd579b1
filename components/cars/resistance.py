"""What slows a car besides its tyres' slip: air and rolling resistance, as one force on the body.

    F = 1/2 rho C_D A v_x |v_x| + m g f v_x / |v_x|

Rolling resistance fades below `rolling_fade_speed`, so a car at rest stays at rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from ..fmi.variables import parameter
from ..mathematics.gravity import G


@dataclass(frozen=True)
class ResistanceParameters:
    """Those of paper B, table 1."""

    drag_coefficient: float = parameter(0.3, "1", "Drag coefficient C_D", "paper B, table 1", minimum=0.0)
    frontal_area: float = parameter(1.8, "m2", "Frontal area A", "paper B, table 1", minimum=0.0)
    air_density: float = parameter(
        1.2258, "kg/m3", "Air density rho", "paper B: what its 1 / 21.15 stands for", minimum=0.0
    )
    rolling_resistance: float = parameter(0.008, "1", "Rolling resistance f", "paper B, table 1", minimum=0.0)
    rolling_fade_speed: float = parameter(
        0.1, "m/s", "Rolling resistance fades below this speed", "chosen: hardly moving", minimum=0.001
    )


class Resistance(NamedTuple):
    """The two resistances of one car."""

    drag: float  # force over speed squared [kg/m]
    rolling: float  # rolling resistance [N]
    fade: float  # speed below which it fades [m/s]

    @classmethod
    def of(cls, p: Any) -> Resistance:
        """Return those of a car with `ResistanceParameters` and a mass."""
        drag = 0.5 * p.air_density * p.drag_coefficient * p.frontal_area
        return cls(drag, p.rolling_resistance * p.mass * G, p.rolling_fade_speed)

    def force(self, v_x: float) -> float:
        """Return the resisting force [N] along x at the speed `v_x` [m/s]; it has the sign of v_x."""
        drag, rolling, fade = self
        share = v_x / fade
        if share > 1.0:
            share = 1.0
        elif share < -1.0:
            share = -1.0
        return drag * v_x * abs(v_x) + rolling * share
