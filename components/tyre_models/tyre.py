"""The base of tyres: four wheels by the law of one.

A tyre declares its parameters and overrides up to four functions:

    wheel(kappa, alpha, f_z, mu, axle)    its outputs on one wheel, without `tyre_slip_ratio`: the law
    axle(p, name)                         what the law needs of the parameters for "front" or "rear"
    curve(alpha, f_z, mu, axle)           F_x of kappa alone, for who looks for the slip of a force
    for_curve(p)                          what `curve` needs of the parameters, per wheel

Slips and axes are those of the interface: forces act at the contact point, in wheel axes.
"""

from collections.abc import Callable, Iterable
from itertools import chain
from typing import Any, ClassVar

from ..fmi.component import Component
from ..fmi.variables import VariableSpec, output

Curve = tuple[Callable[[float], float], float]
"""F_x [N] of kappa, and a slip that is surely on its stable branch, of the order of the optimum."""

INPUTS = ("slip_angle_*", "slip_ratio_*", "vertical_load_*", "friction_*")


def law_outputs(*names: str, inputs: Iterable[str] = INPUTS) -> tuple[VariableSpec, ...]:
    """Declare what the law of one wheel gives of `inputs`, in this order, and the slip that it belongs to."""
    return (*(output(name, *inputs) for name in names), output("tyre_slip_ratio_*", "slip_ratio_*"))


def no_force(kappa: float) -> float:
    """Return the force [N] of a tyre without load or friction."""
    return 0.0


class Tyre(Component):
    """Base: four tyres by the law of one wheel."""

    inputs: ClassVar[Any] = INPUTS
    outputs = law_outputs("tyre_force_x_*", "tyre_force_y_*", "slip_stiffness_*")
    CurveParameters: ClassVar[type]
    """The parameters that `curve` needs; left out: all."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if "CurveParameters" not in cls.__dict__:
            cls.CurveParameters = cls.Parameters

    @staticmethod
    def wheel(kappa: float, alpha: float, f_z: float, mu: float, axle: Any) -> tuple[float, ...]:
        """Return F_x, F_y, dF_x/dkappa [N], or what `outputs` declares in their place, of one wheel.

        Args:
            kappa, alpha: longitudinal slip [1] and slip angle [rad].
            f_z, mu: vertical load [N] and friction coefficient [1].
            axle: what `axle` returned.
        """
        raise NotImplementedError

    @staticmethod
    def axle(p: Any, name: str) -> Any:
        """Return what the law needs of the parameters `p` on the axle "front" or "rear"."""
        return p

    @classmethod
    def curve(cls, alpha: float, f_z: float, mu: float, axle: Any) -> Curve:
        """Return F_x [N] of kappa at fixed slip angle [rad], load [N] and friction [1]."""
        wheel = cls.wheel
        return lambda kappa: wheel(kappa, alpha, f_z, mu, axle)[0], 1.0

    @classmethod
    def for_curve(cls, p: Any) -> tuple[Any, Any, Any, Any]:
        """Return what `curve` needs of the parameters `p` as `axle`, for fl, fr, rl, rr."""
        front, rear = cls.axle(p, "front"), cls.axle(p, "rear")
        return front, front, rear, rear

    def configure(self) -> None:
        self.front, self.rear = self.axle(self.p, "front"), self.axle(self.p, "rear")

    def output(self, t: float, u: list[float]) -> list[float]:
        a_fl, a_fr, a_rl, a_rr, k_fl, k_fr, k_rl, k_rr, z_fl, z_fr, z_rl, z_rr, m_fl, m_fr, m_rl, m_rr = u
        wheel, front, rear = self.wheel, self.front, self.rear
        by_wheel = zip(  # noqa: B905 - strict= costs a tenth
            wheel(k_fl, a_fl, z_fl, m_fl, front),
            wheel(k_fr, a_fr, z_fr, m_fr, front),
            wheel(k_rl, a_rl, z_rl, m_rl, rear),
            wheel(k_rr, a_rr, z_rr, m_rr, rear),
        )
        return [*chain.from_iterable(by_wheel), k_fl, k_fr, k_rl, k_rr]
