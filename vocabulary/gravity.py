"""The acceleration of gravity used by all components and evaluations."""

G = 9.81
"""Acceleration of gravity, rounded as the papers do [m/s2]."""
