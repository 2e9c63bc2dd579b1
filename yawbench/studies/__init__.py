"""Experiments: studies, sweeps and tunings, expanded into runs, executed and judged."""

PLUGINS = {"kind of file": {"experiment": "yawbench.studies.load_experiment:ExperimentFile"}}
