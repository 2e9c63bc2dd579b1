"""Acceleration of gravity, for all components and evaluations."""

G = 9.81
"""Acceleration of gravity, rounded as in the papers [m/s2]."""
