"""Magic Formula tyre, original form of 1987: the set many papers use, combined slip by similarity.

The formulae and their sources are described in `tyre_models/bakker_1987.py`. There is no aligning
moment: the set has none.
"""

from __future__ import annotations

from ..fmi.component import Component
from ..fmi.variables import output
from ..tyre_models.bakker_1987 import (
    MagicFormula1987Parameters,
    coefficients_1987,
    forces_stiffness_1987,
    loaded_tyre,
)

_INPUTS = ("slip_angle_*", "slip_ratio_*", "vertical_load_*", "friction_*")


class MagicFormula1987(Component):
    """Magic Formula tyres (1987 form) on four wheels: combined slip by similarity, friction per wheel."""

    Parameters = MagicFormula1987Parameters
    inputs = _INPUTS
    outputs = (
        output("tyre_force_x_*", *_INPUTS),
        output("tyre_force_y_*", *_INPUTS),
        output("slip_stiffness_*", *_INPUTS),
        output("tyre_slip_ratio_*", "slip_ratio_*"),
    )

    def configure(self):
        self.coefficients = coefficients_1987(self.p)

    def output(self, t, u):
        longitudinal = []
        lateral = []
        stiffness = []
        for wheel in range(4):
            tyre = loaded_tyre(u[8 + wheel], u[12 + wheel], self.coefficients)
            f_x, f_y, slope = (
                (0.0, 0.0, 0.0) if tyre is None else forces_stiffness_1987(u[4 + wheel], u[wheel], tyre)
            )
            longitudinal.append(f_x)
            lateral.append(f_y)
            stiffness.append(slope)
        return *longitudinal, *lateral, *stiffness, *u[4:8]
