"""Runs of experiments on a Dask cluster (`--scheduler`)."""

PLUGINS = {"runner": {"scheduler": "yawbench.cluster.cluster:run_on_cluster"}}
