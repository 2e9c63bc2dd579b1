"""One scenario over many conditions: planned, run on all cores or a cluster, tabled, drawn."""
