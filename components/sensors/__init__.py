"""Sensors: clusters of the signals that a car measures."""
