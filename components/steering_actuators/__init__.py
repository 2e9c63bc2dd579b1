"""Steering actuators: from the driver's steer angle to that of the road wheels."""
