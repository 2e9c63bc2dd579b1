"""The acceleration of gravity that all units and everything that judges them count with."""

G = 9.81
"""Acceleration of gravity, rounded as the papers do [m/s2]."""
