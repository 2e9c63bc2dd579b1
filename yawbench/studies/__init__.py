"""Experiments: studies, sweeps and tunings, expanded into runs, executed and judged, written as tables.

An experiment is a file, or is made in Python by the same types. Axes span its cases; jobs are their runs,
made by worker processes and journaled; claims and limits are judged, also over the region of values that a
paper leaves open.

Not here: rankings (`yawbench.ranking`), pages (`yawbench.reports`).
"""

PLUGINS = {"kind of file": {"experiment": "yawbench.studies.load_experiment:ExperimentFile"}}
