"""Extended Kalman filter for lateral velocity and friction, on a single-track model with Dugoff axles.

    a_m      = (F_f(alpha_f) cos(delta) + F_r(alpha_r)) / m                    `estimation.dugoff_axle`    (1)
    alpha_f  = atan2(v_y + a r, v_x) - delta,     alpha_r = atan2(v_y - b r, v_x)
    dv_y/dt  = (1 - share) a_m + share a_y - v_x r,        dmu/dt = 0                                      (2)
    y        = a_m + noise                                                                           (3)

The state is (v_y, mu), the measurement y the lateral acceleration, a share of which also enters the
prediction; the yaw rate is taken as measured. The covariance P uses the derivatives of (1) by v_y and mu.
While the tyres grip, a_m depends on v_y alone and mu is constant; when they slide, it depends on mu, which is
then learned upwards and downwards. Friction is thus observable only when it is used.

Safeguards against a filter that explains any measurement by friction:

    mu >= used_share max over the last seconds of |a_y| / g, forgotten with `friction_memory`              (4)
    v_y decays with `straight_fade` while the car drives straight ahead                                    (5)
    P_mu <= initial_friction_deviation^2, so that friction does not drift while it is not observable       (6)

Source: R. E. Kalman, Journal of Basic Engineering 82(1), 1960, 35-45; joint estimation of sideslip and
friction: H. F. Grip et al., Vehicle sideslip estimation, IEEE Control Systems Magazine 29(5), 2009, 36-52.
Ours has other tyres and another gain, and adds the share and (4) to (6).
"""

from dataclasses import dataclass
from math import atan2, cos

from yawbench.vocabulary.gravity import G

from ..fmi.variables import parameter
from .dugoff_axle import axle_force
from .estimator_parameters import EstimatorParameters
from .straight_ahead import faded

SLOWEST = 2.0
"""Reference speed [m/s] of the slip angles of a slower car; chosen: walking pace."""
SMALLEST = 0.05
"""Smallest friction [1]; chosen: wet ice."""
_TUNED = "chosen: on runs of four cars, see docs/estimators.md"


@dataclass(frozen=True)
class FilterParameters(EstimatorParameters):
    """Tyre stiffnesses, and standard deviations of model, measurement and friction."""

    cornering_stiffness_front: float = parameter(
        91600.0, "N/rad", "Stiffness C_f of the front axle", "chosen: that of the tyres of set 1", minimum=1.0
    )
    cornering_stiffness_rear: float = parameter(
        67800.0, "N/rad", "Stiffness C_r of the rear axle", "chosen: that of the tyres of set 1", minimum=1.0
    )
    initial_friction: float = parameter(
        0.6, "1", "Initial friction", "chosen: low, since an increase is learned at once", minimum=0.05
    )
    initial_friction_deviation: float = parameter(
        0.3,
        "1",
        "Standard deviation of the initial friction",
        "chosen: twice it spans ice to dry road",
        minimum=0.0,
    )
    largest_friction: float = parameter(
        1.2, "1", "Largest friction", "chosen: beyond tyres of cars", minimum=0.1
    )
    friction_memory: float = parameter(
        2.0, "s", "Time after which a used friction is forgotten", "chosen: a lane change", minimum=0.01
    )
    used_share: float = parameter(
        0.95, "1", "Least friction as a share of the used friction", "chosen: for noise in a_y", minimum=0.0
    )
    measured_share: float = parameter(
        0.5, "1", "Share of the measured a_y in the prediction", _TUNED, minimum=0.0, maximum=1.0
    )
    velocity_wander: float = parameter(
        0.1, "m/s2", "Random walk of v_y, in m/s per square root of a second", _TUNED, minimum=0.0
    )
    friction_wander: float = parameter(
        0.3, "1", "Random walk of friction, per square root of a second", _TUNED, minimum=0.0
    )
    acceleration_deviation: float = parameter(
        0.5, "m/s2", "Standard deviation of the measured a_y from the model's", _TUNED, minimum=0.001
    )


class SingleTrackFilter:
    """Kalman filter for v_y [m/s], its rate [m/s2] and mu [1], initialized straight ahead."""

    def __init__(self, p: FilterParameters) -> None:
        self.p = p
        self.v_y = self.rate = 0.0
        self.mu = p.initial_friction
        self.used = 0.0
        self.p_v, self.p_vm, self.p_m = 0.0, 0.0, p.initial_friction_deviation**2

    def model(self, *, v_x: float, r: float, delta: float, a_x: float) -> tuple[float, float, float]:
        """Return a_m [m/s2] and its derivatives by v_y [1/s] and mu [m/s2]; equation (1)."""
        p = self.p
        a, b, weight = (
            p.cg_to_front_axle,
            p.cg_to_rear_axle,
            p.mass / (p.cg_to_front_axle + p.cg_to_rear_axle),
        )
        v = max(v_x, SLOWEST)
        front, rear = atan2(self.v_y + a * r, v), atan2(self.v_y - b * r, v)
        lift = p.cg_height * a_x
        f, f_alpha, f_mu = axle_force(
            front - delta, weight * max(G * b - lift, 0.1 * G * b), self.mu, p.cornering_stiffness_front
        )
        q, q_alpha, q_mu = axle_force(
            rear, weight * max(G * a + lift, 0.1 * G * a), self.mu, p.cornering_stiffness_rear
        )
        turned = cos(delta)
        by_v = (f_alpha * turned * cos(front) ** 2 + q_alpha * cos(rear) ** 2) / v
        return (f * turned + q) / p.mass, by_v / p.mass, (f_mu * turned + q_mu) / p.mass

    def see(
        self, h: float, *, v_x: float, r: float, delta: float, a_x: float, a_y: float, straight: float
    ) -> None:
        """Advance the state by `h` [s] to a message; equations (2) to (6).

        Args:
            v_x, r, delta, a_x, a_y: speed [m/s], yaw rate [rad/s], steer angle [rad], accelerations [m/s2].
            straight: time for which the car has been driving straight ahead [s].
        """
        p = self.p
        at = {"v_x": v_x, "r": r, "delta": delta, "a_x": a_x}
        a_m, by_v, by_mu = self.model(**at)
        rest = 1.0 - p.measured_share
        self.rate = rest * a_m + p.measured_share * a_y - v_x * r
        self.v_y += h * self.rate
        f, g = 1.0 + h * rest * by_v, h * rest * by_mu
        p_v, p_vm, p_m = self.p_v, self.p_vm, self.p_m
        p_v = f * (f * p_v + g * p_vm) + g * (f * p_vm + g * p_m) + h * p.velocity_wander**2
        p_vm = f * p_vm + g * p_m
        p_m = min(p_m + h * p.friction_wander**2, p.initial_friction_deviation**2)
        a_m, by_v, by_mu = self.model(**at)
        to_v, to_m = p_v * by_v + p_vm * by_mu, p_vm * by_v + p_m * by_mu
        spread = by_v * to_v + by_mu * to_m + p.acceleration_deviation**2
        self.v_y += to_v * (a_y - a_m) / spread
        self.mu += to_m * (a_y - a_m) / spread
        self.p_v, self.p_vm = p_v - to_v * to_v / spread, p_vm - to_v * to_m / spread
        self.p_m = p_m - to_m * to_m / spread
        self.used = max(self.used * (1.0 - min(h / p.friction_memory, 1.0)), abs(a_y) / G)
        self.mu = min(max(self.mu, p.used_share * self.used, SMALLEST), p.largest_friction)
        self.v_y = faded(self.v_y, h, straight, p)
