"""Reference speed: v_x from the wheel speeds and the longitudinal accelerometer.

    dv_x/dt = a_x + r v_y                                                               (1)
    v_i     = (w_i R / (1 + kappa) - (v_y + x_i r) sin(delta_i)) / cos(delta_i) + y_i r,
              kappa = a_x / (c g)                                                       (2)
    v_x    <- v_x + gain mean(weight_i (v_i - v_x)),      weight_i = 1 / (1 + (d_i / s)^2)^2,
              d_i = v_i - v_x                                                           (3)

Between messages (1) is integrated; each wheel gives a speed of the centre of mass by (2), where kappa is the
slip that a wheel needs for its share of a_x, with the slip stiffness over load c. A wheel counts the less the
further it is from the prediction, (3), so wheels that lock or spin lose their say and (1) goes on alone.
While the car brakes, wheels slower than the prediction are doubted sooner, while it accelerates, faster
ones. At large sideslip no wheel rolls freely, and all count less.

Source: chosen, in the manner of U. Kiencke, L. Nielsen, Automotive Control Systems, 2nd edition, 2005,
chapter on vehicle parameters and states (weighted wheel speeds and integrated acceleration); ours weighs by
distance, without fuzzy rules.
"""

from collections.abc import Sequence
from math import cos, sin

from vocabulary.gravity import G

from ..mathematics.sums import added
from .estimator_parameters import EstimatorParameters

ROLLING = 0.3
"""v_y / v_x from which on no wheel rolls freely any more; chosen: 17 degrees, beyond any tyre's peak."""
DOUBTED = 0.4
"""Share of s on the side to which a braked or driven wheel slips; chosen: a wheel locks within some 0.1 s."""


def wheel_speeds_at_centre(
    spins: Sequence[float], *, r: float, v_y: float, delta: float, a_x: float, p: EstimatorParameters
) -> list[float]:
    """Return v_x [m/s] as each of fl, fr, rl, rr has it; equation (2).

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
    """Return what a_x and dv_x/dt [m/s2] have in common: what the wheels drive or brake.

    In a spin the one is of cornering tyres and the other of turning axes.
    """
    if a_x * rate <= 0.0:
        return 0.0
    return a_x if abs(a_x) < abs(rate) else rate


class ReferenceSpeed:
    """v_x [m/s], begun from the wheels."""

    def __init__(self, spins: Sequence[float], p: EstimatorParameters) -> None:
        self.p = p
        self.v = added(spins) / 4.0 * p.wheel_radius
        self.rate = 0.0

    def see(
        self, spins: Sequence[float], h: float, *, r: float, v_y: float, delta: float, a_x: float
    ) -> None:
        """Take v_x over `h` [s] to a new message; arguments as of `wheel_speeds_at_centre`."""
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
