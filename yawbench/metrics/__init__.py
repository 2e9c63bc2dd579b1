"""Measures of signals (`peak`, `rms`, ...), metrics of runs and verdicts.

A measure is a function in `measures`; `expressions` parses `peak(sideslip) from 1 s` and finds its signals in
a run.

Not here: criteria of standard tests (`proving_ground`), claims of papers (`studies`).
"""
