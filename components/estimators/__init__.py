"""Estimators: what a car can know of what it does not measure."""
