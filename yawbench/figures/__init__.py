"""Matplotlib figures of runs, in the style of the papers."""
