"""What accelerometers feel that are fixed to a body at its centre of mass: acceleration and gravity.

f_x = a_x cos(theta) - g sin(theta)        f_y = a_y cos(phi) + g sin(phi)
"""

from math import cos, sin

from yawbench.vocabulary.gravity import G


def felt(a_x: float, a_y: float, theta: float, phi: float) -> tuple[float, float]:
    """Return f_x and f_y [m/s2]; `theta`: nose down, `phi`: left side up [rad]."""
    return a_x * cos(theta) - G * sin(theta), a_y * cos(phi) + G * sin(phi)
