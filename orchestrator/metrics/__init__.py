"""Stage five: what a run is judged by."""

from .measures import Entry, catalogue

__all__ = ["Entry", "catalogue"]
