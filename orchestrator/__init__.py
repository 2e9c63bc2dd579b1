"""Scenarios, FMUs, the co-simulation master, results, experiments and commands; never imports components."""
