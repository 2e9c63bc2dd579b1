"""Stage five: what a run is judged by."""

from .measures import MeasureEntry, catalogue

__all__ = ["MeasureEntry", "catalogue"]
