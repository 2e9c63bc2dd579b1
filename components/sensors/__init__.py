"""Sensors: what a car knows of itself."""
