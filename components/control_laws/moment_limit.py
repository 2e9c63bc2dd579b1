"""Limit of a yaw moment, and its fade-out below walking pace, where sideslip is meaningless."""

from dataclasses import dataclass
from typing import Any

from ..fmi.variables import parameter


@dataclass(frozen=True)
class LimitParameters:
    """Parameters of the limit."""

    moment_limit: float = parameter(
        5000.0, "N.m", "Largest yaw moment", "chosen: beyond what one wheel gives at mu 0.4", minimum=0.0
    )
    fade_speed: float = parameter(
        2.0, "m/s", "Speed below which the moment fades out", "chosen: walking pace", minimum=0.001
    )


def limit(moment: float, p: Any, speed: float) -> float:
    """Return `moment` [N.m] limited according to `p`, and faded out linearly below `fade_speed` [m/s].

    Sideslip is a ratio of speeds: in a car that hardly moves it carries no information.
    """
    if speed < p.fade_speed:
        moment *= max(speed, 0.0) / p.fade_speed
    most: float = p.moment_limit
    return min(max(moment, -most), most)
