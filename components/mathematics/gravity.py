"""Physical constants."""

from __future__ import annotations

G = 9.81
"""Acceleration of gravity [m/s2]."""
