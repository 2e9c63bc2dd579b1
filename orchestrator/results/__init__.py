"""Recorded results of runs: written while a run goes on, read back afterwards."""
