"""Experiments: studies, sweeps, tunings and rankings, expanded into runs, executed and judged."""
