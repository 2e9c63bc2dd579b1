"""Measurements of cars: files that assign recorded columns to signals, and what becomes of these.

Columns of recordings become segments of signals in SI with increasing time: corrected, moved to the centre of
mass, filtered. A segment is read like the results of a run.

Not here: how files of columns are read (`yawbench.orchestrator.recordings`), flaws, fits and validation
(`yawbench.measured_cars`).
"""

PLUGINS = {"kind of file": {"measurement": "yawbench.measurements.measurement:MeasurementSpec"}}
