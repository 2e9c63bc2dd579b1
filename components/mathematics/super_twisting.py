"""Super-twisting algorithm: second-order sliding mode with a continuous control, sampled implicitly.

    ds/dt = d - u,        u = k_1 sqrt|s| sign(s) + w,        dw/dt = k_2 sign(s)

For a disturbance with |dd/dt| <= L, s and ds/dt reach zero in finite time and stay there if k_2 > L and k_1
is large enough; k_1 = 1.5 sqrt(L), k_2 = 1.1 L suffice. Then w is the disturbance.

A sampled sign switches at every sample. Here both terms are those at the end of the sample, s_end, if the
disturbance stayed at w; and as w is a sample behind the disturbance, its growth counts twice in u:

    sigma = s / (h^2 k_2)    limited to -1..1                 w grows by h k_2 sigma
    s_end = sigma y^2,       y^2 + h k_1 y = |s| - 2 h^2 k_2  or y = 0, if that is negative
    u     = w + sigma (k_1 y + 2 h k_2)

Where |s| <= h^2 k_2, errors of s and w decay within two samples: the control comes to rest, and the accuracy
is that of the algorithm, |s| <= L h^2.

Source: A. Levant, Sliding order and sliding accuracy in sliding mode control, International Journal of
Control 58(6), 1993, 1247-1263; the gains: A. Levant, Robust exact differentiation via sliding mode
technique, Automatica 34(3), 1998, 379-384; sampling: B. Brogliato, A. Polyakov, D. Efimov, The implicit
discretization of the super-twisting sliding-mode control algorithm, IEEE Transactions on Automatic Control
65(8), 2020, 3707-3713.
None was at hand: algorithm and gains are common knowledge. The implicit step is derived here; it differs from
the last in that it reckons with w as the disturbance, where that reckons with none and rests at s = h d.
"""

from math import sqrt


class SuperTwisting:
    """Super-twisting algorithm and its integral w [units of u].

    Args:
        k_1: gain of the square root, in units of u over the square root of s.
        k_2: gain of the integral > 0, in units of u per second.
    """

    def __init__(self, k_1: float, k_2: float) -> None:
        self.k_1, self.k_2 = k_1, k_2
        self.integral = 0.0

    def value(self, s: float) -> float:
        """Return u for `s` at an instant, without a sample's length."""
        return self.integral + (self.k_1 * sqrt(s) if s > 0.0 else -self.k_1 * sqrt(-s))

    def see(self, s: float, h: float, low: float, high: float) -> float:
        """Return u for the next sample.

        Args:
            s: sliding variable.
            h: length of the sample [s]; 0: nothing moves.
            low, high: limits of u: beyond them the integral only moves back.
        """
        if h <= 0.0:
            return self.integral
        growth = h * self.k_2
        sigma = min(max(s / (h * growth), -1.0), 1.0)
        half = 0.5 * h * self.k_1
        y = sqrt(half * half + max(abs(s) - 2.0 * h * growth, 0.0)) - half
        u = self.integral + sigma * (self.k_1 * y + 2.0 * growth)
        if not (u > high and sigma > 0.0) and not (u < low and sigma < 0.0):
            self.integral += growth * sigma
        return u
