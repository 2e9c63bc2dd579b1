"""Coordinated active front steering and yaw moment: steering follows the yaw rate, brakes hold stability.

    delta_a = lambda I_z / (a C_f) (r_ref - r),      |beta + a r / v - delta - delta_a| <= mu alpha_max
    M       = k_s E(beta + T dbeta/dt)

lambda is the bandwidth of the yaw rate: a C_f / I_z is the yaw acceleration per steer angle of the linear
single-track car. Steering acts everywhere, brakes only outside of `brake_share` of the stable strip
(`control_laws.phase_plane`), so that ordinary driving does not slow the car. Front tyres beyond the slip
angle of their largest force give no more: no angle is added there. Below walking pace both fade out.

Source: M. Doumiati, O. Sename, J. Martinez, L. Dugard, P. Gaspar, Z. Szabo, J. Bokor, Vehicle yaw control via
coordinated use of steering/braking systems, IFAC World Congress 2011 (abstract and introduction were read):
steering alone for steerability, both at the limits, judged in the plane of sideslip and its rate. J. He et
al., 2006 (`control_laws.phase_plane`), and M. Nagai, Y. Hirano, S. Yamanaka, Integrated control of active
rear wheel steering and direct yaw moment control, Vehicle System Dynamics 27, 1997, 357-370, of which the
abstract was read (model matching by feedback of yaw rate and sideslip), coordinate steering and moment
likewise. Ours differs: of model matching the proportional term alone, since the terms that cancel the linear
car's dynamics are wrong for sliding tyres; the limit of the front slip angle; front steering where Nagai et
al. steer the rear axle.
"""

from dataclasses import dataclass

from ..cars.published_cars import PaperA
from ..control_laws.moment_limit import LimitParameters, limit
from ..control_laws.phase_plane import PhasePlaneParameters, excess
from ..fmi.component import Component
from ..fmi.variables import like, output, parameter, signal
from ..references.steady_state import SteadyStateParameters
from .phase_plane import SEEN, PhasePlaneControllerParameters


@dataclass(frozen=True)
class SteeringAndBrakingParameters:
    """Parameters of car, steering, strip and limits."""

    yaw_inertia: float = like(PaperA, "yaw_inertia")
    cg_to_front_axle: float = like(PaperA, "cg_to_front_axle")
    cornering_stiffness_front: float = like(SteadyStateParameters, "cornering_stiffness_front")
    bandwidth: float = parameter(
        5.0, "1/s", "Bandwidth lambda of the yaw rate", "chosen: about the car's own", minimum=0.0
    )
    added_angle_limit: float = parameter(
        0.07,
        "rad",
        "Largest requested angle",
        "chosen: the range of steering_actuator_superposition",
        minimum=0.0,
    )
    front_slip_limit: float = parameter(
        0.14,
        "rad",
        "Front slip angle alpha_max of the largest force, friction 1",
        "chosen: 8 degrees",
        minimum=0.01,
    )
    boundary: float = like(PhasePlaneParameters, "boundary")
    lead_time: float = like(PhasePlaneParameters, "lead_time")
    brake_share: float = parameter(
        0.8, "1", "Share of the strip from which brakes act", "chosen: a margin for slow brakes", minimum=0.0
    )
    spin_gain: float = like(PhasePlaneControllerParameters, "spin_gain")
    moment_limit: float = like(LimitParameters, "moment_limit")
    fade_speed: float = like(LimitParameters, "fade_speed")


def within_grip(added: float, delta: float, slip: float, most: float) -> float:
    """Return the part of an added angle that does not take the front tyres beyond their largest force.

    Args:
        added, delta: angle to be added, angle of the driver [rad].
        slip: beta + a r / v, the slip angle of unsteered front wheels [rad].
        most: slip angle of the largest force [rad].
    """
    steered = slip - delta
    if added > 0.0:
        return min(added, max(steered + most, 0.0))
    return max(added, min(steered - most, 0.0))


class SteeringAndBraking(Component):
    """Coordinated active front steering and yaw-moment control, by the phase plane of the sideslip."""

    Parameters = SteeringAndBrakingParameters
    sampled = True
    inputs = (*SEEN, signal("friction", start=1.0), "steer_angle")
    outputs = (
        output("yaw_moment", "sideslip", "sideslip_rate", "velocity_x", "friction"),
        output(
            "added_steer_angle_request",
            "yaw_rate_ref",
            "yaw_rate",
            "sideslip",
            "velocity_x",
            "friction",
            "steer_angle",
        ),
    )

    def output(self, t: float, u: list[float]) -> tuple[float, ...]:
        p = self.p
        r_ref, r, beta, rate, speed, mu, delta = u
        moment = p.spin_gain * excess(beta, rate, mu, p, p.brake_share)
        per_error = p.bandwidth * p.yaw_inertia / (p.cg_to_front_axle * p.cornering_stiffness_front)
        added = min(max(per_error * (r_ref - r), -p.added_angle_limit), p.added_angle_limit)
        if speed < p.fade_speed:
            added *= max(speed, 0.0) / p.fade_speed
        slip = beta + p.cg_to_front_axle * r / max(speed, p.fade_speed)
        return limit(moment, p, speed), within_grip(
            added, delta, slip, p.front_slip_limit * min(max(mu, 0.0), 1.0)
        )
