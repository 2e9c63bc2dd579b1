"""Stage five: what a run is judged by."""
