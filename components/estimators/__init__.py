"""Estimators of the quantities that a car does not measure, such as sideslip and friction."""
