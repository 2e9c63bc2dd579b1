"""Feedforward with gain-scheduled PI control of the yaw rate, and a guard of the sideslip.

    M = k M_ff(delta, v, r_ref, mu) + PI(r_ref - r) + k_beta E(beta, beta_max)

M_ff is the moment that makes a turn of the yaw rate r_ref steady (`control_laws.saturating_axles`). It is
zero if the reference is what the car does by itself. The gains of the feedback are those that give the loop
of PI and linear single-track car, from M to r,

    G(s) = (s - a_11) / (I_z (s^2 + phi_1 s + phi_0)),       C(s) = K_p (1 + 1 / (T_i s)),

its crossover |C G| = 1 at the frequency w_c at every speed:

    K_p(v) = I_z |(phi_0 - w_c^2) + j phi_1 w_c| / (|j w_c - a_11| sqrt(1 + 1 / (w_c T_i)^2))

The integral never moves the moment beyond its limit (`mathematics.pid_loop`). E is the excess of the sideslip
over the bound of `control_laws.sideslip_bound`.

After L. De Novellis, A. Sorniotti, P. Gruber, A. Pennycott, Comparison of feedback control techniques for
torque-vectoring control of fully electric vehicles, IEEE Transactions on Vehicular Technology 63(8), 2014,
3612-3623, and L. De Novellis, A. Sorniotti, P. Gruber, J. Orus, J.-M. Rodriguez Fortun, J. Theunissen, J. De
Smet, Direct yaw moment control actuated through electric drivetrains and friction brakes, Mechatronics 26,
2015, 1-15. Of the first the abstract was at hand, of the second nothing: structure (feedforward, feedback of
the yaw rate with gains that depend on the speed, sideslip controller) is theirs, equations and values are
ours. Theirs has maps computed beforehand where ours solves the quasi-static model at every sample, and an
adaptive variant that ours lacks.
"""

from dataclasses import dataclass
from math import hypot, sqrt

from ..cars.published_cars import PaperASingleTrack
from ..cars.single_track_car import SingleTrackCar
from ..control_laws.linear_feedback import error_dynamics
from ..control_laws.moment_limit import LimitParameters, limit
from ..control_laws.phase_plane import beyond
from ..control_laws.saturating_axles import holding_moment
from ..control_laws.sideslip_bound import sideslip_bound
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter, signal
from ..mathematics.pid_loop import Gains, Pid
from .dead_band import DeadBandParameters
from .lqr import LqrParameters

SEEN = ("yaw_rate_ref", "yaw_rate", "sideslip", "velocity_x", "friction", "steer_angle")


@dataclass(frozen=True)
class FeedforwardPiParameters(PaperASingleTrack):
    """Parameters of the single-track car, shares and gains of the three parts, and limits."""

    feedforward_share: float = parameter(
        1.0, "1", "Share k of the feedforward moment", "De Novellis et al. 2014: all of it", minimum=0.0
    )
    crossover_frequency: float = parameter(
        10.0,
        "rad/s",
        "Crossover w_c of the loop of the yaw rate",
        "chosen: brakes of 50 ms lose 27 degrees of phase there",
        minimum=0.01,
    )
    integral_time: float = parameter(
        0.5, "s", "Integral time T_i", "chosen: costs 11 degrees of phase at the crossover", minimum=0.001
    )
    sideslip_gain: float = like(DeadBandParameters, "sideslip_gain")
    scheduling_speed: float = like(LqrParameters, "scheduling_speed")
    moment_limit: float = like(LimitParameters, "moment_limit")
    fade_speed: float = like(LimitParameters, "fade_speed")


def gains_for_crossover(car: SingleTrackCar, v: float, w_c: float, t_i: float) -> Gains:
    """Return the gains of the PI loop that crosses over at `w_c`.

    Args:
        car: the single-track car.
        v: speed > 0 [m/s].
        w_c: crossover frequency > 0 [rad/s].
        t_i: integral time > 0 [s].
    """
    (a_11, a_12), (a_21, a_22) = error_dynamics(car, v)
    phi_0, phi_1 = a_11 * a_22 - a_12 * a_21, -(a_11 + a_22)
    plant = hypot(w_c, a_11) / hypot(phi_0 - w_c * w_c, phi_1 * w_c)
    k_p = car.i_z / (plant * sqrt(1.0 + 1.0 / (w_c * t_i) ** 2))
    return Gains(k_p, k_p / t_i, 0.0)


class FeedforwardPi(Component):
    """Feedforward with gain-scheduled PI control of the yaw rate, after De Novellis et al."""

    Parameters = FeedforwardPiParameters
    sampled = True
    inputs = (*SEEN[:4], signal("friction", start=1.0), "steer_angle")
    outputs = (output("yaw_moment", *SEEN),)

    def configure(self) -> None:
        self.car = SingleTrackCar.of(self.p, self.p.yaw_inertia)

    def start(self, t: float, u: list[float]) -> None:
        self.loop = Pid(0.0, u[0] - u[1])
        self.decide(u)

    def advance(self, t: float, h: float, u: list[float]) -> None:
        self.loop.see(u[0] - u[1], h)
        self.decide(u)

    def decide(self, u: list[float]) -> None:
        """Compute the moment from the current state of the loop."""
        p = self.p
        r_ref, _, beta, speed, mu, delta = u
        v = max(speed, p.scheduling_speed)
        gains = gains_for_crossover(self.car, v, p.crossover_frequency, p.integral_time)
        moment = p.feedforward_share * holding_moment(self.car, r_ref, delta=delta, v=v, mu=mu)
        moment += self.loop.value(gains) + p.sideslip_gain * beyond(beta, sideslip_bound(mu))
        self.moment = moment + self.loop.integrate(gains, moment, -p.moment_limit, p.moment_limit)

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        return (limit(self.moment, self.p, u[3]),)
