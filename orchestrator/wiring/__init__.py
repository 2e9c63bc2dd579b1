"""From a validated scenario to a plan in which every input has exactly one source.

Parameters and facts are distributed to instances, wires and time series connected, the order of evaluation
found, faults placed, suspicious values named. No FMU code runs here.
"""
