"""Wiring: turns a validated scenario into a plan in which every input has exactly one source."""
