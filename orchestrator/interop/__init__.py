"""Interoperability: SSP export, and the same scenario run by other co-simulation masters."""
