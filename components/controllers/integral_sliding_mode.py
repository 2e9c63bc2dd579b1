"""Integral sliding-mode control of the yaw rate: a nominal law, and a sliding mode for what it does not know.

    nominal     M_0 = I_z (dr_ref/dt + k e) - M_t,       e = r_ref - r,      so that de/dt = -k e
    observed    sigma = r - z,   dz/dt = (M_t + M) / I_z + rho sat(sigma / Delta),   z(0) = r(0)
    perturbed   tau dd/dt = rho sat(sigma / Delta) - d
    law         M = M_0 - I_z d

M_t is the moment of the tyres of a single-track car on saturating axles (`control_laws.saturating_axles`);
all that it does not know is the perturbation d. sigma, with its integral z of the nominal model, is zero
from the start: there is no reaching phase, and while |d| <= rho the yaw rate follows the nominal law from t
= 0. The switching stays inside of the observer, and what acts on the car is its mean, d. In the boundary
layer Delta the observer is linear, with the rate rho / Delta; for Delta below rho times the sample time it
switches at every sample. z has the limited moment, so nothing winds up.

After T. Goggia, A. Sorniotti, L. De Novellis, A. Ferrara, P. Gruber, J. Theunissen, D. Steenbeke, B.
Knauder, J. Zehetner, Integral sliding mode for the torque-vectoring control of fully electric vehicles:
theoretical design and experimental assessment, IEEE Transactions on Vehicular Technology 64(5), 2015,
1701-1715; the principle, and the switching inside of an observer: V. Utkin, J. Shi, Integral sliding mode in
systems operating under uncertainty conditions, 35th IEEE Conference on Decision and Control, 1996, 4591-4596.
Neither was at hand, so equations beyond the principle, nominal law and gains are ours.
"""

from dataclasses import dataclass
from math import exp

from ..cars.published_cars import PaperASingleTrack
from ..cars.single_track_car import SingleTrackCar
from ..control_laws.moment_limit import LimitParameters, limit
from ..control_laws.saturating_axles import tyre_moment
from ..control_laws.sliding_surface import saturation
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter, signal
from .lqr import LqrParameters

SEEN = (
    "yaw_rate_ref",
    "yaw_acceleration_ref",
    "yaw_rate",
    "sideslip",
    "steer_angle",
    "velocity_x",
    "friction",
)


@dataclass(frozen=True)
class IntegralSlidingModeParameters(PaperASingleTrack):
    """Parameters of the single-track car, nominal law, sliding mode and limits."""

    tracking_rate: float = parameter(
        10.0, "1/s", "Rate k of the nominal law", "chosen: 0.1 s, as sliding mode's", minimum=0.0
    )
    switching_gain: float = parameter(
        5.0,
        "rad/s2",
        "Largest perturbation rho",
        "chosen: above all that tyres give on a dry road, 4.4 rad/s2",
        minimum=0.0,
    )
    boundary_layer: float = parameter(
        0.05, "rad/s", "Half width Delta of the boundary layer", "chosen: twice rho times 5 ms", minimum=0.0
    )
    filter_time: float = parameter(
        0.02, "s", "Time constant tau of the filter", "chosen: below that of brakes and motors", minimum=0.0
    )
    scheduling_speed: float = like(LqrParameters, "scheduling_speed")
    moment_limit: float = like(LimitParameters, "moment_limit")
    fade_speed: float = like(LimitParameters, "fade_speed")


class IntegralSlidingMode(Component):
    """Integral sliding-mode yaw-moment controller of the yaw rate, after Goggia et al."""

    Parameters = IntegralSlidingModeParameters
    sampled = True
    inputs = (*SEEN[:6], signal("friction", start=1.0))
    outputs = (
        output("yaw_moment", *SEEN),
        output("sliding_surface", "yaw_rate", unit="rad/s", text="Sliding variable sigma"),
    )

    def configure(self) -> None:
        self.car = SingleTrackCar.of(self.p, self.p.yaw_inertia)

    def start(self, t: float, u: list[float]) -> None:
        self.model = u[2]  # z
        self.switched = self.perturbation = 0.0
        self.decide(u)

    def advance(self, t: float, h: float, u: list[float]) -> None:
        p = self.p
        self.model += h * (self.known + self.switched)
        self.switched = p.switching_gain * saturation(u[2] - self.model, p.boundary_layer)
        kept = exp(-h / p.filter_time) if p.filter_time > 0.0 else 0.0
        self.perturbation = self.switched + (self.perturbation - self.switched) * kept
        self.decide(u)

    def decide(self, u: list[float]) -> None:
        """Compute the moment, and the yaw acceleration that is known to follow from it."""
        p = self.p
        r_ref, dr_ref, r, beta, delta, speed, mu = u
        tyres = tyre_moment(self.car, beta, r, delta=delta, v=max(speed, p.scheduling_speed), mu=mu)
        wanted = p.yaw_inertia * (dr_ref + p.tracking_rate * (r_ref - r) - self.perturbation) - tyres
        self.moment = limit(wanted, p, speed)
        self.known = (tyres + self.moment) / p.yaw_inertia

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        return self.moment, u[2] - self.model
