"""The Magic Formulas' forces and moment alone, without the slope that tyres give beside them."""

from __future__ import annotations

from yawbench.components.tyre_models import bakker_1987, pacejka_2002


def forces_and_moment(kappa, alpha, f_z, mu, axle):
    return pacejka_2002.wheel_forces(kappa, alpha, f_z, mu, axle)[:3]


def forces_1987(kappa, alpha, tyre):
    return bakker_1987.forces_1987(kappa, alpha, tyre)[:2]
