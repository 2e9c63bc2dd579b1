"""Direct wheel control: the torque of the requested force at constant wheel speed.

    T_i = F_i R,    |T_i| <= T_max

Source: paper A, section 3.3. Ours differs: the motor limit, which the paper leaves open.
"""

from dataclasses import dataclass

from ..cars.published_cars import PaperA
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter


@dataclass(frozen=True)
class DirectParameters:
    """Parameters of the wheel and its motor."""

    wheel_radius: float = like(PaperA, "wheel_radius")
    torque_limit: float = parameter(
        400.0, "N.m", "Largest torque T_max of a wheel", "chosen: in-wheel motor of this class", minimum=0.0
    )


def limited_torque(force: float, radius: float, limit: float) -> float:
    """Return the wheel torque [N.m] for a force [N] at the wheel radius [m], within +-limit [N.m]."""
    torque = force * radius
    return limit if torque > limit else -limit if torque < -limit else torque


class Direct(Component):
    """Direct wheel control: requested force times wheel radius, limited."""

    Parameters = DirectParameters
    inputs = ("force_request_*",)
    outputs = (output("torque_request_*", "force_request_*"),)
    sampled = True

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        radius = self.p.wheel_radius
        limit = self.p.torque_limit
        return [limited_torque(force, radius, limit) for force in u]
