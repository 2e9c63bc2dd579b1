"""Kalman filter of sideslip and yaw rate for the linear single-track car.

    dx/dt = A(v) x + b_delta delta + b_M M + w,           x = (beta, r)               cars.single_track_car
    y     = (r, a_y) + n,                                  a_y = v (dbeta/dt + r)

with white noise: w of the spectral densities q_beta^2, q_r^2, n of the standard deviations of the two
sensors per sample. The inputs are held over a sample, the transition is that of the Runge-Kutta method, and
the covariance goes with it: P = Phi P Phi' + h diag(q_beta^2, q_r^2). As the errors of the sensors are
independent, the two measurements are used one after the other, which needs no matrix to be inverted. At a
constant speed the gain comes to that of the algebraic Riccati equation.

Source: R. E. Kalman, Journal of Basic Engineering 82(1), 1960, 35-45; sequential measurements: B. D. O.
Anderson, J. B. Moore, Optimal Filtering, 1979, section 6.4.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from ..cars.single_track_car import SingleTrackCar
from ..mathematics.integrators import rk4


@dataclass(frozen=True)
class Noise:
    """Random walks of sideslip [rad/s^0.5] and yaw rate [rad/s^1.5], deviations of r [rad/s], a_y [m/s2]."""

    beta: float
    r: float
    gyro: float
    accelerometer: float


class LinearFilter:
    """Kalman filter, initialized in the steady state of straight driving.

    Args:
        car: the single-track car.
        noise: of model and sensors.

    Attributes:
        beta, r: estimates [rad], [rad/s].
        p_11, p_12, p_22: covariance P.
    """

    def __init__(self, car: SingleTrackCar, noise: Noise) -> None:
        self.car, self.noise = car, noise
        self.beta = self.r = 0.0
        self.p_11 = self.p_12 = self.p_22 = 0.0

    def predict(self, h: float, *, v: float, delta: float, moment: float) -> None:
        """Advance the estimate by `h` [s]; speed `v` > 0 [m/s], steer angle [rad], moment [N.m] are held."""
        derivatives = self.car.derivatives
        push = moment / self.car.i_z

        def driven(time: float, x: Sequence[float]) -> tuple[float, float]:
            beta_rate, r_rate = derivatives(x[0], x[1], delta=delta, v=v)
            return beta_rate, r_rate + push

        def free(time: float, x: Sequence[float]) -> tuple[float, float]:
            return derivatives(x[0], x[1], delta=0.0, v=v)

        self.beta, self.r = rk4(driven, 0.0, h, (self.beta, self.r))
        f_11, f_21 = rk4(free, 0.0, h, (1.0, 0.0))
        f_12, f_22 = rk4(free, 0.0, h, (0.0, 1.0))
        g_11, g_12 = f_11 * self.p_11 + f_12 * self.p_12, f_11 * self.p_12 + f_12 * self.p_22
        g_21, g_22 = f_21 * self.p_11 + f_22 * self.p_12, f_21 * self.p_12 + f_22 * self.p_22
        self.p_11 = g_11 * f_11 + g_12 * f_12 + h * self.noise.beta**2
        self.p_12 = g_11 * f_21 + g_12 * f_22
        self.p_22 = g_21 * f_21 + g_22 * f_22 + h * self.noise.r**2

    def correct(self, *, v: float, delta: float, r: float, a_y: float) -> None:
        """Use a measured yaw rate `r` [rad/s] and lateral acceleration `a_y` [m/s2]; others as before."""
        self._use(r - self.r, 0.0, 1.0, self.noise.gyro)
        at_rest, _ = self.car.derivatives(0.0, 0.0, delta=delta, v=v)
        by_beta, _ = self.car.derivatives(1.0, 0.0, delta=0.0, v=v)
        by_r, _ = self.car.derivatives(0.0, 1.0, delta=0.0, v=v)
        c_1, c_2 = v * by_beta, v * (by_r + 1.0)
        self._use(a_y - (c_1 * self.beta + c_2 * self.r + v * at_rest), c_1, c_2, self.noise.accelerometer)

    def _use(self, surprise: float, c_1: float, c_2: float, deviation: float) -> None:
        """Use one measurement y = c_1 beta + c_2 r + noise that differs from what was expected."""
        k_1, k_2 = self.p_11 * c_1 + self.p_12 * c_2, self.p_12 * c_1 + self.p_22 * c_2
        spread = c_1 * k_1 + c_2 * k_2 + deviation * deviation
        self.beta += k_1 * surprise / spread
        self.r += k_2 * surprise / spread
        self.p_11 -= k_1 * k_1 / spread
        self.p_12 -= k_1 * k_2 / spread
        self.p_22 -= k_2 * k_2 / spread
