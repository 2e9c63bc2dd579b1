"""Sliding-mode yaw-moment control with gains scheduled by fuzzy rules.

The law is that of `control_laws.sliding_surface`, always with the saturation of equation (24). A Mamdani
system with five sets per variable sets both eps and k_d from |delta| and mu by a common table: small gains
on slippery roads and straight ahead, where a strong law only shakes the car, and large gains in sharp turns
on dry roads. The centroid spans about 0.08 to 0.92 of each gain's range.

Source: paper B, section 2.1, table 2. Ranges, sets and boundary layer are not given there: chosen.
"""

from dataclasses import dataclass

from ..control_laws.sliding_surface import ERRORS, SURFACE, SlidingSurface, SurfaceParameters
from ..fmi.component import Component
from ..fmi.variables import output, parameter
from ..mathematics.fuzzy import Mamdani, Partition

LABELS = "SS S M B BB"

TABLE = """
    SS  SS  S   S   M
    SS  S   M   M   M
    S   M   M   B   B
    S   M   B   B   BB
    M   M   B   BB  BB
"""
"""Paper B, table 2: rows friction, columns |steer angle|, both from SS to BB."""


@dataclass(frozen=True)
class FuzzySlidingModeParameters(SurfaceParameters):
    """Parameters of the law, and the ranges that the paper leaves open."""

    largest_reaching_rate: float = parameter(
        3.0,
        "rad/s2",
        "Range of eps, from 0",
        "chosen: its middle exceeds the constant law's",
        minimum=1e-6,
        tunable=True,
    )
    largest_reaching_gain: float = parameter(
        10.0,
        "1/s",
        "Range of k_d, from 0",
        "chosen: up to that of the constant law",
        minimum=1e-6,
        tunable=True,
    )
    largest_steer_angle: float = parameter(
        0.09,
        "rad",
        "Steer angle above which |delta| is BB",
        "chosen: the amplitude of the runs",
        minimum=1e-6,
    )
    largest_friction: float = parameter(
        1.0, "1", "Friction above which mu is BB", "chosen: dry asphalt", minimum=1e-6
    )


class FuzzySlidingMode(Component):
    """Sliding-mode yaw-moment controller with gains scheduled by fuzzy rules of steer angle and friction."""

    Parameters = FuzzySlidingModeParameters
    sampled = True
    inputs = (*ERRORS, "velocity_x", "steer_angle", "friction")
    outputs = (
        output("yaw_moment", *ERRORS, "velocity_x", "steer_angle", "friction"),
        output("sliding_surface", *SURFACE, unit="rad/s", text="Sliding surface s"),
        output("reaching_rate", "steer_angle", "friction", unit="rad/s2", text="Scheduled gain eps"),
        output("reaching_gain", "steer_angle", "friction", unit="1/s", text="Scheduled gain k_d"),
    )

    def configure(self) -> None:
        p = self.p
        friction, angle, eps, k_d = (
            Partition.even(LABELS, 0.0, largest)
            for largest in (
                *(p.largest_friction, p.largest_steer_angle),
                *(p.largest_reaching_rate, p.largest_reaching_gain),
            )
        )
        self.gains = Mamdani(friction, angle, [eps, k_d], TABLE)

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        p = self.p
        eps, k_d = self.gains(u[9], abs(u[8]))
        law = SlidingSurface(u[:7], p)
        return law.moment(eps=eps, k_d=k_d, speed=u[7]), law.s, eps, k_d
