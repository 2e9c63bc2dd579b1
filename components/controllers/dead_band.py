"""Yaw-moment control with dead band and sideslip limit, as in production systems.

    e_r = r_ref - r                                      dead band: r_0 + share |r_ref|
    M   = k_r D(e_r) + k_beta E(beta, beta_max)          D, E: excess over the dead band, over the limit
    beta_max: the bound at this friction                 `control_laws.sideslip_bound`

The moment is zero while the car follows its driver within the dead band and its sideslip is below the limit.
A positive moment raises the yaw rate and lowers the sideslip. Oversteer (|r| above |r_ref|, with its sign) is
countered with the full gain; understeer, where a car stays predictable, with `understeer_share` of it. Below
`release_speed` the controller is off.

After A. T. van Zanten, R. Erhardt, G. Pfaff, VDC, the vehicle dynamics control system of Bosch, SAE
950759, 1995; its parameters are not public, ours are chosen. Ours differs: the moment goes to an allocator,
and the wheel control (`wheel_control_slip`, `wheel_control_hydraulic`) holds the slip of each wheel, whereas
Bosch's controller outputs slip targets itself.
"""

from dataclasses import dataclass

from ..control_laws.moment_limit import LimitParameters
from ..control_laws.phase_plane import beyond
from ..control_laws.sideslip_bound import sideslip_bound
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter, signal


@dataclass(frozen=True)
class DeadBandParameters:
    """Dead band, gains and limits; none of the originals is public."""

    yaw_rate_threshold: float = parameter(
        0.035, "rad/s", "Dead band r_0 of the yaw rate", "chosen: 2 degrees per second", minimum=0.0
    )
    yaw_rate_threshold_share: float = parameter(
        0.1, "1", "Share of the reference that widens the dead band", "chosen: model error", minimum=0.0
    )
    yaw_rate_gain: float = parameter(
        40000.0,
        "N.m.s/rad",
        "Gain k_r beyond the dead band",
        "chosen: the limit at 7 deg/s",
        minimum=0.0,
        tunable=True,
    )
    understeer_share: float = parameter(
        0.5, "1", "Share of the gain against understeer", "chosen: half", minimum=0.0, maximum=1.0
    )
    sideslip_gain: float = parameter(
        60000.0,
        "N.m/rad",
        "Gain k_beta beyond the limit",
        "chosen: the limit at 5 degrees",
        minimum=0.0,
        tunable=True,
    )
    moment_limit: float = like(LimitParameters, "moment_limit")
    release_speed: float = parameter(
        4.0, "m/s", "Speed below which the controller is off", "chosen: 15 km/h, usual", minimum=0.0
    )
    full_speed: float = parameter(
        8.0, "m/s", "Speed from which the moment is full", "chosen: twice that", minimum=0.001
    )


class DeadBand(Component):
    """Yaw-moment controller with dead band and sideslip limit, after van Zanten et al."""

    Parameters = DeadBandParameters
    sampled = True
    inputs = ("yaw_rate_ref", "yaw_rate", "sideslip", "velocity_x", signal("friction", start=1.0))
    outputs = (output("yaw_moment", *("yaw_rate_ref", "yaw_rate", "sideslip", "velocity_x", "friction")),)

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        p = self.p
        r_ref, r, beta, speed, mu = u
        error = beyond(r_ref - r, p.yaw_rate_threshold + p.yaw_rate_threshold_share * abs(r_ref))
        share = p.understeer_share if error * r_ref > 0.0 else 1.0
        moment = share * p.yaw_rate_gain * error + p.sideslip_gain * beyond(beta, sideslip_bound(mu))
        awake = (speed - p.release_speed) / max(p.full_speed - p.release_speed, 1e-3)
        moment *= min(max(awake, 0.0), 1.0)
        return (min(max(moment, -p.moment_limit), p.moment_limit),)
