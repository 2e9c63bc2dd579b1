"""Cars that brake to a standstill at 1 ms, on tyres that tell their slip stiffness and tyres that do not."""

from __future__ import annotations

import numpy as np
import pytest

from yawbench.components.drivers.sine import Sine
from yawbench.components.plants.eight_dof import EightDof
from yawbench.components.plants.fourteen_dof import FourteenDof
from yawbench.components.plants.seven_dof import SevenDof
from yawbench.components.tyres.dugoff import Dugoff
from yawbench.components.tyres.linear import LinearTyre
from yawbench.components.tyres.magic_formula import MagicFormula
from yawbench.components.tyres.magic_formula_1987 import MagicFormula1987

from .loop import drive_on
from .stand import four

pytestmark = pytest.mark.sampled(1)


class SilentDugoff(Dugoff):
    """Dugoff tyres that say nothing but their forces."""

    outputs = Dugoff.outputs[:2]

    def output(self, t, u):
        return super().output(t, u)[:8]


class SilentMagicFormula(MagicFormula):
    """Magic Formula tyres that say nothing but their forces."""

    outputs = MagicFormula.outputs[:2]

    def output(self, t, u):
        return super().output(t, u)[:8]


def drive(
    plant, tyre, *, torque, until, record, h=1e-3, algorithm="extrapolated", speed=25.0, steer=0.0, mu=0.8
):
    """Return the recorded signals (rows); tyres find their wires by name, as in a scenario."""
    sine = {"amplitude": steer, "frequency": 0.4, "start_time": 0.2}
    limited = {"limited": True} if tyre is LinearTyre else {}
    units = [(Sine, sine), (plant, {"initial_speed": speed}), (tyre, limited)]
    return drive_on(units, until=until, h=h, record=record, mu=mu, torque=torque, algorithm=algorithm)


PLANTS = [SevenDof, EightDof, FourteenDof]
SOFT = {SevenDof: (-700.0, -700.0, -300.0, -300.0), EightDof: (-900.0, -900.0, -400.0, -400.0)}
SOFT[FourteenDof] = (-1300.0, -1300.0, -600.0, -600.0)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(
    "tyre", [Dugoff, SilentDugoff, MagicFormula, SilentMagicFormula, MagicFormula1987, LinearTyre]
)
@pytest.mark.parametrize("hard", [False, True], ids=["rolling", "locking"])
def test_braking_from_25_m_per_s_to_standstill_shows_no_limit_cycle_in_wheel_speed(plant, tyre, hard):
    torque = (-4000.0,) * 4 if hard else SOFT[plant]
    until = 7.5 if plant is FourteenDof else 6.5
    run = drive(
        plant, tyre, torque=torque, until=until, record=["velocity_x", "yaw_rate", *four("wheel_speed", 0.0)]
    )
    speed, spins = run[0], run[2:]
    stopped = int(np.argmax(speed < 0.02))
    assert 2500 < stopped < 5500
    # Wheels only ever slow down: from 8 m/s on nothing swings. Then they stand.
    braking = (speed < 8.0) & (np.arange(len(speed)) < stopped)
    assert np.diff(spins[:, braking]).max() <= 1e-12
    assert np.diff(speed[:stopped]).max() <= 1e-6
    assert not spins[:, stopped + 100 :].any()
    # The body of the fourteen-DOF car swings to rest on its springs, with its contact points.
    assert np.abs(speed[-500:]).max() < (2e-4 if plant is FourteenDof else 1e-9)
    assert not run[1].any()


@pytest.mark.parametrize("algorithm", ["gauss_seidel", "jacobi"])
@pytest.mark.parametrize("plant", PLANTS)
def test_the_other_algorithms_brake_to_standstill_as_calmly(plant, algorithm):
    run = drive(
        plant,
        MagicFormula,
        torque=SOFT[plant],
        until=6.0,
        algorithm=algorithm,
        record=["velocity_x", "wheel_speed_fl", "wheel_speed_rl"],
    )
    stopped = int(np.argmax(run[0] < 0.02))
    assert np.diff(run[1:, :stopped]).max() <= 1e-12
    assert not run[1:, stopped + 100 :].any()


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("tyre", [Dugoff, MagicFormula, SilentMagicFormula, MagicFormula1987])
@pytest.mark.parametrize("torque", [0.0, -1000.0])
def test_a_car_at_rest_stays_at_rest_with_the_wheels_turned(plant, tyre, torque):
    record = ["velocity_x", "velocity_y", "yaw_rate", "position_x", "wheel_speed_fl", "wheel_speed_rr"]
    run = drive(plant, tyre, torque=(torque,), until=0.3, speed=0.0, steer=0.3, record=record)
    assert not run.any()
