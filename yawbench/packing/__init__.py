"""Archives of studies that others unpack and repeat: files, FMUs, results, this program, a lock of packages.

Not here: the study itself (`yawbench.studies`), a scenario for other tools (`yawbench.interop`).
"""

PLUGINS = {"command": {"pack": "yawbench.packing.command:pack"}}
