"""Recorded runs: written while they go on, read back afterwards, with the record `run.json`.

CSV and Parquet; folders of runs with their locks; whether a recorded run is up to date; results of
runs that were killed; measurements read as results of runs.
"""
