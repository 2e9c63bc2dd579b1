"""Sources of a component: syntax tree, file and line of every function that it uses."""

from __future__ import annotations

import ast
import contextlib
import inspect
import linecache
from collections import Counter
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

from .values import Refused

Tree = ast.FunctionDef | ast.Lambda


@dataclass(frozen=True)
class Source:
    """Source of a function.

    Attributes:
        node: its syntax tree.
        file: its path for messages, relative to the folder of the package; "" if not mentioned.
        of_package: whether messages of Python mention it, too (see `components.fmi.component`).
        names: names of the module.
        cells: variables of the enclosing functions.
    """

    node: Tree
    file: str
    of_package: bool
    names: dict[str, Any]
    cells: dict[str, Any]


@cache
def _functions(file: str, content: bytes) -> dict[tuple[int, str], list[Tree]]:
    functions: dict[tuple[int, str], list[Tree]] = {}
    for node in ast.walk(ast.parse(content)):
        if isinstance(node, ast.FunctionDef):
            first = min([node.lineno, *(d.lineno for d in node.decorator_list)])
            functions.setdefault((first, node.name), []).append(node)
        elif isinstance(node, ast.Lambda):
            functions.setdefault((node.lineno, "<lambda>"), []).append(node)
    return functions


@cache
def kinds_within(node: ast.AST) -> Counter[type[ast.AST]]:
    """Return the number of nodes of each kind within a node."""
    return Counter(map(type, ast.walk(node)))


@cache
def names_within(node: ast.AST) -> Counter[tuple[str, type[ast.expr_context]]]:
    """Return how often each name is read (`ast.Load`) and set (`ast.Store`) within a node."""
    return Counter((x.id, type(x.ctx)) for x in ast.walk(node) if isinstance(x, ast.Name))


@cache
def names_set_by(function: Tree) -> frozenset[str]:
    """Return the names that a function sets, without those of comprehensions and of functions within it."""
    names: set[str] = set()
    waiting: list[ast.AST] = [function.body] if isinstance(function, ast.Lambda) else [*function.body]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        if not isinstance(node, (ast.FunctionDef, ast.Lambda, ast.comprehension)):
            waiting += ast.iter_child_nodes(node)
    return frozenset(names)


@cache
def _codes(file: str, content: bytes) -> dict[tuple[int, str], CodeType]:
    """Return the code of every function in a file, by its first line and name."""
    codes: dict[tuple[int, str], CodeType] = {}
    waiting = [compile(content, file, "exec", dont_inherit=True)]
    while waiting:
        within = [x for x in waiting.pop().co_consts if isinstance(x, CodeType)]
        codes |= {(code.co_firstlineno, code.co_name): code for code in within}
        waiting += within
    return codes


def content_of(file: str) -> bytes | None:
    """Return the text of a source file, or of a cell of a notebook; None if there is none."""
    if Path(file).is_file():
        return Path(file).read_bytes()
    return "".join(linecache.getlines(file)).encode() or None


class Sources:
    """Functions that are translated: those of a package, and of other files.

    Args:
        home: folder of the package.
        others: further folders and files.
        unnamed: a file whose lines are not mentioned in messages.
    """

    def __init__(self, home: Path, *others: Path, unnamed: Path | None = None) -> None:
        self.home = home
        self.others = others
        self.unnamed = unnamed
        self._known: dict[FunctionType, Source] = {}

    def contains(self, function: FunctionType) -> bool:
        """Return whether a function is translated."""
        file = Path(function.__code__.co_filename)
        return any(file.is_relative_to(folder) for folder in (self.home, *self.others))

    def of(self, function: FunctionType) -> Source:
        """Return the source of a function.

        Raises:
            Refused: it has no source, shares its line with another, or was edited since it was imported.
        """
        if function not in self._known:
            self._known[function] = self._found(function)
        return self._known[function]

    def _found(self, function: FunctionType) -> Source:
        code = function.__code__
        file = Path(code.co_filename)
        of_package = file.is_relative_to(self.home)
        shown = file.relative_to(self.home).as_posix() if of_package else file.name
        shown = "" if file == self.unnamed else shown
        where = f"{shown}:{code.co_firstlineno}"
        content = content_of(str(file))
        if content is None:
            raise Refused(f"{function.__qualname__} has no source", where)
        nodes = _functions(str(file), content).get((code.co_firstlineno, code.co_name), [])
        if len(nodes) != 1:
            raise Refused(f"{function.__qualname__} shares its line with another function", where)
        if not of_package and _codes(str(file), content).get((code.co_firstlineno, code.co_name)) != code:
            raise Refused(f"{function.__qualname__} was edited since it was imported", where)
        if code.co_flags & (inspect.CO_GENERATOR | inspect.CO_COROUTINE):
            raise Refused(f"{function.__qualname__} is a generator", where)
        cells = {}
        for name, cell in zip(code.co_freevars, function.__closure__ or (), strict=True):
            with contextlib.suppress(ValueError):  # not assigned yet
                cells[name] = cell.cell_contents
        return Source(nodes[0], shown, of_package, function.__globals__, cells)
