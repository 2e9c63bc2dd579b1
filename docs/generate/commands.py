"""The reference of commands, from the command line itself."""

from __future__ import annotations

import inspect
import re

import click
import typer

from yawbench.cli import _application

from .text import NOTE, cell, code, plain, table

_KIND = re.compile(r" <(?:path|str|text|list\[\w+\])>$")
"""Type of an argument as typer prints it, which is removed; choices such as `<python|c>` are kept."""


def page() -> str:
    """Return the page of all subcommands with their arguments and options."""
    group = typer.main.get_command(_application(whole=True))
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


_INTRODUCTION = """All commands with their arguments and options, as `yawbench COMMAND --help` prints them. In
a checkout the command is `.venv/bin/yawbench`. The exit status is 0 on success, 1 if a run failed, 2 if the
input is wrong, 130 after Ctrl-C, 143 after SIGTERM. Tables go to standard output, messages to standard error.
"""
