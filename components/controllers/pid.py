"""PID yaw-moment control of yaw rate and sideslip, the baseline of paper C.

    M = PID(r_ref - r) + PID(beta - beta_ref)

A positive moment raises the yaw rate and lowers the sideslip. `mathematics.pid_loop` describes integration,
differentiation and the common limit of the loops. The moment fades out below walking pace, where sideslip is
meaningless.

Source: paper C, section 2.1, which gives no gains.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from ..control_laws.moment_limit import LimitParameters, limit
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter
from ..mathematics.pid_loop import Gains, YawLoops


@dataclass(frozen=True)
class PidParameters:
    """Gains of both loops, filter and limit."""

    yaw_rate_proportional_gain: float = parameter(
        8000.0,
        "N.m.s/rad",
        "K_p of the yaw rate",
        "chosen: calm, a sixth or more off paper C's sideslip peaks",
        minimum=0.0,
        tunable=True,
    )
    yaw_rate_integral_gain: float = parameter(
        2000.0,
        "N.m/rad",
        "K_i of the yaw rate",
        "chosen: integral time of 4 s, slower than the runs",
        minimum=0.0,
        tunable=True,
    )
    yaw_rate_derivative_gain: float = parameter(
        100.0,
        "N.m.s2/rad",
        "K_d of the yaw rate",
        "chosen: little, cars damp their yaw",
        minimum=0.0,
        tunable=True,
    )
    sideslip_proportional_gain: float = parameter(
        4000.0, "N.m/rad", "K_p of the sideslip", "chosen: half of the yaw rate's", minimum=0.0, tunable=True
    )
    sideslip_integral_gain: float = parameter(
        200.0, "N.m/(rad.s)", "K_i of the sideslip", "chosen: nearly none", minimum=0.0, tunable=True
    )
    sideslip_derivative_gain: float = parameter(
        100.0, "N.m.s/rad", "K_d of the sideslip", "chosen: as the yaw rate's", minimum=0.0, tunable=True
    )
    derivative_filter: float = parameter(
        0.02, "s", "Time constant of the derivative filter", "chosen: a tenth of the car's own", minimum=0.0
    )
    moment_limit: float = like(LimitParameters, "moment_limit")
    fade_speed: float = like(LimitParameters, "fade_speed")


SEEN = ("yaw_rate_ref", "yaw_rate", "sideslip_ref", "sideslip")
"""Inputs of the loops, in the order of `YawLoops`."""


def gains_of(p: PidParameters, loop: str, kind: str = "gain") -> Gains:
    """Return the P, I and D parameters of a `kind` for the loop "yaw_rate" or "sideslip"."""
    return Gains(
        *(getattr(p, f"{loop}_{part}_{kind}") for part in ("proportional", "integral", "derivative"))
    )


class PidController(Component):
    """PID yaw-moment controller for yaw rate and sideslip."""

    Parameters = PidParameters
    sampled = True
    inputs = (*SEEN, "velocity_x")
    outputs: ClassVar[Any] = (
        output("yaw_moment", *SEEN, "velocity_x"),
        output("integral_term", *SEEN, unit="N.m", text="Integral part of the moment"),
    )

    def configure(self) -> None:
        self.gains = gains_of(self.p, "yaw_rate"), gains_of(self.p, "sideslip")

    def start(self, t: float, u: list[float]) -> None:
        self.loops = YawLoops(self.p.derivative_filter, *u[:4])
        self.decide()

    def advance(self, t: float, h: float, u: list[float]) -> None:
        self.loops.see(*u[:4], h=h)
        self.decide()

    def decide(self) -> None:
        """Compute the moment from the current state of the loops."""
        self.moment = self.loops.moment(*self.gains, limit=self.p.moment_limit)

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        return limit(self.moment, self.p, u[4]), self.loops.integral()
