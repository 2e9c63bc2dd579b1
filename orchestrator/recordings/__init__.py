"""Files of recorded columns: formats, clocks, units, gaps.

Text tables, Parquet, MDF and CAN logs become columns with times and units.

Not here: which signals of a car they are (`yawbench.measurements`).
"""
