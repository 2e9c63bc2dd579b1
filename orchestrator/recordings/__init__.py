"""Measured cars: recordings read, examined, and compared with simulations."""
