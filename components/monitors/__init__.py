"""Monitors: whether signals can be believed, and what becomes of control if they cannot."""
