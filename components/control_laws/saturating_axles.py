"""Single-track car on saturating axles: forces, yaw moment of the tyres, and the moment that holds a turn.

    alpha_f = delta - beta - a r / v,   alpha_r = b r / v - beta
    F = C alpha / sqrt(1 + (C alpha / (mu N))^2)                       with the axle's static load N
    M_t = a F_f - b F_r

A turn of yaw rate r at the steer angle delta is steady with the sideslip at which F_f + F_r = m v r, and with
the additional moment M = -M_t.

The form of the axle force is that of `estimation.steered_track`: its slope at zero slip is C, its limit mu N.
"""

from yawbench.vocabulary.gravity import G

from ..cars.single_track_car import SingleTrackCar
from ..estimation.steered_track import saturated
from .sliding_surface import sign

SLIPPERIEST = 0.05
"""Smallest friction [1]; chosen: wet ice."""
WIDEST = 0.5
"""First step of the search for the sideslip [rad]; twice it is the largest sideslip that is found."""
HALVINGS = 32
"""Steps of that search; chosen: to 1e-10 rad, a hundred-thousandth of a newton."""


def axle_forces(
    car: SingleTrackCar, beta: float, r: float, *, delta: float, v: float, mu: float
) -> tuple[float, float]:
    """Return the lateral forces of front and rear axle [N], positive to the left.

    Args:
        car: masses, arms and stiffnesses.
        beta, r: sideslip [rad], yaw rate [rad/s].
        delta, v, mu: steer angle [rad], speed > 0 [m/s], friction [1].
    """
    grip = max(mu, SLIPPERIEST) * car.m * G / (car.a + car.b)
    front = saturated(car.c_f * (delta - beta - car.a * r / v), grip * car.b)
    rear = saturated(car.c_r * (car.b * r / v - beta), grip * car.a)
    return front, rear


def tyre_moment(car: SingleTrackCar, beta: float, r: float, *, delta: float, v: float, mu: float) -> float:
    """Return the yaw moment M_t of the lateral forces [N.m]; arguments as of `axle_forces`."""
    front, rear = axle_forces(car, beta, r, delta=delta, v=v, mu=mu)
    return car.a * front - car.b * rear


def holding_moment(car: SingleTrackCar, r: float, *, delta: float, v: float, mu: float) -> float:
    """Return the yaw moment [N.m] that makes a turn of yaw rate `r` [rad/s] steady.

    Where the road does not bear m v r, the sideslip is taken at the end of its range, and the moment is that
    of axles which give all they can. Other arguments as of `axle_forces`.
    """
    beta, step = 0.0, WIDEST
    for _ in range(HALVINGS):  # the sum of the forces falls with beta
        front, rear = axle_forces(car, beta, r, delta=delta, v=v, mu=mu)
        beta += step * sign(front + rear - car.m * v * r)
        step *= 0.5
    return -tyre_moment(car, beta, r, delta=delta, v=v, mu=mu)
