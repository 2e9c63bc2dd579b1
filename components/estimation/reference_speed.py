"""Reference speed: v_x from the wheel speeds and the longitudinal accelerometer.

    dv_x/dt = a_x + r v_y                                                               (1)
    v_i     = (w_i R / (1 + kappa) - (v_y + x_i r) sin(delta_i)) / cos(delta_i) + y_i r,
              kappa = a_x / (c g)                                                       (2)
    v_x    <- v_x + gain mean(weight_i (v_i - v_x)),      weight_i = 1 / (1 + (d_i / s)^2)^2,
              d_i = v_i - v_x                                                           (3)

Between messages (1) is integrated. Each wheel gives a speed of the centre of mass by (2), where kappa is the
slip that a wheel needs for its share of a_x, with the slip stiffness over load c. The weight (3) of a wheel
decreases with its distance from the prediction, so that locking or spinning wheels are ignored and (1)
continues alone. While the car brakes, wheels slower than the prediction are distrusted sooner; while it
accelerates, faster wheels. At large sideslip no wheel rolls freely, and all weights are reduced.

Source: chosen, similar to U. Kiencke, L. Nielsen, Automotive Control Systems, 2nd edition, 2005, chapter on
vehicle parameters and states (weighted wheel speeds and integrated acceleration); ours weights by distance,
without fuzzy rules.
"""

from collections.abc import Sequence
from math import cos, sin

from yawbench.vocabulary.gravity import G

from ..mathematics.sums import added
from .estimator_parameters import EstimatorParameters

ROLLING = 0.3
"""v_y / v_x above which no wheel rolls freely; chosen: 17 degrees, beyond any tyre's peak."""
DOUBTED = 0.4
"""Factor of s in the direction of brake or drive slip; chosen: a wheel locks within about 0.1 s."""


def wheel_speeds_at_centre(
    spins: Sequence[float], *, r: float, v_y: float, delta: float, a_x: float, p: EstimatorParameters
) -> list[float]:
    """Return v_x [m/s] according to each of fl, fr, rl, rr; equation (2).

    Args:
        spins: angular velocities of the wheels [rad/s].
        r, v_y: yaw rate [rad/s] and lateral velocity [m/s] of the centre of mass.
        delta: steer angle of the front wheels [rad].
        a_x: longitudinal acceleration [m/s2].
    """
    rolling = p.wheel_radius / max(1.0 + a_x / (p.slip_stiffness_per_load * G), 0.5)
    half = 0.5 * p.track_width
    across = (v_y + p.cg_to_front_axle * r) * sin(delta)
    along = max(cos(delta), 0.1)
    w_fl, w_fr, w_rl, w_rr = spins
    return [
        (w_fl * rolling - across) / along + half * r,
        (w_fr * rolling - across) / along - half * r,
        w_rl * rolling + half * r,
        w_rr * rolling - half * r,
    ]


def believed(difference: float, doubt: float, a_x: float) -> float:
    """Return the weight of a wheel `difference` [m/s] from the prediction; equation (3)."""
    if difference * a_x > 0.0 and abs(a_x) > 1.0:
        doubt *= DOUBTED
    ratio = difference / doubt
    return 1.0 / (1.0 + ratio * ratio) ** 2


def shared(a_x: float, rate: float) -> float:
    """Return the common part of a_x and dv_x/dt [m/s2], which is due to driving or braking wheels.

    In a spin a_x is due to cornering tyres and dv_x/dt to rotating axes.
    """
    if a_x * rate <= 0.0:
        return 0.0
    return a_x if abs(a_x) < abs(rate) else rate


class ReferenceSpeed:
    """Reference speed v_x [m/s], initialized from the wheel speeds."""

    def __init__(self, spins: Sequence[float], p: EstimatorParameters) -> None:
        self.p = p
        self.v = added(spins) / 4.0 * p.wheel_radius
        self.rate = 0.0

    def see(
        self, spins: Sequence[float], h: float, *, r: float, v_y: float, delta: float, a_x: float
    ) -> None:
        """Advance v_x by `h` [s] to a new message; arguments as in `wheel_speeds_at_centre`."""
        p = self.p
        self.rate = a_x + r * v_y
        self.v += h * self.rate
        a_x = shared(a_x, self.rate)
        seen = wheel_speeds_at_centre(spins, r=r, v_y=v_y, delta=delta, a_x=a_x, p=p)
        differences = [v - self.v for v in seen]
        pull = added(d * believed(d, p.speed_doubt, a_x) for d in differences) / 4.0
        sideways = v_y / (ROLLING * max(self.v, 1.0))
        gain = p.speed_gain / (1.0 + sideways * sideways) ** 2
        self.v = max(self.v + min(gain * h, 1.0) * pull, 0.0)
