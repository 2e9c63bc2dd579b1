"""The sliding-mode yaw-moment law that the controllers of paper B share.

    s = (r_ref - r) + w (beta_ref - beta)                                                     (19)
    M = I_z [dr_ref/dt + eps switch(s) + k_d s + w (dbeta_ref/dt - dbeta/dt)]                 (23)
    switch(s) = sign(s)   or   sat(s / Delta), Delta the boundary layer                       (24)

The sign of w. On s = 0 with saturated tyres the sideslip obeys
dbeta/dt = a_y / v - r_ref + w (beta - beta_ref): w > 0 drives it away, w < 0 brings it back. In
ISO axes w is therefore negative (or zero); the paper does not say.

Source: Vehicle yaw stability control based on fuzzy sliding mode direct yaw moment, section 2.1.
"""

from __future__ import annotations

from collections.abc import Sequence

ERRORS = (
    "yaw_rate_ref",
    "sideslip_ref",
    "yaw_acceleration_ref",
    "sideslip_rate_ref",
    "yaw_rate",
    "sideslip",
    "sideslip_rate",
)
"""The inputs of the law, in the order of `surface` and `demand`."""

SURFACE = ("yaw_rate_ref", "sideslip_ref", "yaw_rate", "sideslip")
"""Those that the sliding surface itself follows."""


def sign(s: float) -> float:
    """Return -1, 0 or 1."""
    return float((s > 0.0) - (s < 0.0))


def saturation(s: float, layer: float) -> float:
    """Return s / layer limited to -1..1, equation (24); the sign of `s` for a layer of zero."""
    if abs(s) >= layer:
        return sign(s)
    return s / layer


def surface(u: Sequence[float], w: float) -> tuple[float, float]:
    """Return the sliding surface s [rad/s] and the demand without reaching law [rad/s2].

    Args:
        u: the signals `ERRORS`.
        w: weight of the sideslip [1/s], equation (19).
    """
    r_ref, beta_ref, dr_ref, dbeta_ref, r, beta, dbeta = u
    return (r_ref - r) + w * (beta_ref - beta), dr_ref + w * (dbeta_ref - dbeta)


def demand(s: float, equivalent: float, switched: float, *, eps: float, k_d: float, i_z: float) -> float:
    """Return the yaw moment M [N.m], equation (23).

    Args:
        s: sliding surface [rad/s].
        equivalent: the demand without the reaching law [rad/s2], from `surface`.
        switched: sign(s) or sat(s / Delta) [1].
        eps, k_d: gains of the reaching law [rad/s2], [1/s].
        i_z: yaw inertia [kg.m2].
    """
    return i_z * (equivalent + eps * switched + k_d * s)


def limit(moment: float, most: float, speed: float, fade_speed: float) -> float:
    """Return `moment` [N.m] limited to +-`most`, faded out linearly below `fade_speed` [m/s].

    Sideslip is a ratio of speeds: in a car that hardly moves it carries no information.
    """
    if speed < fade_speed:
        moment *= max(speed, 0.0) / fade_speed
    return min(max(moment, -most), most)
