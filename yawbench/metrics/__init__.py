"""Metrics of runs, verdicts, and plausibility warnings."""
