"""Magic Formula tyre, 2002 form: load dependence, combined slip, aligning moment, friction per wheel.

Formulae, source and the treatment of friction are described in `tyre_models/pacejka_2002.py`, the default
set, of a 205/60R15, in `tyre_models/pacejka_2002_set.py`.
"""

from ..tyre_models.pacejka_2002 import lateral_slip, longitudinal_curve, longitudinal_force, wheel_forces
from ..tyre_models.pacejka_2002_set import Coefficients, MagicFormulaParameters, coefficients
from ..tyre_models.tyre import Curve, Tyre, law_outputs, no_force


class MagicFormula(Tyre):
    """Magic Formula tyres (2002 form) on four wheels: combined slip, aligning moment, friction per wheel."""

    Parameters = MagicFormulaParameters
    outputs = law_outputs("tyre_force_x_*", "tyre_force_y_*", "aligning_moment_*", "slip_stiffness_*")
    axle = staticmethod(coefficients)
    wheel = staticmethod(wheel_forces)

    @classmethod
    def curve(cls, alpha: float, f_z: float, mu: float, axle: Coefficients) -> Curve:
        curve = longitudinal_curve(*lateral_slip(alpha), f_z, mu, axle)
        if curve is None:
            return no_force, 1.0
        return lambda kappa: longitudinal_force(kappa, curve), curve.d / curve.stiffness
