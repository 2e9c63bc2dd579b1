"""Sliding-mode yaw-moment control with constant gains, the baseline of paper B.

The law is that of `control_laws.sliding_surface`. Its switching function is the sign, as in the paper's
baseline, or the saturation of equation (24) with the same gains, which shows how much of the fuzzy
controller's smoothness is due to the boundary layer alone.

Source: paper B, section 2.1.
"""

from dataclasses import dataclass

from ..control_laws.sliding_surface import ERRORS, SURFACE, SlidingSurface, SurfaceParameters
from ..fmi.component import Component
from ..fmi.variables import output, parameter


@dataclass(frozen=True)
class SlidingModeParameters(SurfaceParameters):
    """Parameters of the law; the paper gives none of the gains."""

    switching: str = parameter(
        "sign",
        None,
        "Switching function",
        "paper B: its baseline uses the sign",
        choices=("sign", "saturation"),
    )
    reaching_rate: float = parameter(
        1.0,
        "rad/s2",
        "Gain eps of the switching function",
        "chosen: clear chatter with the sign",
        minimum=0.0,
        tunable=True,
    )
    reaching_gain: float = parameter(
        10.0,
        "1/s",
        "Gain k_d of the sliding surface",
        "chosen: 0.1 s time constant",
        minimum=0.0,
        tunable=True,
    )


class SlidingMode(Component):
    """Sliding-mode yaw-moment controller with constant gains, switching by sign or saturation."""

    Parameters = SlidingModeParameters
    sampled = True
    inputs = (*ERRORS, "velocity_x")
    outputs = (
        output("yaw_moment", *ERRORS, "velocity_x"),
        output("sliding_surface", *SURFACE, unit="rad/s", text="Sliding surface s"),
    )

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        p = self.p
        law = SlidingSurface(u[:7], p)
        moment = law.moment(eps=p.reaching_rate, k_d=p.reaching_gain, speed=u[7], switching=p.switching)
        return moment, law.s
