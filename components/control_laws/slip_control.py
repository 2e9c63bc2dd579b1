"""Sliding-mode slip control of one wheel: the torque that holds the slip which gives a requested force.

The slip target is the requested force on the stable branch of the tyre's own curve F_x(kappa) at the
present load, slip angle and friction, limited to a share of the optimum and to an absolute cap
(`tyre_models.slip_curve`). With s = kappa_target - kappa and the slip rate asked for

    dkappa = eps sat(s / Delta) + k_d s

the wheel's equation of motion, solved for the torque, gives (v wheel velocity, q = 1 - kappa)

    braking, kappa = (R w - v) / v:         T = R F_x + J v / R       ((1 + kappa) / v dv + dkappa)
    driving, kappa = (R w - v) / (R w):     T = R F_x + J v / (R q^2) (q / v dv + dkappa)

with F_x from the same curve at the slip that is, dv the filtered difference of the wheel's velocity.

What the paper leaves open, and what is done. The target's own rate is left out: it would hand every
jump of the request to the torque. Below `slip_control_force` the wheel gets R F, so without a request
it rolls free; below `slip_control_speed`, where slip loses its meaning, R F with F the force at the
slip target; both fade in linearly. While braking, the torque is never more than stops the wheel
within one sample. In reverse only positive torque is used, only to brake: negative torque is
friction to every plant.

Source: paper B, equations (31)-(38). Ours differs: sat for the sign in (36), which would chatter at every
sample; the cap (with combined slip the optimum grows with slip angle, at mu 0.3 from 0.05 at 0 to 0.9 at 15
degrees, and then protects nothing); the fades.
"""

from dataclasses import dataclass

from ..cars.published_cars import PaperB
from ..fmi.variables import like, parameter
from ..tyre_models.slip_curve import slip_for_force
from ..tyre_models.tyre import Curve


@dataclass(frozen=True)
class SlipControlParameters:
    """Parameters of the wheel, the law and the limits; the gains are those tried for paper B."""

    wheel_radius: float = like(PaperB, "wheel_radius")
    wheel_inertia: float = like(PaperB, "wheel_inertia")
    optimum_share: float = parameter(
        0.95, "1", "Largest slip over the optimum", "paper B", minimum=0.1, maximum=0.99
    )
    slip_cap: float = parameter(
        0.25,
        "1",
        "Largest slip",
        "chosen: at 0.15, tried first, paper B's sliding car is not caught again; beyond the grip slip stays"
        " below 0.06 straight on, in a turn on friction 0.3 it comes to this cap",
        minimum=0.001,
        maximum=0.99,
    )
    boundary_layer: float = parameter(
        0.02, "1", "Boundary layer Delta of the slip error", "chosen: calm at 1 to 5 ms", minimum=1e-4
    )
    switching_gain: float = parameter(
        1.0, "1/s", "Gain eps of the saturated slip error", "chosen: calm at 1 to 5 ms", minimum=0.0
    )
    slip_gain: float = parameter(
        60.0,
        "1/s",
        "Gain k_d of the slip error",
        "chosen: 30, tried first, lets slip lag behind the yaw-moment control",
        minimum=0.0,
    )
    acceleration_filter: float = parameter(
        0.02, "s", "Time constant of the wheel's acceleration dv", "chosen: an ABS sensor's", minimum=0.0
    )
    slip_control_force: float = parameter(
        50.0,
        "N",
        "Request below which torque is direct, fading until twice that",
        "chosen: 1 % of load",
        minimum=0.1,
    )
    slip_control_speed: float = parameter(
        3.0,
        "m/s",
        "Wheel velocity above which slip is controlled fully, below a third of it not",
        "chosen: walking pace",
        minimum=0.1,
    )
    drive_torque_limit: float = parameter(
        800.0, "N.m", "Largest driving torque", "chosen: the motor tried for paper B", minimum=0.0
    )
    brake_torque_limit: float = parameter(
        3300.0,
        "N.m",
        "Largest braking torque, motor and friction brake together",
        "chosen: those tried for paper B",
        minimum=0.0,
    )


def slip_torque(
    kappa: float, target: float, f_x: float, *, v: float, dv: float, p: SlipControlParameters
) -> float:
    """Return the torque [N.m] that moves the slip towards its target; equation (37).

    Args:
        kappa, target: slip and slip target [1].
        f_x: tyre force at `kappa` [N].
        v, dv: longitudinal velocity of the wheel [m/s] and its rate [m/s2].
    """
    s = target - kappa
    layer = p.boundary_layer
    speed = abs(v)
    rate = p.switching_gain * max(-1.0, min(1.0, s / layer)) + p.slip_gain * s
    ahead = kappa if v >= 0.0 else -kappa
    if ahead > 0.0:
        q = max(1.0 - ahead, 0.05)
        spin_up = (speed * rate + q * dv) / (q * q)
    else:
        spin_up = speed * rate + max(1.0 + ahead, 0.0) * dv
    return p.wheel_radius * f_x + p.wheel_inertia / p.wheel_radius * spin_up


def wheel_torque(
    request: float,
    kappa: float,
    curve: Curve,
    *,
    w: float,
    v: float,
    dv: float,
    sample_time: float,
    p: SlipControlParameters,
) -> tuple[float, float]:
    """Return the torque request [N.m] and the slip target [1] of one wheel.

    Args:
        request: longitudinal tyre force wanted [N].
        kappa: longitudinal slip [1].
        curve: the tyre's, at present slip angle, load and friction.
        w, v, dv: angular velocity [rad/s], longitudinal velocity [m/s] and its rate [m/s2] of the wheel.
        sample_time: how long the torque will be held [s].
    """
    force, first = curve
    target = slip_for_force(request, force, first=first, cap=p.slip_cap, share=p.optimum_share)
    radius = p.wheel_radius
    f_x = force(kappa)
    torque = radius * force(target)
    controlled = min(
        1.5 * abs(v) / p.slip_control_speed - 0.5, abs(request) / p.slip_control_force - 1.0, 1.0
    )
    if controlled > 0.0:
        torque += controlled * (slip_torque(kappa, target, f_x, v=v, dv=dv, p=p) - torque)
    stop = p.wheel_inertia / sample_time
    if v >= 0.0:
        torque = max(torque, min(radius * f_x - stop * max(w, 0.0), 0.0), -p.brake_torque_limit)
    else:
        torque = max(min(torque, radius * f_x - stop * min(w, 0.0)), 0.0) if request > 0.0 else 0.0
    return min(torque, p.drive_torque_limit), target
