"""Recorded runs for other programs: viewers in three dimensions, signal viewers, tables; `yawbench export`.

`FORMATS` in `formats` lists them. Every format gets the same: runs with their labels, all recorded signals
with units, and, where it can hold them, scenes (`yawbench.scene`), events and a layout.

Not here: files that runs are recorded to (`yawbench.orchestrator.results`), systems (`yawbench.interop`).
"""

PLUGINS = {"command": {"export": "yawbench.export.command:export"}}
