"""Actuators: from requested torque to torque at the wheel."""
