"""The subcommands of `yawbench`, thin: options in, tables and pages out; a module for each.

`options` has the options that several share, `output` prints for people, `--json` and `--latex`.

Not here: commands of wings, which stand with their wing.
"""

_COMMANDS = (
    "new",
    "build",
    "show",
    "check",
    "run",
    "compare",
    "plot",
    "animate",
    "converge",
    "study",
    "report",
    "sweep",
    "evaluate",
    "drive",
    "tune",
    "list",
    "diff",
    "salvage",
    "tyre",
    "vehicle",
    "cache",
    "schema",
)
"""The commands in the order of the help; each is a function of that name, in a module of that name."""
_ELSEWHERE = {"study": "experiments", "report": "experiments", "sweep": "experiments"}

PLUGINS = {"command": {name: f"yawbench.commands.{_ELSEWHERE.get(name, name)}:{name}" for name in _COMMANDS}}
