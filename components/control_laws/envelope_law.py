"""Model-predictive control that leaves the driver alone in an envelope of yaw rate and rear slip angle.

    |r| <= mu g / v,      |beta - b r / v| <= alpha_s          alpha_s: the rear axle slides (`brush_axle`)

The motion is predicted with the driver's steer angle held and the tyre forces linearized at the current slip
angles,

    m v (dbeta/dt + r) = F_f + F_r,      I_z dr/dt = a F_f - b F_r + M

The input z, in units of u_0, takes a few values, each held for several prediction steps: with `steering` it
is added to the front side force of the driver's angle, which stays within the axle's grip; else it is the
moment M. It minimizes

    sum of z^2  +  penalty (excess over the envelope / its size)^2       at the end of each value

so that it is zero if the driver's own steering stays inside. The bounds of z are hard, those of the motion
soft: no input may suffice.
"""

from collections.abc import Sequence

from yawbench.vocabulary.gravity import G

from ..cars.single_track_car import SingleTrackCar
from ..mathematics.quadratic_program import Rows, multipliers
from ..mathematics.sums import added, dot
from .brush_axle import BrushAxle
from .predictive_law import discrete


def axles_of(car: SingleTrackCar, mu: float) -> tuple[BrushAxle, BrushAxle]:
    """Return front and rear axle under their static loads at friction `mu` > 0."""
    weight = car.m * G / (car.a + car.b)
    return BrushAxle(car.c_f, mu * weight * car.b), BrushAxle(car.c_r, mu * weight * car.a)


class Envelope:
    """The quadratic program at one state, built anew for each sample.

    Args:
        car: single-track car.
        axles: front and rear axle.
        v, mu: speed [m/s] and friction [1], positive.
        beta, r, delta: sideslip angle [rad], yaw rate [rad/s] and the driver's steer angle [rad].
        steering: the input is a front side force, else a yaw moment.
    """

    def __init__(
        self,
        car: SingleTrackCar,
        axles: tuple[BrushAxle, BrushAxle],
        *,
        v: float,
        mu: float,
        beta: float,
        r: float,
        delta: float,
        steering: bool,
    ) -> None:
        front, rear = axles
        inertia = car.m * v
        alpha_f, alpha_r = beta + car.a * r / v - delta, beta - car.b * r / v
        c_f = 0.0 if steering else front.slope(alpha_f)
        c_r = rear.slope(alpha_r)
        f_f = front.force(alpha_f) + c_f * (alpha_f + delta)  # at the origin of the state
        f_r = rear.force(alpha_r) + c_r * alpha_r
        turn = (car.b * c_r - car.a * c_f) / v
        self.dynamics = (
            (-(c_f + c_r) / inertia, turn / inertia - 1.0),
            (
                (car.b * c_r - car.a * c_f) / car.i_z,
                -(car.a * car.a * c_f + car.b * car.b * c_r) / (v * car.i_z),
            ),
        )
        self.drift = (f_f + f_r) / inertia, (car.a * f_f - car.b * f_r) / car.i_z
        self.push = (1.0 / inertia, car.a / car.i_z) if steering else (0.0, 1.0 / car.i_z)
        self.state = beta, r
        self.rows = (0.0, 1.0), (1.0, -car.b / v)
        self.bounds = mu * G / v, rear.sliding()

    def first(
        self,
        *,
        unit: float,
        low: float,
        high: float,
        penalty: float,
        step: float,
        moves: int,
        steps_per_move: int,
    ) -> float:
        """Return the first value of the input, in its unit.

        Args:
            unit: u_0, input of cost 1.
            low, high: bounds of the input.
            penalty: weight of the excess [1].
            step: prediction step [s].
            moves, steps_per_move: values of the input, and steps for which each is held.
        """
        (a_11, a_12), (a_21, a_22) = self.dynamics
        phi, by_second = discrete(self.dynamics, 1.0, step)
        _, turned = discrete(((a_22, a_21), (a_12, a_11)), 1.0, step)
        by_first = turned[1], turned[0]
        (p_11, p_12), (p_21, p_22) = phi
        d_1 = by_first[0] * self.drift[0] + by_second[0] * self.drift[1]
        d_2 = by_first[1] * self.drift[0] + by_second[1] * self.drift[1]
        g_1 = unit * (by_first[0] * self.push[0] + by_second[0] * self.push[1])
        g_2 = unit * (by_first[1] * self.push[0] + by_second[1] * self.push[1])
        beta, r = self.state
        forced = [(0.0, 0.0) for _ in range(moves)]
        rows: Rows = []
        room: list[float] = []
        soft: list[float] = []
        for move in range(moves):
            for _ in range(steps_per_move):
                beta, r = p_11 * beta + p_12 * r + d_1, p_21 * beta + p_22 * r + d_2
                forced = [(p_11 * x + p_12 * y, p_21 * x + p_22 * y) for x, y in forced]
                forced[move] = forced[move][0] + g_1, forced[move][1] + g_2
            for (c_1, c_2), bound in zip(self.rows, self.bounds, strict=True):
                line = [(c_1 * x + c_2 * y) / bound for x, y in forced]
                now = (c_1 * beta + c_2 * r) / bound
                rows += [line, [-value for value in line]]
                room += [1.0 - now, 1.0 + now]
                soft += [1.0 / penalty, 1.0 / penalty]
        for move in range(moves):
            one = [1.0 if move == i else 0.0 for i in range(moves)]
            rows += [one, [-value for value in one]]
            room += [high / unit, -low / unit]
            soft += [0.0, 0.0]
        return unit * _first(rows, room, soft)


def _first(rows: Sequence[Sequence[float]], room: Sequence[float], soft: Sequence[float]) -> float:
    """Return the first element of the shortest z with `rows` z <= `room`, softly where `soft` is not 0."""
    p = [[dot(one, other) for other in rows] for one in rows]
    for i, extra in enumerate(soft):
        p[i][i] += extra
    return -added(y * row[0] for y, row in zip(multipliers(p, room), rows, strict=True))
