"""The source of a program in plain Python, cut out of its module, with the modules of its own package.

Of the module in which a function or class is written, only what it needs is taken: other functions and
classes, imports, and values of the module and of the functions around it, as they are now. So a script or a
notebook is not run again inside the FMU. Other modules of the same folder or package are taken whole; imports
of them become relative, because an FMU must not use a module of its host that has the same name.
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

from fmus.native.read import Sources
from fmus.native.values import Refused
from orchestrator.errors import BuildError

from . import arguments

OWN = "own"
"""Folder of the user's modules in the package of an FMU."""
OURS = ("components", "vocabulary")
WAYS_OUT = "an FMU must run in a Python with nothing else installed"


def refuse(text: str) -> BuildError:
    """Return the error for a program that cannot become an FMU."""
    return BuildError(text, code="component-import-forbidden")


def literal(value: Any, what: str) -> str:
    """Return a value as Python text.

    Raises:
        BuildError: it is something else than numbers, texts and collections of them.
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


class Own:
    """The user's own modules: those in the folder, or in the package, of a module.

    Attributes:
        files: path in the package of the FMU -> text of every module that is needed.
        ours: modules of yawbench that are needed, by their places.
    """

    def __init__(self, module: str, file: str | None) -> None:
        spec = getattr(sys.modules.get(module), "__spec__", None)
        parts = (spec.name if spec else module).split(".")
        self.top = parts[0]
        path = Path(file).resolve() if file and Path(file).is_file() else None
        depth = len(parts) - (0 if path and path.name == "__init__.py" else 1)
        self.root = path.parents[depth] if path else Path.cwd()
        self.installed = self.root.name in ("site-packages", "dist-packages")
        self.files: dict[str, str] = {}
        self.ours: set[tuple[str, ...]] = set()

    def place(self, module: str, line: str, *, take: bool = True) -> tuple[str, ...] | None:
        """Return the place of a module in the package of the FMU, None if it is in the standard library.

        With `take`, a module of the user is taken along.

        Raises:
            BuildError: it is of another package.
        """
        top, *rest = module.split(".")
        if top in OURS:
            self.ours.add(place := (*((top,) if top != OURS[0] else ()), *rest))
            return place
        if self._file(module.split(".")) is not None and (top == self.top or not self.installed):
            if take:
                self._take(module)
            return (OWN, *module.split("."))
        if top in sys.stdlib_module_names:
            return None
        raise refuse(
            f"{line}: imports {top}, which is neither in the standard library nor beside it; {WAYS_OUT}"
        )

    def _file(self, parts: list[str]) -> Path | None:
        folder = self.root.joinpath(*parts)
        for file in (folder / "__init__.py", folder.with_name(f"{folder.name}.py")):
            if file.is_file():
                return file
        return folder if folder.is_dir() and len(parts) > 0 and any(folder.glob("*.py")) else None

    def _take(self, module: str) -> None:
        """Take a module with what it imports; packages above it are empty unless something is imported."""
        parts = module.split(".")
        for n in range(len(parts)):
            self.files.setdefault("/".join((OWN, *parts[:n], "__init__.py")), "")
        file = self._file(parts)
        assert file is not None
        is_package = file.is_dir() or file.name == "__init__.py"
        path = "/".join((OWN, *parts)) + ("/__init__.py" if is_package else ".py")
        if self.files.get(path) or file.is_dir():
            self.files.setdefault(path, "")
            return
        try:
            text = file.read_bytes().decode("utf-8").replace("\r\n", "\n")
            tree = ast.parse(text)
        except (OSError, ValueError, SyntaxError) as error:
            raise refuse(f"{file.parent.name}/{file.name}: cannot be read: {error}") from None
        self.files[path] = text or "\n"
        package = parts if is_package else parts[:-1]
        self.files[path] = self.with_own_imports(text, tree, package, f"{file.parent.name}/{file.name}")

    def with_own_imports(self, text: str, tree: ast.AST, package: list[str], shown: str) -> str:
        """Return the text of a module in which imports of own modules are relative."""
        lines = text.split("\n")
        for node in sorted(_imports(tree), key=lambda node: node.lineno, reverse=True):
            where = f"{shown}:{node.lineno}"
            if isinstance(node, ast.ImportFrom) and node.level:
                base = package[: len(package) + 1 - node.level]
                self._take_from(".".join([*base, *(node.module or "").split(".")]).strip("."), node, where)
                continue
            new = self.import_of(node, (OWN, *package), where)
            if new is not None:
                first, last = node.lineno - 1, (node.end_lineno or node.lineno) - 1
                before, after = lines[first][: node.col_offset], lines[last][node.end_col_offset :]
                lines[first : last + 1] = [before + new + after, *[""] * (last - first)]
        return "\n".join(lines)

    def import_of(
        self, node: ast.Import | ast.ImportFrom, package: tuple[str, ...], where: str
    ) -> str | None:
        """Return an absolute import as a relative one, None if it is of the standard library."""
        dots = "." * (len(package) + 1)
        if isinstance(node, ast.ImportFrom):
            place = self._declarations(node.module or "") or self._take_from(node.module or "", node, where)
            if place is None:
                return None
            return f"from {dots}{'.'.join(place)} import {', '.join(map(ast.unparse, node.names))}"
        made = []
        for alias in node.names:
            place = self._declarations(alias.name) or self.place(alias.name, where)
            if place is None:
                made.append(f"import {ast.unparse(alias)}")
            elif alias.asname or len(place) == 2 or alias.name == "yawbench":
                bound = alias.asname or alias.name
                made.append(f"from {dots}{'.'.join(place[:-1])} import {place[-1]} as {bound}")
            else:  # binds the first name, and the others become its attributes
                made.append(f"from {dots}{place[0]} import {place[1]}")
                made.append(f"from {dots}{'.'.join(place[:-1])} import {place[-1]} as _{place[-1]}")
        return "; ".join(made) if any(text.startswith("from .") for text in made) else None

    @staticmethod
    def _declarations(module: str) -> tuple[str, ...] | None:
        """Return the place of what the library offers for declarations."""
        return ("fmi", "variables") if module == "yawbench" else None

    def _take_from(self, module: str, node: ast.ImportFrom, where: str) -> tuple[str, ...] | None:
        place = self.place(module, where, take=False)
        if place is not None and place[0] == OWN:
            for alias in node.names:
                within = f"{module}.{alias.name}"
                self._take(within if self._file(within.split(".")) is not None else module)
        return place


def _imports(tree: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    """Yield all imports that run, so none below `if TYPE_CHECKING:`."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            yield node
        elif not (isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING")):
            yield from _imports(node)


class Cut:
    """The part of a module that some of its functions and classes need, as the text of another module.

    Args:
        own: the user's own modules.
        package: of the module that is made, in the package of the FMU.
    """

    def __init__(self, own: Own, package: tuple[str, ...]) -> None:
        self.own, self.package = own, package
        self._values: dict[str, Any] = {}
        self._blocks: list[str] = []

    def text(self) -> str:
        """Return the text of the module."""
        return "\n\n".join(["from __future__ import annotations", *self._blocks]) + "\n"

    def add(self, name: str, value: Any, user: str) -> None:
        """Add what a name means, with all that it needs.

        Args:
            name, value: of the module, or of a function around its user.
            user: what needs it, for messages.

        Raises:
            BuildError: an FMU cannot take it along.
        """
        if name in self._values:
            if self._values[name] is not value and self._values[name] != value:
                raise refuse(f"{user} uses {name}, which means something else in another place: rename one")
            return
        self._values[name] = value
        if isinstance(value, ModuleType):
            imported = ast.parse(f"import {value.__name__} as {name}").body[0]
            self._import(imported, user)
        elif isinstance(value, (FunctionType, BuiltinFunctionType, type)):
            self._add_code(name, value, user)
        elif getattr(type(value), "__module__", "") in ("typing", "types"):
            self._blocks.append(f"from typing import {name}")
        else:
            self._blocks.append(f"{name} = {literal(value, f'{user} uses {name}, which')}")

    def _import(self, node: Any, user: str) -> None:
        self._blocks.append(self.own.import_of(node, self.package, user) or ast.unparse(node))

    def _add_code(self, name: str, value: Any, user: str) -> None:
        module, called = value.__module__ or "", value.__name__
        home = sys.modules.get(module)
        if module != self.module and getattr(home, called, None) is value:
            node = ast.parse(f"from {module} import {called} as {name}").body[0]
            self._import(node, user)
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

    module = ""
    """Name of the module that is cut."""

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
            if function.__code__.co_filename != "<string>":  # what dataclasses generate
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
        """Return the syntax tree of a function whose source is as it was when it was imported."""
        try:
            return Sources(Path("/"), Path("/")).of(function).node
        except Refused as refused:
            raise refuse(f"{where}: {refused}") from None

    def _needs(self, function: FunctionType, node: ast.FunctionDef | ast.Lambda, where: str) -> None:
        """Add all that a function uses: when it is made, and when it is called."""
        space, user = function.__globals__, function.__name__.replace("<lambda>", "the function")
        for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
            if name != "__class__":
                with contextlib.suppress(ValueError):  # not filled
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
        """Add what annotations name if it is at hand: they are texts, which only `dataclass` reads."""
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
