"""Reference page of the signals that units exchange, and of the roles they play."""

from __future__ import annotations

from yawbench.vocabulary import roles, signals
from yawbench.vocabulary.roles import ROLES
from yawbench.vocabulary.signals import SIGNALS

from .text import NOTE, cell, code, docstring, table


def page() -> str:
    """Return the page of the signal dictionary and the roles."""
    dictionary = [(code(name), one.symbol, code(one.unit), cell(one.text)) for name, one in SIGNALS.items()]
    contract = [
        (code(f"{role.name}_*"), code(f"components/{folder}/"), _names(role.inputs), _names(role.outputs))
        for folder, role in ROLES.items()
    ]
    return "\n\n".join([
        "# Signals and roles",
        NOTE,
        docstring(signals.__doc__ or ""),
        table(("signal", "symbol", "unit", "meaning"), dictionary),
        "## Roles",
        docstring(roles.__doc__ or ""),
        "An output drives every input of the same name. Every FMU of a role must declare the signals "
        "listed here; it may declare more.",
        table(("FMU", "folder", "inputs", "outputs"), contract),
    ])  # fmt: skip


def _names(names: tuple[str, ...]) -> str:
    return ", ".join(map(code, names))
