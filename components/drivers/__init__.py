"""Drivers: steering and drive force over time, open or closed loop."""
