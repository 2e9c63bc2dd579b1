"""Magic Formula tyre, original form of 1987 as used in many papers, with combined slip by similarity.

Formulae and sources are described in `tyre_models/bakker_1987.py`. The set has no aligning moment.
"""

from ..tyre_models.bakker_1987 import (
    Coefficients1987,
    MagicFormula1987Parameters,
    coefficients_1987,
    forces_1987,
    loaded_tyre,
)
from ..tyre_models.tyre import Curve, Tyre, no_force


class MagicFormula1987(Tyre):
    """Magic Formula tyres (1987 form) on four wheels: combined slip by similarity, friction per wheel."""

    Parameters = MagicFormula1987Parameters

    @staticmethod
    def axle(p: MagicFormula1987Parameters, name: str) -> Coefficients1987:
        return coefficients_1987(p)

    @staticmethod
    def wheel(kappa: float, alpha: float, f_z: float, mu: float, axle: Coefficients1987) -> tuple[float, ...]:
        tyre = loaded_tyre(f_z, mu, axle)
        return (0.0, 0.0, 0.0) if tyre is None else forces_1987(kappa, alpha, tyre)

    @classmethod
    def curve(cls, alpha: float, f_z: float, mu: float, axle: Coefficients1987) -> Curve:
        tyre = loaded_tyre(f_z, mu, axle)
        if tyre is None:
            return no_force, 1.0
        return lambda kappa: forces_1987(kappa, alpha, tyre)[0], tyre.d_x / tyre.k_x
