"""What `yawbench --help` and `--version` print, and the commands by name, without importing any of them.

The line of a command is the first of the docstring of its function, read from the source.
"""

from __future__ import annotations

import re
import shutil
import textwrap
from collections.abc import Sequence
from importlib.util import find_spec

from yawbench.foundation import plugins

ABOUT = "A test bench for vehicle yaw-stability control made of FMI units."
GROUPS = {
    "Start": ("new", "build", "list", "show", "check"),
    "Run and look": ("run", "compare", "plot", "animate", "converge", "diff"),
    "Many runs": ("study", "report", "sweep", "tune", "rank"),
    "Judge": ("evaluate", "drive", "validate"),
    "Cars": ("vehicle", "tyre", "measured", "fit"),
    "Other programs": (
        "export", "export-fmu", "export-ssp", "export-can", "dbc", "second-opinion", "pack",
    ),
    "Service": ("serve", "salvage", "cache", "schema"),
}  # fmt: skip
"""Heading -> commands; those of no group, such as of packages of others, come last."""
OTHERS = "Others"
HELP = ("-h", "--help")
OPTIONS = {
    "--version": "Print the version.",
    "--install-completion": "Install completion for the current shell.",
    "--show-completion": "Show completion for the current shell, to copy it or customize the installation.",
    "-h, --help": "Show this message and exit.",
}
WIDEST = 80
"""Columns of help; as typer has it."""


def answer(arguments: Sequence[str]) -> str | None:
    """Return what is printed for these arguments if no command is called, else None."""
    if [*arguments] == ["--version"]:
        from importlib.metadata import version

        return f"yawbench {version('yawbench')}"
    return overview() if not arguments or arguments[0] in HELP else None


def overview() -> str:
    """Return the help of the program, its commands in groups."""
    known = plugins.names("command")
    listed = {name for names in GROUPS.values() for name in names}
    groups = {**GROUPS, OTHERS: tuple(name for name in known if name not in listed)}
    parts = ["Usage: yawbench [OPTIONS] COMMAND [ARGS]...", f"  {ABOUT}", _block("Options", OPTIONS)]
    for heading, names in groups.items():
        lines = {name: first_line(name) for name in names if name in known}
        parts += [_block(heading, lines)] if lines else []
    parts.append("  yawbench COMMAND --help has the options of a command.")
    return "\n\n".join(parts)


def first_line(command: str) -> str:
    """Return the line of a command."""
    module, _, function = plugins.place("command", command).partition(":")
    spec = find_spec(module)
    assert spec is not None and spec.origin is not None
    with open(spec.origin, encoding="utf-8") as file:
        source = file.read()
    found = re.search(
        rf'^def {function}\(.*?\) -> None:\n    """(.*?)(?:\n|""")', source, re.DOTALL | re.MULTILINE
    )
    if found is None:  # of somebody else, in another form
        return ((plugins.find("command", command).__doc__ or "").strip().splitlines() or [""])[0]
    return found[1]


def _block(heading: str, lines: dict[str, str]) -> str:
    width = min(shutil.get_terminal_size((WIDEST, 24)).columns, WIDEST)
    names = max(map(len, [*OPTIONS, *lines])) + 4
    made = [f"{heading}:"]
    for name, text in lines.items():
        wrapped = textwrap.wrap(text, max(width - names, 20)) or [""]
        made += [f"  {name:{names - 2}}{wrapped[0]}", *(" " * names + line for line in wrapped[1:])]
    return "\n".join(line.rstrip() for line in made)
