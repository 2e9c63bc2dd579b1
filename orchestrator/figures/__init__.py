"""Figures of runs, drawn as the papers draw them."""
