"""Actuators: what stands between a torque asked for and the torque at the wheel."""
