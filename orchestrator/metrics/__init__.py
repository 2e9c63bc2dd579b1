"""Metrics of runs and plausibility warnings."""

from .measures import MeasureEntry, catalogue

__all__ = ["MeasureEntry", "catalogue"]
