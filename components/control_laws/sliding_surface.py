"""Sliding-mode yaw-moment law shared by the controllers of paper B.

    s = (r_ref - r) + w (beta_ref - beta)                                                     (19)
    M = I_z [dr_ref/dt + eps switch(s) + k_d s + w (dbeta_ref/dt - dbeta/dt)]                 (23)
    switch(s) = sign(s)   or   sat(s / Delta), Delta the boundary layer                       (24)

Sign of w: on s = 0 with saturated tyres the sideslip obeys
dbeta/dt = a_y / v - r_ref + w (beta - beta_ref), which is unstable for w > 0. In ISO axes w is therefore
negative (or zero); the paper does not give the sign.

Source: paper B, section 2.1.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from ..cars.published_cars import PaperB
from ..fmi.variables import like, parameter
from .moment_limit import LimitParameters, limit

ERRORS = (
    "yaw_rate_ref",
    "sideslip_ref",
    "yaw_acceleration_ref",
    "sideslip_rate_ref",
    "yaw_rate",
    "sideslip",
    "sideslip_rate",
)
"""Inputs of the law, in the order that `SlidingSurface` expects."""

SURFACE = ("yaw_rate_ref", "sideslip_ref", "yaw_rate", "sideslip")
"""Inputs on which the sliding surface depends."""


@dataclass(frozen=True)
class SurfaceParameters:
    """Parameters of surface, boundary layer and moment limit; the paper gives none but I_z."""

    boundary_layer: float = parameter(
        0.1, "rad/s", "Half width Delta of the boundary layer", "chosen: about 6 deg/s", minimum=0.0
    )
    sideslip_weight: float = parameter(
        -0.25, "1/s", "Weight w of the sideslip error, negative: see control_laws.sliding_surface", "chosen"
    )
    yaw_inertia: float = like(PaperB, "yaw_inertia")
    moment_limit: float = like(
        LimitParameters, "moment_limit", 10000.0, "chosen: m g d / 2, the most that the road can give at mu 1"
    )
    fade_speed: float = like(LimitParameters, "fade_speed")


def sign(s: float) -> float:
    """Return -1, 0 or 1."""
    return float((s > 0.0) - (s < 0.0))


def saturation(s: float, layer: float) -> float:
    """Return s / layer limited to -1..1, equation (24); for layer = 0, the sign of `s`."""
    if abs(s) >= layer:
        return sign(s)
    return s / layer


class SlidingSurface:
    """Sliding-mode law at an instant: the surface s [rad/s], and the moment for given reaching gains.

    Args:
        u: the signals `ERRORS`.
        p: parameters of the law.
    """

    def __init__(self, u: Sequence[float], p: SurfaceParameters) -> None:
        r_ref, beta_ref, dr_ref, dbeta_ref, r, beta, dbeta = u
        w = p.sideslip_weight
        self.p = p
        self.s = (r_ref - r) + w * (beta_ref - beta)
        self.equivalent = dr_ref + w * (dbeta_ref - dbeta)  # equivalent control [rad/s2]

    def moment(self, *, eps: float, k_d: float, speed: float, switching: str = "saturation") -> float:
        """Return the limited yaw moment M [N.m]; equation (23).

        Args:
            eps, k_d: gains of the reaching law [rad/s2], [1/s].
            speed: speed of the car [m/s].
            switching: "sign" or "saturation", equation (24).
        """
        p, s = self.p, self.s
        switched = sign(s) if switching == "sign" else saturation(s, p.boundary_layer)
        moment = p.yaw_inertia * (self.equivalent + eps * switched + k_d * s)
        return limit(moment, p, speed)
