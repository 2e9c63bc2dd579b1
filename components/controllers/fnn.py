"""Fuzzy neural network that controls the sideslip angle and learns online.

    e = beta_ref - beta,   E = e^2 / 2                                                      (28)
    x_1 = tanh(theta_1 e / 2),   x_2 = tanh(theta_2 de/dt / 2)                        (22), (23)
    mu_ij = exp(-((x_i - c_ij) / s_ij)^2)          seven Gaussian sets per input            (24)
    a_jk = mu_1j mu_2k,   abar_jk = a_jk / sum(a)                                     (25), (26)
    M_z = K_u u,   u = sum(abar_jk w_jk)           limited to the moment limit              (27)
    dw_jk = -g e abar_jk                                                              (29), (33)
    dc_ij = -g_s e du/dc_ij,   ds_ij = -g_s e du/ds_ij   (30), (31), (34), (35)
    g = alpha J k_e h / 1 ms,   g_s = alpha_s J k_e h / 1 ms    h sample time, k_e error scale

Sign: a positive moment lowers beta and raises e, so de/dM_z > 0, and the initial weights are
-clip(c_1j + c_2k, -1, 1): the standard rule table, negated.

The normalisation factors into the two inputs, abar_jk = n_1j n_2k with n_ij = mu_ij / sum_j(mu_ij), so
the exact gradient of the sets is short: du/dc_1j = n_1j (q_j - u) 2 (x_1 - c_1j) / s_1j^2 with
q_j = sum_k(n_2k w_jk), and du/ds_1j is (x_1 - c_1j) / s_1j times that.

Learning pauses while the moment is at its limit or above the learning limit, where torques may
saturate: the car then does not get the requested moment, and e would wind the weights up. Under violent
excitation this is not enough (40 m/s, 0.03 rad, mu 0.65: max|e| is about 130 % of max|beta_ref| with
learning, 12 % with frozen weights). Saturation is not the cause: the result is the same without any limits.
Learning integrates e; where tanh flattens, the proportional and damping parts of the control vanish, the
integral does not, and the loop oscillates. `recall` pulls each weight towards its initial value, in
proportion to |e|, and cures this (0.1: 13 %, unchanged in the paper's runs): e-modification, K. S. Narendra,
A. M. Annaswamy, IEEE Trans. Automatic Control 32(2), 1987, 134-145. The paper does not have it, so it is off
by default.

The paper has one rate alpha = 2 for weights, centres and widths, and no scale of the error. Its complete
rule, `set_learning_rate` 2, shakes the car at the default error scale, which serves the weights alone. At
620 to 900 per rad it works: at 750 max|e| is 4.0, 3.1 and 3.9 % of max|beta_ref| at 15, 25 and 40 m/s; from
1100 on it chatters at 40 m/s.

Source: paper A, equations (22)-(35). Errata: (24) lacks the minus and the text swaps the names of centre and
width; the gradients print "e2" for e, a product over "j != i" that is the other input's grade, and lack the
derivative of the normalisation; (35) prints d/db for d/dsigma; (32) sets J = sign(e / dM_z) 5.5e-4, which is
not an estimate of de/dM_z and makes the car lose control: here J is a constant.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import repeat
from math import dist, tanh
from operator import mul, sub

from ..fmi.component import Component
from ..fmi.variables import output, parameter
from ..mathematics.fuzzy import gaussian_grades
from ..mathematics.sums import added, dot

N_SETS = 7
CENTRES = tuple((j - 3) / 3.0 for j in range(N_SETS))
"""Centres of the sets NB, NM, NS, ZO, PS, PM, PB before learning; chosen: evenly spaced in [-1, 1]."""
NARROWEST = 0.1
"""Smallest width of a set; chosen: no sum of grades can underflow."""


@dataclass(frozen=True)
class FnnParameters:
    """Parameters of network, learning and moment limit."""

    error_gain: float = parameter(
        400.0, "1/rad", "Scale theta_1 of e", "chosen: at 0.16 degrees x_1 is 1/2", minimum=0.0, tunable=True
    )
    error_rate_gain: float = parameter(
        50.0,
        "s/rad",
        "Scale theta_2 of de/dt",
        "chosen: damps the loop up to 5 ms sample time",
        minimum=0.0,
        tunable=True,
    )
    set_width: float = parameter(
        0.24, "1", "Width s of the sets before learning", "chosen: sets cross at 0.6", minimum=NARROWEST
    )
    moment_gain: float = parameter(
        5000.0,
        "N.m",
        "Moment K_u per unit of the network's output",
        "chosen: the moment limit",
        minimum=0.0,
        tunable=True,
    )
    moment_limit: float = parameter(
        5000.0, "N.m", "Largest moment", "chosen: slightly more than the motors can give", minimum=0.0
    )
    learning: bool = parameter(True, None, "Learn online; false freezes the weights", "paper A")
    learning_rate: float = parameter(
        2.0, "1", "Learning rate alpha", "paper A, equation (35)", minimum=0.0, tunable=True
    )
    plant_jacobian: float = parameter(
        5.5e-4, "1", "Constant J in place of de/dM_z", "paper A, equation (32), positive constant"
    )
    error_scale: float = parameter(
        11000.0,
        "1/rad",
        "Scale k_e of the error in learning",
        "chosen: halves the error at 15 m/s, a factor 4 below the step that chatters at 40 m/s",
        minimum=0.0,
    )
    weight_limit: float = parameter(
        1.5, "1", "Largest weight", "chosen: 1.5 times the initial ones", minimum=0.0
    )
    learning_limit: float = parameter(
        4250.0,
        "N.m",
        "Moment above which learning pauses",
        "chosen: what four motors of 400 N.m give at equal wheel loads, since torques are not inputs"
        " of the controller",
        minimum=0.0,
    )
    recall: float = parameter(
        0.0,
        "1",
        "Pull of the weights towards their initial values, relative to learning",
        "chosen: none, as in the paper; 0.1 holds the car under harsh excitation",
        minimum=0.0,
    )
    set_learning_rate: float = parameter(
        0.0,
        "1",
        "Learning rate alpha_s of centres and widths (alpha in paper A)",
        "chosen: 0, fixed sets; at this error scale 0.2 shakes the car at 40 m/s, the paper's 2 works at a"
        " scale of 620 to 900",
        minimum=0.0,
    )


def initial_weights() -> list[float]:
    """Return the 49 weights w_jk before learning, row by row: -clip(c_j + c_k, -1, 1)."""
    return [-min(max(c + d, -1.0), 1.0) for c in CENTRES for d in CENTRES]


def normalised_grades(x: float, centres: Sequence[float], widths: Sequence[float]) -> list[float]:
    """Return the normalised grades n_j = mu_j / sum(mu) of `x` in seven Gaussian sets; equation (24)."""
    grades = gaussian_grades(x, centres, widths)
    total = added(grades)
    return [grade / total for grade in grades]


def firing_strengths(n_1: Sequence[float], n_2: Sequence[float]) -> list[float]:
    """Return the 49 normalised strengths abar_jk of the rules; equations (25), (26)."""
    return [p * q for p in n_1 for q in n_2]


def set_gradients(
    x: Sequence[float],
    weights: Sequence[float],
    centres: Sequence[Sequence[float]],
    widths: Sequence[Sequence[float]],
) -> tuple[list[list[float]], list[list[float]]]:
    """Return (du/dc, du/ds), each with a list per input; the gradient in (30), (31), corrected.

    The gradient of the weights, in (29), is `firing_strengths`.
    """
    n_1, n_2 = map(normalised_grades, x, centres, widths)
    rows = [weights[N_SETS * j : N_SETS * (j + 1)] for j in range(N_SETS)]
    by_first = [dot(n_2, row) for row in rows]
    by_second = [dot(n_1, column) for column in zip(*rows, strict=True)]
    u = dot(n_1, by_first)
    by_centre, by_width = [], []
    for x_i, n_i, q_i, c_i, s_i in zip(x, (n_1, n_2), (by_first, by_second), centres, widths, strict=True):
        distance = [(x_i - c) / s for c, s in zip(c_i, s_i, strict=True)]
        slope = [n * (q - u) * 2.0 * z / s for n, q, z, s in zip(n_i, q_i, distance, s_i, strict=True)]
        by_centre.append(slope)
        by_width.append(list(map(mul, slope, distance)))
    return by_centre, by_width


def learnt(
    values: Sequence[float], gradient: Sequence[float], step: float, low: float, high: float
) -> list[float]:
    """Return the values after a gradient step, each limited to low..high; equations (33)-(35)."""
    moved = list(map(sub, values, map(mul, gradient, repeat(step))))
    if max(moved) > high or min(moved) < low:
        return [min(max(v, low), high) for v in moved]
    return moved


_SEEN = ("sideslip_ref", "sideslip", "sideslip_rate_ref", "sideslip_rate")


class Fnn(Component):
    """Fuzzy neural network for sideslip control, learning online."""

    Parameters = FnnParameters
    inputs = _SEEN
    outputs = (
        output("yaw_moment", *_SEEN),
        output(
            "learning_error",
            *_SEEN,
            unit="rad",
            text="Error e used for learning in this sample, 0 while learning pauses",
        ),
        output(
            "weight_change",
            *_SEEN,
            unit="1",
            text="Euclidean distance of the 49 weights from their initial values",
        ),
    )
    sampled = True

    def configure(self) -> None:
        p = self.p
        self.sensitivity = p.plant_jacobian * p.error_scale / 0.001  # of a rate of 1, per second
        self.initial = initial_weights()

    def start(self, t: float, u: list[float]) -> None:
        self.weights = self.initial
        self.centres = [list(CENTRES), list(CENTRES)]
        self.widths = [[self.p.set_width] * N_SETS, [self.p.set_width] * N_SETS]
        self._sample(u, 0.0)

    def advance(self, t: float, h: float, u: list[float]) -> None:
        self._sample(u, h)

    def output(self, t: float, u: list[float]) -> tuple[float, ...] | list[float]:
        return self.moment, self.learning_error, dist(self.weights, self.initial)

    def _sample(self, u: list[float], h: float) -> None:
        """Compute the moment from the current network, then learn for `h` [s]."""
        p = self.p
        beta_ref, beta, beta_ref_rate, beta_rate = u
        e = beta_ref - beta
        x_1 = tanh(0.5 * p.error_gain * e)
        x_2 = tanh(0.5 * p.error_rate_gain * (beta_ref_rate - beta_rate))
        (c_1, c_2), (s_1, s_2) = self.centres, self.widths
        strengths = firing_strengths(normalised_grades(x_1, c_1, s_1), normalised_grades(x_2, c_2, s_2))
        wanted = p.moment_gain * dot(strengths, self.weights)
        self.moment = min(max(wanted, -p.moment_limit), p.moment_limit)
        self.learning_error = 0.0
        if p.learning and abs(wanted) < min(p.moment_limit, p.learning_limit):
            self.learning_error = e
            self._learn((x_1, x_2), strengths, e, h)

    def _learn(self, x: tuple[float, float], strengths: list[float], e: float, h: float) -> None:
        """Take a step of gradient descent on E = e^2 / 2, scaled with the sample time `h` [s]."""
        p = self.p
        slope = self.sensitivity * h * e
        step = p.learning_rate * slope
        weights = self.weights
        if p.recall:
            pull = p.recall if e > 0.0 else -p.recall
            strengths = [a + pull * (w - v) for a, w, v in zip(strengths, weights, self.initial, strict=True)]
        self.weights = learnt(weights, strengths, step, -p.weight_limit, p.weight_limit)
        if p.set_learning_rate:
            step = p.set_learning_rate * slope
            by_centre, by_width = set_gradients(x, weights, self.centres, self.widths)
            self.centres = [
                learnt(c, d, step, -1.0, 1.0) for c, d in zip(self.centres, by_centre, strict=True)
            ]
            self.widths = [
                learnt(s, d, step, NARROWEST, 1.0) for s, d in zip(self.widths, by_width, strict=True)
            ]
