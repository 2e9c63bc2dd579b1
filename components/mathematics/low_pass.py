"""A low pass of second order (Butterworth), solved exactly for a signal that runs in straight lines.

    x'' + sqrt(2) w x' + w^2 x = w^2 u           w = 2 pi bandwidth, -3 dB there

It follows a signal that changes slowly sqrt(2) / w late: 11 ms at 21 Hz.
"""

from math import pi, sqrt

from .oscillator import transition


class LowPass:
    """The filter and where it is.

    Args:
        bandwidth: [Hz], positive.
        value: of the signal at the start, where the filter has settled.
    """

    def __init__(self, bandwidth: float, value: float) -> None:
        self.w = 2.0 * pi * bandwidth
        self.x, self.dx = value, 0.0
        self.h = 0.0
        self.phi = (1.0, 0.0, 0.0, 1.0)

    def advance(self, h: float, begin: float, end: float) -> None:
        """Take the filter over `h` > 0 [s], the signal running from `begin` to `end`."""
        if h != self.h:
            self.h = h
            self.phi = transition(self.w / sqrt(2.0), self.w * self.w, h)
        slope = (end - begin) / h
        behind = slope * sqrt(2.0) / self.w  # the settled filter follows a ramp that far behind
        x, dx = self.x - (begin - behind), self.dx - slope
        t_11, t_12, t_21, t_22 = self.phi
        self.x = end - behind + (t_11 * x + t_12 * dx)
        self.dx = slope + (t_21 * x + t_22 * dx)
