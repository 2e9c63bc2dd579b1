"""Super-twisting algorithm: second-order sliding mode with a continuous control, sampled implicitly.

    ds/dt = d - u,        u = k_1 sqrt|s| sign(s) + w,        dw/dt = k_2 sign(s)

For a disturbance with |dd/dt| <= L, s and ds/dt reach zero in finite time and stay there if k_2 > L and k_1
is large enough; k_1 = 1.5 sqrt(L), k_2 = 1.1 L suffice. Then w is the disturbance.

A sampled sign switches at every sample. Here the sign is that of s at the end of the sample, if d were w:
with b = s - h w,

    |b| <= h^2 k_2:  s reaches zero,      sigma = b / (h^2 k_2),   u = s / h
    else             sigma = sign(b),     sqrt|s_end| = y,         y^2 + h k_1 y = |b| - h^2 k_2
                     u = k_1 y sigma + w + h k_2 sigma
    w grows by h k_2 sigma

so that the control comes to rest when s does.

Source: A. Levant, Sliding order and sliding accuracy in sliding mode control, International Journal of
Control 58(6), 1993, 1247-1263; the gains: A. Levant, Robust exact differentiation via sliding mode
technique, Automatica 34(3), 1998, 379-384; sampling: B. Brogliato, A. Polyakov, D. Efimov, The implicit
discretization of the super-twisting sliding-mode control algorithm, IEEE Transactions on Automatic Control
65(8), 2020, 3707-3713. None was at hand: algorithm and gains are common knowledge, the implicit step is
derived here.
"""

from math import sqrt


class SuperTwisting:
    """Super-twisting algorithm and its integral w [units of u].

    Args:
        k_1: gain of the square root, in units of u over the square root of s.
        k_2: gain of the integral, in units of u per second.
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
            h: length of the sample > 0 [s].
            low, high: limits of u: beyond them the integral only moves back.
        """
        reach = h * h * self.k_2
        b = s - h * self.integral
        rest = abs(b) - reach
        if rest <= 0.0:
            sigma = b / reach if reach > 0.0 else 0.0
            u = s / h
        else:
            sigma = 1.0 if b > 0.0 else -1.0
            half = 0.5 * h * self.k_1
            y = rest / (half + sqrt(half * half + rest))
            u = self.integral + sigma * (self.k_1 * y + h * self.k_2)
        if not (u > high and sigma > 0.0) and not (u < low and sigma < 0.0):
            self.integral += h * self.k_2 * sigma
        return u
