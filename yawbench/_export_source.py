"""Extracts the source of a plain Python program from its module, with the modules of its own package.

Only the needed parts of the module of a function or class are copied: other functions and classes, imports,
and the current values of variables of the module and of enclosing functions, so that a script or a notebook
is not executed inside the FMU. Other modules of the same folder or package are copied completely; their
imports become relative, because an FMU must not use a module of the same name from its host.
"""

from __future__ import annotations

import ast
import builtins
import contextlib
import dis
import inspect
import math
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

from yawbench.fmus.native.read import Sources as SourceTrees
from yawbench.fmus.native.values import Refused
from yawbench.fmus.source_files import NOT_PACKED, Parts, Sources
from yawbench.foundation.errors import BuildError

from . import arguments


def refuse(text: str) -> BuildError:
    """Return the error for a program that cannot become an FMU."""
    return BuildError(text, code="component-import-forbidden")


def literal(value: Any, what: str) -> str:
    """Return a value as Python text.

    Raises:
        BuildError: it contains values other than numbers, texts and collections of them.
    """
    value = arguments.plain(value)
    if type(value) is float and not math.isfinite(value):
        return f"float({str(value)!r})"
    if value is None or type(value) in (bool, int, float, str, bytes):
        return repr(value)
    if type(value) in (list, tuple, set, frozenset):
        items = "".join(f"{literal(item, what)}, " for item in value)
        name = type(value).__name__
        return {"list": f"[{items}]", "tuple": f"({items})"}.get(name, f"{name}([{items}])")
    if type(value) is dict:
        return "{" + ", ".join(f"{literal(k, what)}: {literal(v, what)}" for k, v in value.items()) + "}"
    kind = type(value)
    name = (
        kind.__name__ if kind.__module__ == "builtins" else f"{kind.__module__.lstrip('_')}.{kind.__name__}"
    )
    raise refuse(f"{what} is of type {name}: an FMU takes along only numbers, texts and lists of them")


