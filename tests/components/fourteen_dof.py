"""The car with 14 degrees of freedom for tests: its parameters, and its run with driver and tyres."""

from __future__ import annotations

from yawbench.components.cars.sprung_car import FourteenDofParameters, ride_of
from yawbench.components.drivers.sine import Sine
from yawbench.components.plants.fourteen_dof import FourteenDof
from yawbench.components.tyres.magic_formula import MagicFormula

from .loop import drive_on
from .stand import four

P = FourteenDofParameters()
RIDE = ride_of(P)
A, B, D = P.cg_to_front_axle, P.cg_to_rear_axle, P.track_width
L = A + B
FREE = {"drag_coefficient": 0.0, "rolling_resistance": 0.0}
SCALES = {"cornering_stiffness_scale_front": 0.611, "cornering_stiffness_scale_rear": 1.169}
SPEED, STEER, MU = 25.0, 1.5 / 17.0, 0.4  # paper C: 90 km/h, hand wheel 1.5 rad


def lateral(force):
    """Lateral forces of `force` [N] in all that do not turn the car."""
    return four("tyre_force_y", *[0.5 * force * B / L] * 2, *[0.5 * force * A / L] * 2)


def settle(stand, seconds=6.0, h=2e-3, **inputs):
    for _ in range(round(seconds / h)):
        y = stand.step(h, **inputs)
    return y


def drive(
    tyre=MagicFormula,
    *,
    plant=FourteenDof,
    steer=STEER,
    mu=MU,
    until=6.0,
    h=1e-3,
    record,
    torque=(0.0,),
    frequency=0.2,
    **parameters,
):
    """Return the recorded signals (rows) of driver, car and tyre in a loop."""
    sine = {"amplitude": steer, "frequency": frequency, "start_time": 0.5}
    car, tyres = {"initial_speed": SPEED} | parameters, SCALES if tyre is MagicFormula else {}
    units = [(Sine, sine), (plant, car), (tyre, tyres)]
    return drive_on(units, mu=mu, until=until, h=h, record=record, torque=torque)
