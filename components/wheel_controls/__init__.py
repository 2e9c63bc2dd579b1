"""Wheel controls: from force request to torque request."""
