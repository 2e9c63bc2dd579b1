"""H-infinity control of sideslip and yaw rate by front steering and yaw moment, scheduled by the phase plane.

    (delta_a, M) = ((1 - rho) K_0 + rho K_1) (e_beta, e_r, x),      dx/dt = e_r - x / T_x
    rho = (|beta + T dbeta/dt| / beta_s - rho_0) / (1 - rho_0), within 0 .. 1      `control_laws.phase_plane`

with the errors e_beta = beta - beta_ref, e_r = r - r_ref. K_0 hardly brakes, so steering alone follows the
yaw rate where the car is stable; with K_1 brakes and steering hold it at the limit. One Lyapunov function
serves both, so the gain from disturbances to weighted errors and inputs stays below gamma for any course of
rho in time, at 15, 25 and 35 m/s, of the linear single-track car that the gains belong to.
`docs/generate/gain_scheduled.py` computes the defaults (gamma = 6.99), for the large saloon `hard`.

Source: C. Poussot-Vassal, O. Sename, L. Dugard, S. M. Savaresi, Vehicle dynamic stability improvements
through gain-scheduled steering and braking control, Vehicle System Dynamics 49(10), 2011, 1597-1621 (not
read); M. Doumiati et al., Integrated vehicle dynamics control via coordination of active front steering and
rear braking, European Journal of Control 19(2), 2013, 121-143, and its forerunner at the IFAC World Congress
2011 (abstracts were read): steering first, brakes scheduled by the plane of sideslip and its rate, polytopic
controller from linear matrix inequalities. The inequality: S. Boyd, L. El Ghaoui, E. Feron, V. Balakrishnan,
Linear Matrix Inequalities in System and Control Theory, 1994, section 7.3. Ours differs: feedback of the
errors in place of a dynamic controller of the yaw rate alone, static weights of inputs in place of filters,
weights of our own, brakes of the whole car.
"""

from dataclasses import dataclass

from ..control_laws.moment_limit import LimitParameters, limit
from ..control_laws.phase_plane import PhasePlaneParameters
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter, signal
from .pid import SEEN as ERRORS
from .steering_and_braking import SteeringAndBrakingParameters

SYNTHESIZED = "computed by docs/generate/gain_scheduled.py"
LARGEST_TURNED = 0.2
"""Bound of the integral x [rad]. Chosen: twice the reference's largest sideslip."""


@dataclass(frozen=True)
class GainScheduledParameters:
    """Gains at both ends, schedule and limits."""

    steer_sideslip_gain_stable: float = parameter(-0.07303, "1", "K_0, sideslip to steering", SYNTHESIZED)
    steer_yaw_rate_gain_stable: float = parameter(-0.2964, "s", "K_0, yaw rate to steering", SYNTHESIZED)
    steer_integral_gain_stable: float = parameter(-0.4263, "1", "K_0, integral to steering", SYNTHESIZED)
    moment_sideslip_gain_stable: float = parameter(5.805, "N.m/rad", "K_0, sideslip to moment", SYNTHESIZED)
    moment_yaw_rate_gain_stable: float = parameter(-21.1, "N.m.s/rad", "K_0, yaw rate to moment", SYNTHESIZED)
    moment_integral_gain_stable: float = parameter(-24.46, "N.m/rad", "K_0, integral to moment", SYNTHESIZED)
    steer_sideslip_gain_limit: float = parameter(-0.1267, "1", "K_1, sideslip to steering", SYNTHESIZED)
    steer_yaw_rate_gain_limit: float = parameter(-0.09828, "s", "K_1, yaw rate to steering", SYNTHESIZED)
    steer_integral_gain_limit: float = parameter(-0.1981, "1", "K_1, integral to steering", SYNTHESIZED)
    moment_sideslip_gain_limit: float = parameter(20270.0, "N.m/rad", "K_1, sideslip to moment", SYNTHESIZED)
    moment_yaw_rate_gain_limit: float = parameter(
        -64050.0, "N.m.s/rad", "K_1, yaw rate to moment", SYNTHESIZED
    )
    moment_integral_gain_limit: float = parameter(-78930.0, "N.m/rad", "K_1, integral to moment", SYNTHESIZED)
    steering_scale: float = parameter(
        1.0, "1", "Factor of the steering's gains", "the synthesized ones", minimum=0.0
    )
    moment_scale: float = parameter(
        1.0, "1", "Factor of the moment's gains", "the synthesized ones", minimum=0.0
    )
    integral_decay_time: float = parameter(
        1.0, "s", "Time constant T_x of the integral", "that of the synthesis", minimum=1e-3
    )
    boundary: float = like(PhasePlaneParameters, "boundary")
    lead_time: float = like(PhasePlaneParameters, "lead_time")
    schedule_begin: float = parameter(
        0.5,
        "1",
        "Share rho_0 of the strip from which brakes come in",
        "chosen: half",
        minimum=0.0,
        maximum=0.99,
    )
    added_angle_limit: float = like(SteeringAndBrakingParameters, "added_angle_limit")
    moment_limit: float = like(LimitParameters, "moment_limit")
    fade_speed: float = like(LimitParameters, "fade_speed")


