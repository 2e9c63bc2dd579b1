"""Linear-quadratic regulator (LQR) of sideslip and yaw rate for the linear single-track car, in closed form.

With the errors e = (beta - beta_ref, r - r_ref) and the yaw moment M,

    de/dt = A e + B M,      B = (0, 1 / I_z)
    J     = integral of (e_beta / beta_0)^2 + (e_r / r_0)^2 + (M / M_0)^2 dt

is minimal for M = -(k_beta e_beta + k_r e_r). With two states and one input the Riccati equation need not
be solved: the closed loop's characteristic polynomial s^2 + c_1 s + c_0 is the stable factor of

    phi(s) phi(-s) + M_0^2 (n_beta(s) n_beta(-s) / beta_0^2 + n_r(s) n_r(-s) / r_0^2)

where phi is that of A, n_beta = a_12 / I_z and n_r = (s - a_11) / I_z. By comparison of coefficients,

    c_0^2 = phi_0^2 + M_0^2 / I_z^2 (a_12^2 / beta_0^2 + a_11^2 / r_0^2)
    c_1^2 = phi_1^2 - 2 phi_0 + M_0^2 / (I_z^2 r_0^2) + 2 c_0

and the gains follow as in pole placement. Source: B. D. O. Anderson, J. B. Moore, Optimal Control: Linear
Quadratic Methods, 1990, section 5.2 (return difference); scales 1 / x_0^2 as weights: A. E. Bryson,
Y.-C. Ho, Applied Optimal Control, 1975, section 5.2.
"""

from math import copysign, sqrt

from ..cars.single_track_car import SingleTrackCar

Matrix = tuple[tuple[float, float], tuple[float, float]]
_SMALLEST = 1e-6
"""Smallest magnitude of a_12, the influence of yaw rate on sideslip; it crosses zero at walking pace."""


def error_dynamics(car: SingleTrackCar, v: float) -> Matrix:
    """Return the elements a_11 [1/s], a_12 [1], a_21 [1/s2], a_22 [1/s] of A at the speed `v` > 0 [m/s]."""
    at_beta = car.derivatives(1.0, 0.0, delta=0.0, v=v)
    at_r = car.derivatives(0.0, 1.0, delta=0.0, v=v)
    return (at_beta[0], at_r[0]), (at_beta[1], at_r[1])


def optimal_gains(
    dynamics: Matrix, i_z: float, *, beta_0: float, r_0: float, moment_0: float
) -> tuple[float, float]:
    """Return k_beta [N.m/rad] and k_r [N.m.s/rad].

    Args:
        dynamics: A of the errors.
        i_z: yaw inertia [kg.m2].
        beta_0, r_0, moment_0: sideslip [rad], yaw rate [rad/s] and moment [N.m] of equal cost.
    """
    (a_11, a_12), (a_21, a_22) = dynamics
    if abs(a_12) < _SMALLEST:
        a_12 = copysign(_SMALLEST, a_12)
    phi_0 = a_11 * a_22 - a_12 * a_21
    phi_1 = -(a_11 + a_22)
    push = moment_0 / i_z
    c_0 = sqrt(phi_0 * phi_0 + (push * a_12 / beta_0) ** 2 + (push * a_11 / r_0) ** 2)
    c_1 = sqrt(phi_1 * phi_1 - 2.0 * phi_0 + (push / r_0) ** 2 + 2.0 * c_0)
    k_r = i_z * (c_1 - phi_1)
    k_beta = (i_z * (c_0 - phi_0) + a_11 * k_r) / a_12
    return k_beta, k_r
