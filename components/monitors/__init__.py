"""Monitors: detection of sensor faults, and fade-out of control in response."""
