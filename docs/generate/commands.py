"""The reference of commands, from the command line itself."""

from __future__ import annotations

import inspect
import re

import click
import typer

from orchestrator.cli import _application

from .text import NOTE, cell, code, plain, table

_KIND = re.compile(r" <(?:path|str|text|list\[\w+\])>$")
"""What typer says of an argument's type; `<python|c>`, its choices, stays."""


def page() -> str:
    """Return the page of all subcommands with their arguments and options."""
    group = typer.main.get_command(_application())
    parts = ["# Commands", NOTE, _INTRODUCTION]
    for name, command in group.commands.items():  # type: ignore[attr-defined]
        context = click.Context(command, info_name=f"yawbench {name}")
        parts.append(f"## yawbench {name}")
        parts.append("\n".join(plain(line) for line in inspect.cleandoc(command.help or "").splitlines()))
        rows = []
        for parameter in command.params:
            record = parameter.get_help_record(context)
            if record is not None and parameter.name != "help":
                rows.append((code(_KIND.sub("", record[0])), cell(record[1])))
        parts.append(table(("argument or option", "meaning"), rows))
    return "\n\n".join(parts)


_INTRODUCTION = """Called as `.venv/bin/yawbench` in a checkout; `--help` says the same on a terminal. Exit
status 0: fine, 1: a run failed, 2: the input is wrong. Tables go to standard output, everything else that
is said to standard error.
"""
