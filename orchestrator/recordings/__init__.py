"""Files of measured columns: formats, clocks, units, gaps; measurement files that assign them to signals.

Text tables, Parquet, MDF and MATLAB files of loggers become segments of signals with increasing time.

Not here: flaws, fits and validation of recordings (`yawbench.measured_cars`).
"""