class Cut:
    """Part of a module that some of its functions and classes need, as the text of a new module.

    Args:
        sources: sources of the modules that it imports.
        package: package of the new module, in the package of the FMU.
        module: name of the original module.

    Attributes:
        imports: modules in the package of the FMU that it needs.
    """

    def __init__(self, sources: Sources, package: Parts, module: str) -> None:
        self.sources, self.package, self.module = sources, package, module
        self.imports: set[Parts] = set()
        self._values: dict[str, Any] = {}
        self._blocks: list[str] = []

    def text(self) -> str:
        """Return the text of the module."""
        return "\n\n".join(["from __future__ import annotations", *self._blocks]) + "\n"

    def add(self, name: str, value: Any, user: str) -> None:
        """Add the definition of a name, with everything that it needs.

        Args:
            name, value: variable of the module, or of a function that encloses its user.
            user: name of the code that needs it, for messages.

        Raises:
            BuildError: an FMU cannot contain it.
        """
        if name in self._values:
            if self._values[name] is not value and self._values[name] != value:
                raise refuse(f"{user} uses {name}, which means something else in another place: rename one")
            return
        self._values[name] = value
        if isinstance(value, ModuleType):
            self._import(f"import {value.__name__} as {name}", user)
        elif isinstance(value, (FunctionType, BuiltinFunctionType, type)):
            self._add_code(name, value, user)
        elif getattr(type(value), "__module__", "") in ("typing", "types"):
            self._blocks.append(f"from typing import {name}")
        else:
            self._blocks.append(f"{name} = {literal(value, f'{user} uses {name}, which')}")

    def _import(self, statement: str, user: str) -> None:
        node = ast.parse(statement).body[0]
        assert isinstance(node, (ast.Import, ast.ImportFrom))
        resolved = self.sources.resolve(node, self.package, user)
        for package in resolved.outside:
            raise refuse(f"{user}: imports {package}, {NOT_PACKED}")
        self.imports.update(resolved.modules)
        self._blocks.append(resolved.text or statement)

    def _add_code(self, name: str, value: Any, user: str) -> None:
        module, called = value.__module__ or "", value.__name__
        home = sys.modules.get(module)
        if module != self.module and getattr(home, called, None) is value:
            self._import(f"from {module} import {called} as {name}", user)
            return
        where = f"{user} uses {name}" if user != name else name
        if isinstance(value, BuiltinFunctionType):
            raise refuse(f"{where}, which has no source")
        block = self._class(value, where) if isinstance(value, type) else self._function(value, where)
        self._blocks.append(
            block if value.__name__ in (name, "<lambda>") else f"{block}\n\n{name} = {value.__name__}"
        )
        if value.__name__ == "<lambda>":
            self._blocks[-1] = f"{name} = {block}"

    def _function(self, function: FunctionType, where: str) -> str:
        node = self._checked(function, where)
        self._needs(function, node, where)
        if isinstance(node, ast.Lambda):
            return ast.unparse(node)
        return textwrap.dedent(inspect.getsource(function)).rstrip()

    def _class(self, cls: type, where: str) -> str:
        try:
            text = textwrap.dedent(inspect.getsource(cls)).rstrip()
        except (OSError, TypeError):
            raise refuse(f"{where}: {cls.__name__} has no source") from None
        node = ast.parse(text).body[0]
        assert isinstance(node, ast.ClassDef)
        methods = {name: m for name, m in vars(cls).items() if inspect.isfunction(getattr(m, "fget", m))}
        space = vars(sys.modules.get(cls.__module__, builtins))
        for member in methods.values():
            function = inspect.unwrap(getattr(member, "fget", None) or member)
            if function.__code__.co_filename != "<string>":  # generated by dataclasses
                self._needs(function, self._checked(function, where), where)
                space = function.__globals__
        for made in (*node.bases, *(k.value for k in node.keywords), *node.decorator_list):
            self._names(made, space, cls.__name__)
        for part in node.body:
            if isinstance(part, ast.AnnAssign):
                self._names(part.value, space, cls.__name__)
                self._annotations([part.annotation], space)
            elif not isinstance(part, (ast.FunctionDef, ast.ClassDef)):
                self._names(part, space, cls.__name__)
        return text

    @staticmethod
    def _checked(function: FunctionType, where: str) -> ast.FunctionDef | ast.Lambda:
        """Return the syntax tree of a function, if its source has not changed since the import."""
        try:
            return SourceTrees(Path("/"), Path("/")).of(function).node
        except Refused as refused:
            raise refuse(f"{where}: {refused}") from None

    def _needs(self, function: FunctionType, node: ast.FunctionDef | ast.Lambda, where: str) -> None:
        """Add everything that a function uses, at its definition and when it is called."""
        space, user = function.__globals__, function.__name__.replace("<lambda>", "the function")
        for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
            if name != "__class__":
                with contextlib.suppress(ValueError):  # not assigned
                    self.add(name, cell.cell_contents, user)
        for name in _globals_of(function.__code__):
            if name in space:
                self.add(name, space[name], user)
            elif not hasattr(builtins, name):
                raise refuse(f"{where}: {name} has no value")
        made = [
            *node.args.defaults,
            *filter(None, node.args.kw_defaults),
            *getattr(node, "decorator_list", ()),
        ]
        for part in made:
            self._names(part, space, user)
        of = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
        self._annotations([a.annotation for a in of if a.annotation], space)

    def _names(self, node: ast.AST | None, space: dict[str, Any], user: str) -> None:
        for part in ast.walk(node) if node else ():
            if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Load) and part.id in space:
                self.add(part.id, space[part.id], user)

    def _annotations(self, nodes: list[ast.expr], space: dict[str, Any]) -> None:
        """Add the names in annotations if available: annotations are texts, which only `dataclass` reads."""
        for node in nodes:
            for part in ast.walk(node):
                if isinstance(part, ast.Name) and part.id in space and part.id not in self._values:
                    value = space[part.id]
                    if getattr(value, "__module__", "") == "typing" or type(value).__module__ == "typing":
                        self.add(part.id, value, part.id)


def _globals_of(code: CodeType) -> Iterator[str]:
    """Yield the names that a function reads from its module."""
    for step in dis.get_instructions(code):
        if step.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
            yield step.argval
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _globals_of(constant)
