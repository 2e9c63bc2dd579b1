"""Magic Formula tyre, 2002 form: load dependence, combined slip, aligning moment, friction per wheel.

The formulae, their source and what stands for friction are described in `tyre_models/pacejka_2002.py`,
the default set, of a 205/60R15, in `tyre_models/pacejka_2002_set.py`.
"""

from __future__ import annotations

from ..fmi.component import Component
from ..fmi.variables import output
from ..tyre_models.pacejka_2002 import forces_moment_stiffness
from ..tyre_models.pacejka_2002_set import MagicFormulaParameters, coefficients

_INPUTS = ("slip_angle_*", "slip_ratio_*", "vertical_load_*", "friction_*")


class MagicFormula(Component):
    """Magic Formula tyres (2002 form) on four wheels: combined slip, aligning moment, friction per wheel."""

    Parameters = MagicFormulaParameters
    inputs = _INPUTS
    outputs = (
        output("tyre_force_x_*", *_INPUTS),
        output("tyre_force_y_*", *_INPUTS),
        output("aligning_moment_*", *_INPUTS),
        output("slip_stiffness_*", *_INPUTS),
        output("tyre_slip_ratio_*", "slip_ratio_*"),
    )

    def configure(self):
        self.front = coefficients(self.p, "front")
        self.rear = coefficients(self.p, "rear")

    def output(self, t, u):
        front = self.front
        rear = self.rear
        x_fl, y_fl, z_fl, k_fl = forces_moment_stiffness(u[4], u[0], u[8], u[12], front)
        x_fr, y_fr, z_fr, k_fr = forces_moment_stiffness(u[5], u[1], u[9], u[13], front)
        x_rl, y_rl, z_rl, k_rl = forces_moment_stiffness(u[6], u[2], u[10], u[14], rear)
        x_rr, y_rr, z_rr, k_rr = forces_moment_stiffness(u[7], u[3], u[11], u[15], rear)
        forces = x_fl, x_fr, x_rl, x_rr, y_fl, y_fr, y_rl, y_rr, z_fl, z_fr, z_rl, z_rr
        return *forces, k_fl, k_fr, k_rl, k_rr, *u[4:8]
