"""How fast a car must move for the angles of its velocity: sideslip, its rate, slip angles of wheels.

The angle of a vector of length zero is undefined, and that of a short one is noise: a car that stands has any
sideslip. Whatever judges, summarises or draws such a signal (`ANGLES`) leaves out the samples in which the
car is slower than `LEAST_SPEED`; recorded signals stay what the FMU or the sensor gave.

The speed is sqrt(v_x^2 + v_y^2), or |v_x| where v_y is not known: then a car that slides sideways, within
some degrees of 90, seems to stand, too. Without v_x the speed is unknown, and nothing is left out.
"""

from .wheels import wheels

ANGLES = ("sideslip", "sideslip_rate", *wheels("slip_angle_*"))
"""Signals that are angles of a velocity, or rates of one."""
LEAST_SPEED = 10.0 / 3.6
"""Speed below which the angle of a velocity means nothing [m/s]. Chosen: an error of 0.1 m/s in v_y is 2
degrees of sideslip there; inertial navigation systems for tests of cars give a slip angle above about this
speed only (Advanced Navigation, packet 73 of their protocol: above 3.45 m/s)."""
SPEED_SIGNALS = ("velocity_x", "velocity_y")
"""Signals that the speed is computed from."""
