"""Actuators: from the requested torque to the torque at the wheel."""
