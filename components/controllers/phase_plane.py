"""Yaw-moment control against leaving the stable strip of the sideslip's phase plane, and drifting out.

    M = k_s E(beta + T dbeta/dt)     spin: E is the excess over the strip, `control_laws.phase_plane`
    M = k_d D(r_ref - r)             drift out: inside of the strip, if |r| < |r_ref|

D is the excess over the dead band r_0 + share |r_ref|. A positive moment raises the yaw rate and lowers the
sideslip. Inside of the strip oversteer is left to the driver, so the law brakes later than one that follows a
yaw rate.

Source: the two states, spin by sideslip and its rate and drift out by the yaw rate that is lacking, are those
of M. Yamamoto, S. Koibuchi, Y. Fukada, S. Inagaki, Vehicle stability control in limit cornering by active
brake, SAE 960487, 1996, and of Inagaki et al. (`control_laws.phase_plane`). Neither could be read; no gain of
theirs is known to us. Ours: one moment for an allocator in place of brake forces of single wheels.
"""

from dataclasses import dataclass

from ..control_laws.moment_limit import LimitParameters, limit
from ..control_laws.phase_plane import PhasePlaneParameters, beyond, excess
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter, signal
from .dead_band import DeadBandParameters

SEEN = ("yaw_rate_ref", "yaw_rate", "sideslip", "sideslip_rate", "velocity_x")
"""Inputs of the law, besides the friction."""


@dataclass(frozen=True)
class PhasePlaneControllerParameters:
    """Strip, gains and limit."""

    boundary: float = like(PhasePlaneParameters, "boundary")
    lead_time: float = like(PhasePlaneParameters, "lead_time")
    spin_gain: float = parameter(
        60000.0, "N.m/rad", "Gain k_s outside of the strip", "chosen: as controller_dead_band", minimum=0.0
    )
    drift_gain: float = parameter(
        20000.0, "N.m.s/rad", "Gain k_d of a lacking yaw rate", "chosen: as controller_dead_band", minimum=0.0
    )
    yaw_rate_threshold: float = like(DeadBandParameters, "yaw_rate_threshold")
    yaw_rate_threshold_share: float = like(DeadBandParameters, "yaw_rate_threshold_share")
    moment_limit: float = like(LimitParameters, "moment_limit")
    fade_speed: float = like(LimitParameters, "fade_speed")


class PhasePlane(Component):
    """Yaw-moment controller that keeps the car in the stable strip of sideslip and its rate."""

    Parameters = PhasePlaneControllerParameters
    sampled = True
    inputs = (*SEEN, signal("friction", start=1.0))
    outputs = (output("yaw_moment", *SEEN, "friction"),)

    def output(self, t: float, u: list[float]) -> tuple[float, ...]:
        p = self.p
        r_ref, r, beta, rate, speed, mu = u
        moment = p.spin_gain * excess(beta, rate, mu, p)
        if moment == 0.0:
            lacking = beyond(r_ref - r, p.yaw_rate_threshold + p.yaw_rate_threshold_share * abs(r_ref))
            moment = p.drift_gain * lacking if lacking * r_ref > 0.0 else 0.0
        return (limit(moment, p, speed),)
