"""The car with fourteen degrees of freedom against the multi-body model of commonroad-vehicle-models.

That model, of M. Althoff, is another derivation of another school (NHTSA's VDANL: axles as bodies, lateral
springs between body and axles, lateral compliance of the tyres, camber). Its single-track drift model has
the same tyre without load transfer. Its equations are solved here by scipy, its axes, y to the right,
mirrored. The step: 2 degrees at the road wheels at 0.4 rad/s, 80 km/h, rolling freely.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import radians

import numpy as np
import pytest

from tests.evidence import measured
from yawbench.components.fmi.component import Component
from yawbench.components.fmi.variables import output, parameter
from yawbench.components.plants.fourteen_dof import FourteenDof

from .loop import drive_on
from .monolith import pieces

pytest.importorskip("vehiclemodels", reason="needs commonroad-vehicle-models")

from vehiclemodels.init_mb import init_mb
from vehiclemodels.init_std import init_std
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.utils import tire_model
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb
from vehiclemodels.vehicle_dynamics_std import vehicle_dynamics_std

SPEED, STEER, RATE = 80 / 3.6, radians(2.0), 0.4
LATE, UNTIL = 3.5, 4.0  # s: when the turn is called steady; the cars slow down all the time
TIMES = np.linspace(0.0, UNTIL, 4001)
SLIP_INPUTS = ("slip_angle_*", "slip_ratio_*", "vertical_load_*", "friction_*")


@dataclass(frozen=True)
class StepParameters:
    angle: float = parameter(STEER, "rad", "Steer angle at the end")


class StepSteer(Component):
    """Steer angle that rises at 0.4 rad/s."""

    Parameters = StepParameters
    outputs = ("steer_angle",)

    def output(self, t, u):
        return (min(RATE * t, self.p.angle),)


class TheirTyre(Component):
    """The tyre of commonroad-vehicle-models, without camber."""

    inputs = SLIP_INPUTS
    outputs = (output("tyre_force_x_*", *SLIP_INPUTS), output("tyre_force_y_*", *SLIP_INPUTS))

    def output(self, t, u):
        p = parameters().tire
        forces_x, forces_y = [], []
        for alpha, kappa, load in zip(u[:4], u[4:8], u[8:12], strict=True):
            load = max(load, 1.0)
            slip = -kappa if kappa < 0.0 else -kappa / (1.0 - kappa)  # theirs: 1 - w R / v
            f_x = tire_model.formula_longitudinal(slip, 0.0, load, p)
            f_y, mu_y = tire_model.formula_lateral(alpha, 0.0, load, p)
            forces_x.append(tire_model.formula_longitudinal_comb(slip, alpha, f_x, p))
            forces_y.append(tire_model.formula_lateral_comb(slip, alpha, 0.0, mu_y, load, f_y, p))
        return forces_x + forces_y


@cache
def parameters():
    return parameters_vehicle2()


def car(stiff=1.0):
    """Return their vehicle 2 in our parameters, the suspension and tyre springs times `stiff`."""
    p = parameters()
    unsprung = p.m_uf + p.m_ur
    wheelbase = p.a + p.b
    a = (p.m_s * p.a + p.m_ur * wheelbase) / p.m  # theirs count from the sprung mass
    track = 0.5 * (p.T_f + p.T_r)
    return {
        "mass": p.m_s + unsprung,
        "sprung_mass": p.m_s,
        "yaw_inertia": p.I_z,
        "sprung_roll_inertia": p.I_Phi_s,
        "sprung_pitch_inertia": p.I_y_s,
        "cg_to_front_axle": a,
        "cg_to_rear_axle": wheelbase - a,
        "track_width": track,
        "cg_height": p.h_cg,
        "unsprung_height": (p.m * p.h_cg - p.m_s * p.h_s) / unsprung,
        "spring_stiffness_front": stiff * p.K_sf,
        "spring_stiffness_rear": stiff * p.K_sr,
        "damping_front": stiff**0.5 * p.K_sdf,
        "damping_rear": stiff**0.5 * p.K_sdr,
        "anti_roll_stiffness_front": -p.K_tsf / track**2,
        "anti_roll_stiffness_rear": -p.K_tsr / track**2,
        "roll_centre_height_front": p.h_raf,
        "roll_centre_height_rear": p.h_rar,
        "tyre_vertical_stiffness": stiff * p.K_zt,
        "wheel_radius": p.R_w,
        "wheel_inertia": p.I_y_w,
        "drag_coefficient": 0.0,
        "rolling_resistance": 0.0,
        "initial_speed": SPEED,
    }


@cache
def ours(stiff=1.0):
    """Return yaw rate [deg/s], roll angle [deg] and v_x [m/s] (rows) at TIMES."""
    units = [(StepSteer, {}), (FourteenDof, car(stiff)), (TheirTyre, {})]
    found = drive_on(units, until=UNTIL, record=("yaw_rate", "roll_angle", "velocity_x"))
    return np.degrees(found[0]), np.degrees(found[1]), found[2]


def theirs(model, start):
    """Return their states (rows) at TIMES."""
    p, end = parameters(), STEER / RATE

    def derivatives(t, x):
        return model(list(x), [RATE if t < end else 0.0, 0.0], p)

    state = np.array(start([0.0, 0.0, 0.0, SPEED, 0.0, 0.0, 0.0], p), dtype=float)
    return pieces(derivatives, state, TIMES, kinks=[end], tolerance=1e-6, scale=0.01)


@cache
def multi_body():
    """Return yaw rate [deg/s] and roll angle [deg] at TIMES, mirrored to our axes."""
    states = theirs(vehicle_dynamics_mb, init_mb)
    return np.degrees(states[5]), -np.degrees(states[6])


@cache
def drift_model():
    return np.degrees(theirs(vehicle_dynamics_std, init_std)[5])


MULTI_BODY = "CommonRoad's multi-body model, another car model, by scipy"


def at(time, row):
    return row[np.searchsorted(TIMES, time)]


def test_their_step_steer_response_is_the_one_written_down():
    yaw_rate, roll = multi_body()
    assert at(LATE, yaw_rate) == pytest.approx(17.11, abs=0.01)
    assert at(1.0, yaw_rate) == pytest.approx(17.49, abs=0.01)
    assert at(LATE, roll) == pytest.approx(5.95, abs=0.01)
    assert at(LATE, drift_model()) == pytest.approx(16.69, abs=0.01)


def test_yaw_rate_is_within_four_per_cent_of_the_multi_body_model():
    yaw_rate = multi_body()[0]
    late = abs(at(LATE, ours()[0]) / at(LATE, yaw_rate) - 1.0)
    peak = abs(ours()[0].max() / yaw_rate.max() - 1.0)
    measured("cars", "the CommonRoad car's yaw rate", MULTI_BODY, max(late, peak), at_most=0.04)


def test_roll_angle_is_within_six_per_cent_of_the_multi_body_model():
    roll = multi_body()[1]
    late = abs(at(LATE, ours()[1]) / at(LATE, roll) - 1.0)
    peak = abs(ours()[1].max() / roll.max() - 1.0)
    measured("cars", "the CommonRoad car's roll angle", MULTI_BODY, max(late, peak), at_most=0.06)


@pytest.mark.exhaustive
def test_the_stiff_car_is_within_one_and_a_half_per_cent_of_the_single_track_drift_model():
    stiff = ours(1000.0)
    assert at(LATE, stiff[0]) == pytest.approx(at(LATE, drift_model()), rel=0.015)
    assert stiff[0].max() == pytest.approx(drift_model().max(), rel=0.015)
    assert np.abs(stiff[1]).max() < 0.01