def schedule(beta: float, rate: float, mu: float, p: GainScheduledParameters) -> float:
    """Return rho [1], 0 where the car is stable and 1 at the edge of the stable strip and beyond."""
    edge = p.boundary * min(max(mu, 1e-3), 1.0)
    part = abs(beta + p.lead_time * rate) / edge
    return min(max((part - p.schedule_begin) / (1.0 - p.schedule_begin), 0.0), 1.0)


SEEN = (*ERRORS, "sideslip_rate", "velocity_x", "friction")


class GainScheduled(Component):
    """H-infinity controller of steering and yaw moment, scheduled by the phase plane of the sideslip."""

    Parameters = GainScheduledParameters
    sampled = True
    inputs = (*ERRORS, "sideslip_rate", "velocity_x", signal("friction", start=1.0))
    outputs = (
        output("yaw_moment", *SEEN),
        output("added_steer_angle_request", *SEEN),
        output(
            "scheduling", "sideslip", "sideslip_rate", "friction", unit="1", text="Scheduling variable rho"
        ),
    )

    def start(self, t: float, u: list[float]) -> None:
        self.turned = 0.0

    def advance(self, t: float, h: float, u: list[float]) -> None:
        x = self.turned + h * (u[1] - u[0] - self.turned / self.p.integral_decay_time)
        self.turned = min(max(x, -LARGEST_TURNED), LARGEST_TURNED)

    def output(self, t: float, u: list[float]) -> tuple[float, ...]:
        p, x = self.p, self.turned
        r_ref, r, beta_ref, beta, rate, speed, mu = u
        e_beta, e_r = beta - beta_ref, r - r_ref
        rho = schedule(beta, rate, mu, p)
        calm = 1.0 - rho
        added = calm * (
            p.steer_sideslip_gain_stable * e_beta
            + p.steer_yaw_rate_gain_stable * e_r
            + p.steer_integral_gain_stable * x
        ) + rho * (
            p.steer_sideslip_gain_limit * e_beta
            + p.steer_yaw_rate_gain_limit * e_r
            + p.steer_integral_gain_limit * x
        )
        moment = calm * (
            p.moment_sideslip_gain_stable * e_beta
            + p.moment_yaw_rate_gain_stable * e_r
            + p.moment_integral_gain_stable * x
        ) + rho * (
            p.moment_sideslip_gain_limit * e_beta
            + p.moment_yaw_rate_gain_limit * e_r
            + p.moment_integral_gain_limit * x
        )
        added *= p.steering_scale * min(max(speed, 0.0) / p.fade_speed, 1.0)
        added = min(max(added, -p.added_angle_limit), p.added_angle_limit)
        return limit(p.moment_scale * moment, p, speed), added, rho
