"""Sliding-mode yaw-moment control with constant gains, the baseline of paper B.

The law stands in `control_laws.sliding_surface`. Its switching function is the sign, as in the paper's
baseline, or the saturation of equation (24) with the same constant gains: the second shows how
much of the fuzzy controller's calm the boundary layer alone achieves.

Source: Vehicle yaw stability control based on fuzzy sliding mode direct yaw moment, section 2.1.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..control_laws import sliding_surface
from ..fmi.component import Component
from ..fmi.variables import output, parameter


@dataclass(frozen=True)
class SlidingModeParameters:
    """Of the law; the paper names none of its gains."""

    switching: str = parameter(
        "sign", None, "Switching function; the paper's baseline uses the sign", choices=("sign", "saturation")
    )
    reaching_rate: float = parameter(
        1.0, "rad/s2", "Gain eps of the switching function; chosen: clear chatter with the sign", minimum=0.0
    )
    reaching_gain: float = parameter(
        10.0, "1/s", "Gain k_d of the sliding surface; chosen: 0.1 s time constant", minimum=0.0
    )
    boundary_layer: float = parameter(
        0.1, "rad/s", "Half width Delta of the boundary layer; chosen: about 6 deg/s", minimum=0.0
    )
    sideslip_weight: float = parameter(
        -0.25, "1/s", "Weight w of the sideslip error; negative, see control_laws.sliding_surface; chosen"
    )
    yaw_inertia: float = parameter(1343.1, "kg.m2", "Yaw inertia I_z; paper B, table 1", minimum=1.0)
    moment_limit: float = parameter(
        10000.0, "N.m", "Largest yaw moment; chosen: m g d / 2, what the road can give at mu 1", minimum=0.0
    )
    fade_speed: float = parameter(
        2.0, "m/s", "Below it the moment fades out; chosen: walking pace", minimum=0.001
    )


class SlidingMode(Component):
    """Sliding-mode yaw-moment controller with constant gains, by sign or saturation."""

    Parameters = SlidingModeParameters
    sampled = True
    inputs = (*sliding_surface.ERRORS, "velocity_x")
    outputs = (
        output("yaw_moment", *sliding_surface.ERRORS, "velocity_x"),
        output("sliding_surface", *sliding_surface.SURFACE, unit="rad/s", text="Sliding surface s"),
    )

    def output(self, t, u):
        p = self.p
        s, equivalent = sliding_surface.surface(u[:7], p.sideslip_weight)
        if p.switching == "sign":
            switched = sliding_surface.sign(s)
        else:
            switched = sliding_surface.saturation(s, p.boundary_layer)
        moment = sliding_surface.demand(
            s, equivalent, switched, eps=p.reaching_rate, k_d=p.reaching_gain, i_z=p.yaw_inertia
        )
        return sliding_surface.limit(moment, p.moment_limit, u[7], p.fade_speed), s
