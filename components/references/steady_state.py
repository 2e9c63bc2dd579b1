"""Reference from the steady state of the linear single-track model, limited by friction.

    r_ref    = v_x / (L (1 + K v_x^2)) delta,                 |r_ref| <= mu g / |v_x|               (3)
    beta_1   = (b - m a v_x^2 / (C_r L)) / (L (1 + K v_x^2)) delta                                  (4)
    beta_ref = beta_1,   |beta_ref| <= min(|mu g (b / v_x^2 - m a / (C_r L))|, beta_max)

with positive axle stiffnesses C_f, C_r and the stability factor K of `cars.single_track_car`.
`friction_share` is the share of mu used in the limits. Rates: `control_laws.reference`.

beta_1 / delta crosses zero at v_x^2 = b C_r L / (m a) (16 m/s for the car of paper A), and so does
its limit. An oversteering car (K < 0) has no steady state above the critical speed v_x^2 = -1 / K; there
1 + K v_x^2 is held at `SMALLEST` and the limits, if on, take effect.

Source: paper A, equations (1)-(4). Errata: (3), (4) mix both sign conventions of cornering stiffness; (2)
lacks r in m (dv_y/dt + v_x r). Ours differs: |v_x|, so that a car rolling backwards has its own steady state;
beta_max, which the paper leaves open.
"""

from dataclasses import dataclass

from yawbench.vocabulary.gravity import G

from ..cars.published_cars import PaperA
from ..cars.single_track_car import SMALLEST, SingleTrackCar
from ..control_laws.reference import RateParameters, Reference
from ..fmi.variables import like, of_car, parameter


@dataclass(frozen=True)
class SteadyStateParameters:
    """Parameters of the single-track model and of its limits."""

    mass: float = like(PaperA, "mass")
    cg_to_front_axle: float = like(PaperA, "cg_to_front_axle")
    cg_to_rear_axle: float = like(PaperA, "cg_to_rear_axle")
    cornering_stiffness_front: float = of_car(100000.0, "paper A, table 1, two tyres")
    cornering_stiffness_rear: float = of_car(100000.0, "paper A, table 1, two tyres")
    limited: bool = parameter(True, None, "Limit the references according to friction", "paper A")
    friction_share: float = parameter(
        1.0, "1", "Share of the friction in the limits", "paper A: all of it", minimum=0.0
    )
    sideslip_limit: float = parameter(
        0.1,
        "rad",
        "Largest reference sideslip beta_max",
        "chosen: 6 degrees, the paper gives none",
        minimum=0.0,
    )
    rate_time_constant: float = like(RateParameters, "rate_time_constant")


def steady_state(
    delta: float, v_x: float, *, mu: float, k: float, p: SteadyStateParameters
) -> tuple[float, float]:
    """Return (r_ref [rad/s], beta_ref [rad]); equations (3), (4), limited if `p.limited`.

    Args:
        delta: steer angle [rad].
        v_x: longitudinal velocity [m/s]; at zero there is no yaw rate.
        mu: friction coefficient [1].
        k: stability factor [s2/m2].
    """
    a = p.cg_to_front_axle
    b = p.cg_to_rear_axle
    wheelbase = a + b
    square = v_x * v_x
    per_rad = delta / (wheelbase * max(1.0 + k * square, SMALLEST))
    slope = p.mass * a / (p.cornering_stiffness_rear * wheelbase)
    r = v_x * per_rad
    beta = (b - slope * square) * per_rad
    if not p.limited:
        return r, beta
    grip = max(mu, 0.0) * p.friction_share * G
    if abs(r * v_x) > grip:
        r = grip / v_x if r * v_x > 0.0 else -grip / v_x
    bound = p.sideslip_limit
    if abs(grip * (b - slope * square)) < bound * square:
        bound = abs(grip * (b / square - slope))
    return r, min(max(beta, -bound), bound)


class SteadyState(Reference):
    """Reference from the steady state of the linear single-track model, limited by friction."""

    Parameters = SteadyStateParameters

    def configure(self) -> None:
        self.k = SingleTrackCar.of(self.p).stability_factor()

    def begin(self, u: list[float]) -> tuple[float, float]:
        return steady_state(u[0], u[1], mu=u[2], k=self.k, p=self.p)

    def follow(self, h: float, u: list[float]) -> tuple[float, float]:
        return steady_state(u[0], u[1], mu=u[2], k=self.k, p=self.p)
