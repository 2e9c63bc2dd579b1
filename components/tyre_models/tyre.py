"""Base class of tyres: four wheels with the same tyre model.

A tyre declares its parameters and overrides up to four functions:

    wheel(kappa, alpha, f_z, mu, axle)    the tyre model: outputs of a wheel, without `tyre_slip_ratio`
    axle(p, name)                         preprocessed parameters of `wheel` for "front" or "rear"
    curve(alpha, f_z, mu, axle)           F_x as a function of kappa, for slip control
    for_curve(p)                          preprocessed parameters of `curve`, per wheel

Slips and axes are those of the interface: forces act at the contact point, in wheel axes.
"""

from collections.abc import Callable, Iterable
from itertools import chain
from typing import Any, ClassVar

from ..fmi.component import Component
from ..fmi.variables import VariableSpec, output

Curve = tuple[Callable[[float], float], float]
"""F_x [N] of kappa, and a slip on its stable branch of the order of the optimum."""

INPUTS = ("slip_angle_*", "slip_ratio_*", "vertical_load_*", "friction_*")


def law_outputs(*names: str, inputs: Iterable[str] = INPUTS) -> tuple[VariableSpec, ...]:
    """Declare the outputs of a tyre model that depends on `inputs`, and the slip of its forces."""
    return (*(output(name, *inputs) for name in names), output("tyre_slip_ratio_*", "slip_ratio_*"))


def no_force(kappa: float) -> float:
    """Return zero: the force [N] of a tyre without load or friction."""
    return 0.0


class Tyre(Component):
    """Base class of tyres: four wheels with the same tyre model."""

    inputs: ClassVar[Any] = INPUTS
    outputs = law_outputs("tyre_force_x_*", "tyre_force_y_*", "slip_stiffness_*")
    CurveParameters: ClassVar[type]
    """Parameters of `curve`; default: all."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if "CurveParameters" not in cls.__dict__:
            cls.CurveParameters = cls.Parameters

    @staticmethod
    def wheel(kappa: float, alpha: float, f_z: float, mu: float, axle: Any) -> tuple[float, ...]:
        """Return F_x, F_y, dF_x/dkappa [N] of a wheel, or the outputs declared in their place.

        Args:
            kappa, alpha: longitudinal slip [1] and slip angle [rad].
            f_z, mu: vertical load [N] and friction coefficient [1].
            axle: from `axle`.
        """
        raise NotImplementedError

    @staticmethod
    def axle(p: Any, name: str) -> Any:
        """Return the preprocessed parameters of `wheel` for the axle "front" or "rear"."""
        return p

    @classmethod
    def curve(cls, alpha: float, f_z: float, mu: float, axle: Any) -> Curve:
        """Return F_x [N] as a function of kappa at fixed slip angle [rad], load [N] and friction [1]."""
        wheel = cls.wheel
        return lambda kappa: wheel(kappa, alpha, f_z, mu, axle)[0], 1.0

    @classmethod
    def for_curve(cls, p: Any) -> tuple[Any, Any, Any, Any]:
        """Return the argument `axle` of `curve` for fl, fr, rl, rr."""
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
