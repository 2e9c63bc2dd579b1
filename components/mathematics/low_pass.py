"""Second-order low pass (Butterworth), solved exactly for piecewise linear input.

    x'' + sqrt(2) w x' + w^2 x = w^2 u           w = 2 pi bandwidth (-3 dB)

The delay of slow signals is sqrt(2) / w: 11 ms at 21 Hz.
"""

from math import pi, sqrt

from .oscillator import transition


class LowPass:
    """Second-order Butterworth filter and its state.

    Args:
        bandwidth: cutoff frequency (-3 dB), positive [Hz].
        value: initial value of the signal; the filter starts settled.
    """

    def __init__(self, bandwidth: float, value: float) -> None:
        self.w = 2.0 * pi * bandwidth
        self.x, self.dx = value, 0.0
        self.h = 0.0
        self.phi = (1.0, 0.0, 0.0, 1.0)

    def advance(self, h: float, begin: float, end: float) -> None:
        """Advance the filter by `h` > 0 [s], with a signal that changes linearly from `begin` to `end`."""
        if h != self.h:
            self.h = h
            self.phi = transition(self.w / sqrt(2.0), self.w * self.w, h)
        slope = (end - begin) / h
        behind = slope * sqrt(2.0) / self.w  # lag of the settled filter behind a ramp
        x, dx = self.x - (begin - behind), self.dx - slope
        t_11, t_12, t_21, t_22 = self.phi
        self.x = end - behind + (t_11 * x + t_12 * dx)
        self.dx = slope + (t_21 * x + t_22 * dx)
