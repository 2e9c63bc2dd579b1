"""The subcommands of `yawbench`, thin: options in, tables and pages out; a module for each.

`options` has the options that several share, `output` prints for people, `--json` and `--latex`.

Not here: commands of wings, which stand with their wing.
"""

_MODULES = {
    "new": "new",
    "build": "build",
    "check": "check",
    "run": "run",
    "compare": "run",
    "plot": "results",
    "animate": "results",
    "converge": "run",
    "study": "experiments",
    "report": "experiments",
    "sweep": "experiments",
    "evaluate": "standard_tests",
    "drive": "standard_tests",
    "tune": "experiments",
    "list": "build",
    "diff": "run",
    "salvage": "results",
    "tyre": "vehicle",
    "vehicle": "vehicle",
    "cache": "build",
    "schema": "new",
}
"""Command -> its module; the function has the same name."""

PLUGINS = {"command": {name: f"yawbench.commands.{module}:{name}" for name, module in _MODULES.items()}}
