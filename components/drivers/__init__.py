"""Drivers: what the person at the wheel does, open or closed loop."""
