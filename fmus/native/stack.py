"""Calls of functions that are being evaluated: where the evaluation is, and the names it sees."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from typing import Any

from .read import Source, kinds_within
from .values import Frame

EXIT, RESULT = "<exit>", "<result>"
"""Names in a frame of how its function goes on, and of what it returns."""
ON, CONTINUE, BREAK, RETURN, OVER = range(5)
"""Ends of a block: it continues, leaves a loop or the function, or the test of a loop fails."""


@dataclass
class Call:
    """Call of a function that is being evaluated."""

    source: Source
    frame: Frame
    line: int = 0
    column: int = 0
    base: Frame | None = None  # of an inner function
    own: frozenset[str] = frozenset()  # names that an inner function sets


class Stack:
    """Calls that are being evaluated, the innermost last.

    Attributes:
        entered: file and line of the last function that was entered.
    """

    def __init__(self) -> None:
        self.calls: list[Call] = []
        self.entered = ""

    @property
    def call(self) -> Call:
        """The innermost call."""
        return self.calls[-1]

    @property
    def frame(self) -> Frame:
        """Names of the innermost call."""
        return self.calls[-1].frame

    @property
    def exit(self) -> Any:
        """How the innermost function goes on."""
        return self.frame.slots.get(EXIT, ON)

    def at(self, node: ast.AST) -> None:
        """Record the line that is being evaluated."""
        self.call.line = node.lineno  # type: ignore[attr-defined]
        self.call.column = node.col_offset  # type: ignore[attr-defined]

    def where(self, *, column: bool = False) -> str:
        """Return the file and line that are being evaluated, of the innermost call that may be mentioned."""
        named = next((call for call in reversed(self.calls) if call.source.file), None)
        if named is None:
            return ""
        return f"{named.source.file}:{named.line}" + (f":{named.column}" if column else "")

    def raised_at(self) -> str:
        """Return the file and line in the package for an exception's message."""
        inner = next((call for call in reversed(self.calls) if call.source.of_package), None)
        return f"{inner.source.file}:{inner.line}" if inner else ""

    def has_closures(self) -> bool:
        """Return whether the innermost function has others within it."""
        kinds = kinds_within(self.call.source.node)
        return kinds[ast.Lambda] + kinds[ast.FunctionDef] > 1  # more functions than itself
