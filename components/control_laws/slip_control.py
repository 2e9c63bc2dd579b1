"""Sliding-mode slip control of a wheel: torque for the slip at which the tyre gives a requested force.

The slip target is the slip of the requested force on the stable branch of the tyre's own curve F_x(kappa) at
the current load, slip angle and friction, limited to a share of the optimum and to an absolute cap
(`tyre_models.slip_curve`). With s = kappa_target - kappa and the desired slip rate

    dkappa = eps sat(s / Delta) + k_d s

the wheel's equation of motion, solved for the torque, gives (v wheel velocity, q = 1 - kappa)

    braking, kappa = (R w - v) / v:         T = R F_x + J v / R       ((1 + kappa) / v dv + dkappa)
    driving, kappa = (R w - v) / (R w):     T = R F_x + J v / (R q^2) (q / v dv + dkappa)

with F_x from the same curve at the actual slip, and dv the filtered difference of the wheel's velocity.

Choices that the paper leaves open: the rate of the target is omitted, since it would pass every jump of the
request on to the torque. For requests below `slip_control_force` the torque is R F, so that without a request
the wheel rolls freely; below `slip_control_speed`, where slip is meaningless, it is R F with F the force at
the slip target; both transitions are linear. While braking, the torque is at most what stops the wheel within
a sample. In reverse only positive torque is used, and only to brake, since plants treat negative torque as
friction.

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
    """Parameters of wheel, law and limits; the gains are those found for paper B."""

    wheel_radius: float = like(PaperB, "wheel_radius")
    wheel_inertia: float = like(PaperB, "wheel_inertia")
    optimum_share: float = parameter(
        0.95, "1", "Largest slip as a share of the optimum", "paper B", minimum=0.1, maximum=0.99
    )
    slip_cap: float = parameter(
        0.25,
        "1",
        "Largest slip",
        "chosen: with 0.15 paper B's sliding car is not caught again; beyond the limit of grip slip stays"
        " below 0.06 straight ahead, and reaches this cap in a turn at friction 0.3",
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
        "chosen: with 30 slip lags behind the yaw-moment control",
        minimum=0.0,
    )
    acceleration_filter: float = parameter(
        0.02, "s", "Time constant of the wheel's acceleration dv", "chosen: an ABS sensor's", minimum=0.0
    )
    slip_control_force: float = parameter(
        50.0,
        "N",
        "Request below which torque is direct; slip control fades in up to twice that",
        "chosen: 1 % of load",
        minimum=0.1,
    )
    slip_control_speed: float = parameter(
        3.0,
        "m/s",
        "Wheel velocity from which slip control is fully active; below a third of it, off",
        "chosen: walking pace",
        minimum=0.1,
    )
    drive_torque_limit: float = parameter(
        800.0, "N.m", "Largest driving torque", "chosen: the motor of paper B's runs", minimum=0.0
    )
    brake_torque_limit: float = parameter(
        3300.0,
        "N.m",
        "Largest braking torque, motor and friction brake together",
        "chosen: those of paper B's runs",
        minimum=0.0,
    )


def slip_torque(
    kappa: float, target: float, f_x: float, *, v: float, dv: float, p: SlipControlParameters
) -> float:
    """Return the torque [N.m] that drives the slip to its target; equation (37).

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
    """Return the torque request [N.m] and the slip target [1] of a wheel.

    Args:
        request: requested longitudinal tyre force [N].
        kappa: longitudinal slip [1].
        curve: slip curve of the tyre at the current slip angle, load and friction.
        w, v, dv: angular velocity [rad/s], longitudinal velocity [m/s] and its rate [m/s2] of the wheel.
        sample_time: time for which the torque is held [s].
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
