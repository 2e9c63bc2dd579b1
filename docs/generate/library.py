"""The reference of the Python library: its public names, and the types of `yawbench.types`."""

from __future__ import annotations

import ast
import inspect
import sys
import textwrap
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import yawbench
from yawbench import types

from .text import NOTE, cell, code, docstring, table

SOURCE = Path(types.__file__)
EXAMPLE = textwrap.dedent((types.__doc__ or "").partition("\n\n")[2]).strip()


def page() -> str:
    """Return the page of functions and classes, and the table of types."""
    parts = [
        "# Reference of the library",
        NOTE,
        "`import yawbench as yb`; [guide](../library.md).",
        "## Functions",
    ]
    public = {name: getattr(yawbench, name) for name in yawbench.__all__}
    for name, function in public.items():
        if not isinstance(function, type):
            parts += [f"### {name}", _code(f"yb.{name}{_signature(function)}"), _text(function)]
    parts.append("## Classes")
    for name, cls in public.items():
        if isinstance(cls, type) and not issubclass(cls, (Exception, Warning)):
            parts += [f"### {name}", _text(cls), table(("member", "meaning"), _members(cls))]
    parts.append("## Errors and warnings")
    errors = [(name, cls) for name, cls in public.items() if isinstance(cls, type)]
    rows = [
        (code(name), cell(_summary(cls))) for name, cls in errors if issubclass(cls, (Exception, Warning))
    ]
    parts.append(table(("class", "meaning"), rows))
    parts += [
        "## Types",
        cell(_summary(types)),
        _code(EXAMPLE, "python"),
        table(("type", "meaning", "members"), _types()),
    ]
    return "\n\n".join(parts)


def _types() -> Iterator[tuple[str, str, str]]:
    """Yield the rows of the table of types: name, meaning, members or definition."""
    for name in types.__all__:
        value = getattr(types, name)
        if isinstance(value, type):
            fields = [field for field in vars(value).get("__annotations__", {}) if not field.startswith("_")]
            members = ", ".join(map(code, [*fields, *(name for name, _ in _documented(value))]))
            yield code(name), cell(_summary(value)), members
        else:
            meaning, definition = _alias(name)
            yield code(name), cell(meaning), code(definition.replace("|", "\\|"))


def _alias(name: str) -> tuple[str, str]:
    """Return docstring and definition of an alias, from the module that defines it."""
    for node in ast.parse(SOURCE.read_text("utf-8")).body:
        if isinstance(node, ast.ImportFrom) and name in [alias.name for alias in node.names]:
            module = f"yawbench.{node.module}" if node.level else node.module or ""
            body = ast.parse(inspect.getsource(sys.modules[module])).body
            for statement, after in pairwise(body):
                if isinstance(statement, ast.Assign) and ast.unparse(statement.targets[0]) == name:
                    assert isinstance(after, ast.Expr), f"{name} has no docstring"
                    assert isinstance(after.value, ast.Constant), f"{name} has no docstring"
                    return str(after.value.value), " ".join(ast.unparse(statement.value).split())
    raise ValueError(f"{name} is not defined by an assignment")


def _members(cls: type) -> list[tuple[str, str]]:
    return [(code(f"{name}{_shape(value)}"), cell(_summary(value))) for name, value in _documented(cls)]


def _documented(cls: type) -> list[tuple[str, Any]]:
    """Return the public methods and properties of a class that have a docstring of their own."""
    public = {name: value for name, value in vars(cls).items() if not name.startswith("_")}
    members = {name: value for name, value in public.items() if inspect.isfunction(_function(value))}
    return [(name, value) for name, value in members.items() if inspect.getdoc(_function(value))]


def _function(value: Any) -> Any:
    return getattr(value, "fget", None) or getattr(value, "func", None) or getattr(value, "__func__", value)


def _shape(value: Any) -> str:
    function = _function(value)
    return _signature(function) if function is value or hasattr(value, "__func__") else ""


def _signature(function: Callable[..., Any]) -> str:
    """Return the parameters of a function without `self`, and without annotations."""
    shown = inspect.signature(function)
    parameters = [
        parameter.replace(annotation=inspect.Parameter.empty)
        for name, parameter in shown.parameters.items()
        if name not in ("self", "cls")
    ]
    return str(shown.replace(parameters=parameters, return_annotation=inspect.Signature.empty))


def _code(text: str, language: str = "text") -> str:
    return f"```{language}\n{text}\n```"


def _text(value: object) -> str:
    """Return a docstring as Markdown, with its sections and examples as code."""
    lines, example = [], False  # an example ends with an empty line, after what it prints
    for line in (inspect.getdoc(value) or "").splitlines():
        example = bool(line) and (example or line.startswith(">>>"))
        lines.append(f"    {line}" if example else line)
    return docstring("\n".join(lines))


def _summary(value: object) -> str:
    return (inspect.getdoc(_function(value)) or "").split("\n\n")[0]
