"""Model-predictive control of sideslip and yaw rate for the linear single-track car, at a fixed speed.

The errors e = (beta - beta_ref, r - r_ref) obey de/dt = A e + B M (`linear_feedback`). Over the horizon the
references are constant and the moment takes a few values, each held for several prediction steps. These
values z minimize

    sum over the steps of (e_beta / beta_0)^2 + (e_r / r_0)^2 + (M / M_0)^2

subject to |M| <= limit. The bound of |beta| at the end of each value is a soft constraint, since no moment
may suffice to hold it: `penalty` times the square of (excess / beta_0) is added to the cost.
"""

from dataclasses import dataclass

from ..mathematics.quadratic_program import Rows, inverse, multipliers
from ..mathematics.sums import added, dot
from .linear_feedback import Matrix

_ORDER = 14
"""Order of the series of the matrix exponential, exact to rounding for |A h| <= 1."""


def discrete(a: Matrix, b: float, h: float) -> tuple[Matrix, tuple[float, float]]:
    """Return the transition matrix over `h` [s] and the response to a held unit input on the second state."""
    (a_11, a_12), (a_21, a_22) = a
    doublings = 0
    while h * max(abs(a_11) + abs(a_12), abs(a_21) + abs(a_22)) > 1.0:  # the series would converge slowly
        h *= 0.5
        doublings += 1
    p_11, p_12, p_21, p_22 = 1.0, 0.0, 0.0, 1.0
    t_11, t_12, t_21, t_22 = 1.0, 0.0, 0.0, 1.0  # (A h)^k / k!
    g_1, g_2 = 0.0, h * b
    for k in range(1, _ORDER):
        f = h / k
        t_11, t_12, t_21, t_22 = (
            f * (a_11 * t_11 + a_12 * t_21),
            f * (a_11 * t_12 + a_12 * t_22),
            f * (a_21 * t_11 + a_22 * t_21),
            f * (a_21 * t_12 + a_22 * t_22),
        )
        p_11, p_12, p_21, p_22 = p_11 + t_11, p_12 + t_12, p_21 + t_21, p_22 + t_22
        g_1 += t_12 * h / (k + 1) * b
        g_2 += t_22 * h / (k + 1) * b
    for _ in range(doublings):
        half = (p_11, p_12), (p_21, p_22)
        more_1, more_2 = _stepped(half, (g_1, g_2))
        g_1, g_2 = g_1 + more_1, g_2 + more_2
        (p_11, p_21), (p_12, p_22) = _stepped(half, (p_11, p_21)), _stepped(half, (p_12, p_22))
    return ((p_11, p_12), (p_21, p_22)), (g_1, g_2)


@dataclass(frozen=True)
class CostWeights:
    """Weights of the cost, and the time step of the horizon."""

    beta_0: float  # [rad]
    r_0: float  # [rad/s]
    moment_0: float  # [N.m]
    penalty: float  # of the squared excess over the bound, relative to beta_0
    step: float  # of the prediction [s]
    moves: int  # values of the moment
    steps_per_move: int


class PredictiveLaw:
    """Quadratic program at a fixed speed, prepared so that a sample only computes its vectors."""

    def __init__(self, dynamics: Matrix, i_z: float, w: CostWeights) -> None:
        n = w.moves
        phi, gamma = discrete(dynamics, w.moment_0 / i_z, w.step)
        free = [(1.0, 0.0), (0.0, 1.0)]  # e at the step for e_0 = (1, 0) and (0, 1)
        forced = [(0.0, 0.0)] * n  # and for each moment, in units of M_0
        hessian = [[0.0] * n for _ in range(n)]
        linear = [[0.0, 0.0] for _ in range(n)]
        self.free_beta: Rows = []
        rows = [[1.0 if i == j else 0.0 for j in range(n)] for i in range(n)]
        q_beta, q_r = w.beta_0**-2, w.r_0**-2
        for move in range(n):
            for _ in range(w.steps_per_move):
                free = [_stepped(phi, e) for e in free]
                forced = [_stepped(phi, e) for e in forced]
                forced[move] = (forced[move][0] + gamma[0], forced[move][1] + gamma[1])
                for i in range(move + 1):
                    beta_i, r_i = q_beta * forced[i][0], q_r * forced[i][1]
                    for j in range(move + 1):
                        hessian[i][j] += beta_i * forced[j][0] + r_i * forced[j][1]
                    for j in range(2):
                        linear[i][j] += beta_i * free[j][0] + r_i * free[j][1]
                hessian[move][move] += 1.0
            self.free_beta.append([free[0][0], free[1][0]])
            rows.append([e[0] for e in forced])
        inverted = inverse(hessian)
        self.moment_0 = w.moment_0
        self.unbound = [
            [-added(row[k] * linear[k][j] for k in range(n)) for j in range(2)] for row in inverted
        ]  # z = unbound e_0 while no constraint is active
        rows += [[-value for value in row] for row in rows]  # all upper bounds, then all lower bounds
        self.rows = rows
        self.reach = [[dot(row, line) for row in inverted] for line in rows]
        self.p = [[dot(up, line) for line in rows] for up in self.reach]
        for i, line in enumerate(self.p):
            if i % (2 * n) >= n:  # bounds of the sideslip
                line[i] += 1.0 / (w.penalty * q_beta)

    def moment(
        self, beta: float, r: float, beta_ref: float, r_ref: float, *, most: float, bound: float
    ) -> float:
        """Return the moment [N.m] of the current sample.

        Args:
            beta, r, beta_ref, r_ref: state and references [rad], [rad/s].
            most: limit of the moment [N.m].
            bound: largest sideslip angle [rad].
        """
        e_beta, e_r = beta - beta_ref, r - r_ref
        z = [k_beta * e_beta + k_r * e_r for k_beta, k_r in self.unbound]
        drift = [beta_ref + f_beta * e_beta + f_r * e_r for f_beta, f_r in self.free_beta]
        highest = most / self.moment_0
        room = [highest] * len(z) + [bound - angle for angle in drift]
        room += [highest] * len(z) + [bound + angle for angle in drift]
        y = multipliers(self.p, [b - dot(row, z) for b, row in zip(room, self.rows, strict=True)])
        first = z[0] - added(y_i * reach[0] for y_i, reach in zip(y, self.reach, strict=True))
        return first * self.moment_0


def _stepped(phi: Matrix, e: tuple[float, float]) -> tuple[float, float]:
    (p_11, p_12), (p_21, p_22) = phi
    return p_11 * e[0] + p_12 * e[1], p_21 * e[0] + p_22 * e[1]
