"""Source files of an FMU: the transitive closure of its imports.

Only the closure is packed and hashed, so a change of `mathematics/fuzzy.py` changes only the FMUs that use
it. Imports are read from the syntax tree, without executing code. Absolute imports must be of the standard
library, because the host's Python may have nothing else, or of packages that the component declares as
`host_packages`. All others are made relative, so that an FMU does not use a module of the same name from
another FMU or its host:

    components.<...>, vocabulary.<...>, pythonfmu.<...>    modules of this project
    yawbench                                               functions for declarations
    <...>                                                  modules of the user, see `UserModules`
"""

from __future__ import annotations

import ast
import contextlib
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import pythonfmu

from yawbench import vocabulary
from yawbench.foundation.errors import BuildError

from .source_digests import SourceDigests, content_digest

Parts = tuple[str, ...]
"""Dotted name of a module inside the package, split: ("controllers", "fnn")."""

PYTHONFMU = Path(pythonfmu.__file__).resolve().parent
"""Folder of the installed PythonFMU."""
BESIDE = {"pythonfmu": PYTHONFMU, "vocabulary": Path(vocabulary.__file__).resolve().parent}
"""Packages other than the components that are copied into FMUs -> their folders."""
DECLARATIONS = ("fmi", "variables")
"""Module of `yawbench.parameter`, `yawbench.signal` and `yawbench.output`."""
OWN = "own"
"""Package of the user's modules inside an FMU."""


class UserModules:
    """User modules that are packed into an FMU: those beside a file, and those of the file's package.

    Args:
        file: file of the component or program.
        module: its name; default: as if imported from above all folders that have an `__init__.py`.

    Attributes:
        root: folder from which the modules are imported.
        package: package of the file.
    """

    def __init__(self, file: Path, module: str | None = None) -> None:
        self.file = file
        above = [folder for folder in file.parents if not (folder / "__init__.py").is_file()]
        depth = module.count(".") + (file.name == "__init__.py") if module else 0
        self.root = file.parents[depth] if module else above[0]
        self.package: Parts = file.parent.relative_to(self.root).parts
        self._installed = self.root.name in ("site-packages", "dist-packages")

    def find(self, parts: Parts) -> Path | None:
        """Return the file of a module, or the folder of a package without `__init__.py`."""
        roots = [folder.parent for folder in self.file.parents if folder.name == parts[0]]
        if not self._installed:
            roots.insert(0, self.root)
        for root in roots:
            folder = root.joinpath(*parts)
            for file in (folder / "__init__.py", folder.with_name(f"{folder.name}.py")):
                if file.is_file():
                    return file
            if parts[0] not in sys.stdlib_module_names and any(folder.glob("*.py")):
                return folder
        return None

    def base(self, node: ast.ImportFrom) -> Parts | None:
        """Return the module to which a relative import of the file refers, None if it is not the user's."""
        depth = len(self.package) + 1 - node.level
        if depth < 0:
            return None
        base = (*self.package[:depth], *(node.module.split(".") if node.module else ()))
        known = self.find(base) if base else all(self.find((alias.name,)) for alias in node.names)
        return base if known else None


@dataclass(frozen=True)
class ResolvedImport:
    """Import statement inside an FMU.

    Attributes:
        modules: modules of the package that it needs.
        outside: packages outside the standard library that it needs.
        text: the statement with relative names; None: unchanged.
    """

    modules: tuple[Parts, ...] = ()
    outside: tuple[str, ...] = ()
    text: str | None = None


@dataclass(frozen=True)
class _Module:
    """Source file: its text, and the modules of the package that it imports."""

    text: str
    imports: tuple[tuple[Parts, str], ...]  # module, and location as file:line
    outside: tuple[tuple[str, str], ...] = ()  # packages outside the standard library, and locations
    host_packages: tuple[str, ...] = ()  # of these, those declared by the component in it
    file: Path | None = None
    digest: str = ""  # of the file's content


class Sources:
    """Source files of components, read and parsed once.

    Args:
        root: folder of the package `components`.
        user: modules of the user, for a component outside `root`.
        entry: module of the user's file inside the package.
    """

    def __init__(self, root: Path, *, user: UserModules | None = None, entry: Parts | None = None) -> None:
        self.root = root
        self.user, self.entry = user, entry
        self.evidence: dict[Parts, dict[str, str]] = {}  # module -> evidence of its closure, see `evidence`
        self._modules: dict[Parts, _Module | None] = {}

    def closure(self, module: Parts) -> dict[str, str]:
        """Return path -> text of every file that importing `module` executes, sorted.

        The `__init__.py` of a user's package is left empty unless names are imported from it, because it
        often imports modules that an FMU does not need and cannot contain.

        Raises:
            BuildError: a file is missing, cannot be parsed, or has an import that is not allowed in FMUs.
        """
        files: dict[str, str] = {}
        evidence: dict[str, str] = {}
        folders: set[Path] = set()
        waiting = [(module, "")]
        visited: set[Parts] = set()
        first = self._module(module)
        allowed = first.host_packages if first is not None else ()
        while waiting:
            parts, where = waiting.pop()
            if parts in visited:
                continue
            visited.add(parts)
            source = self._module(parts)
            if source is None:
                raise BuildError(f"{where}{self._missing(parts)}", code="component-import-forbidden")
            files[self._path(parts)] = source.text
            above = [parts[:i] for i in range(len(parts))]
            if parts[0:1] == (OWN,):
                for package in above[1:]:
                    files.setdefault("/".join((*package, "__init__.py")), "")
                above = above[:1]
            waiting += [(package, where) for package in above]
            waiting += source.imports
            for name, line in source.outside:
                if name not in allowed:
                    is_program = self.user is not None and self.entry is None
                    ways_out = "" if is_program else _WAYS_OUT.format(package=name)
                    if source.file is not None and source.file.with_name(f"{name}.py").is_file():
                        raise BuildError(
                            f"{line}: imports {name}, but {name}.py beside it is a module of its package: "
                            f"write 'from . import {name}'",
                            code="component-import-forbidden",
                        )
                    raise BuildError(
                        f"{line}: imports {name}, {NOT_PACKED}{ways_out}", code="component-import-forbidden"
                    )
            if source.file is not None:
                evidence[str(source.file)] = source.digest
                folders.add(source.file.parent)  # a new file in it may take precedence over a known file
        self.evidence[module] = evidence | SourceDigests().evidence(sorted(folders))
        return dict(sorted(files.items()))

    def _missing(self, parts: Parts) -> str:
        """Return the error message for a module that does not exist."""
        if self.user and parts[0] == OWN:
            return f"no module {'.'.join(parts[1:])} in {self.user.root}"
        if self.user and self.entry and parts[:-1] == self.entry[:-1]:
            return f"no module {parts[-1]} in {self.user.file.parent}"
        matches = [
            file.relative_to(self.root).with_suffix("") for file in self.root.glob(f"*/{parts[-1]}.py")
        ]
        suggestion = "".join(
            f"; did you mean yawbench.components.{'.'.join(file.parts)}?" for file in matches[:1]
        )
        return f"no module {'.'.join(parts)} in {self.root}{suggestion}"

    def _path(self, parts: Parts) -> str:
        """Return the path of an existing module in the package of the FMU."""
        file = self.file(parts)
        is_package = file.name == "__init__.py" or not file.is_file()
        return "/".join((*parts, "__init__") if is_package else parts) + ".py"

    def file(self, parts: Parts) -> Path:
        """Return the file of a module or package, whether or not it exists."""
        if parts and parts[0] in BESIDE:
            return _module_file(BESIDE[parts[0]], parts[1:])
        if self.user and parts == self.entry:
            return self.user.file
        if self.user and len(parts) > 1 and parts[0] == OWN:
            return self.user.find(parts[1:]) or self.user.root.joinpath(*parts[1:])
        return _module_file(self.root, parts)

    def _module(self, parts: Parts) -> _Module | None:
        """Return a module of the package, None if it does not exist."""
        if parts not in self._modules:
            file = self.file(parts)
            source = None
            if parts == ("pythonfmu",):
                source = _Module(_PYTHONFMU, ())
            elif file.is_file():
                source = self._parse(file, parts)
            elif file.is_dir() or self.root.joinpath(*parts).is_dir():
                source = _Module("", ())  # a folder without __init__.py
            self._modules[parts] = source
        return self._modules[parts]

    def _parse(self, file: Path, parts: Parts) -> _Module:
        name = _shown(file)
        try:
            content = file.read_bytes()
            text = content.decode("utf-8").replace("\r\n", "\n")
            statements, host_packages = _syntax(text)
        except SyntaxError as error:
            raise BuildError(
                f"{name}:{error.lineno}: {type(error).__name__}: {error.msg}", code="component-unreadable"
            ) from None
        except (OSError, ValueError) as error:
            raise BuildError(f"{name}: cannot be read: {error}", code="component-unreadable") from None
        package = parts if file.name == "__init__.py" else parts[:-1]
        lines = text.split("\n")
        imports: list[tuple[Parts, str]] = []
        outside: list[tuple[str, str]] = []
        for node in statements:
            where = f"{name}:{node.lineno}"
            resolved = self.resolve(node, package, where, is_entry=parts == self.entry)
            imports += [(module, f"{where}: ") for module in reversed(resolved.modules)]
            outside += [(top, where) for top in resolved.outside]
            if resolved.text is not None:
                _replace(lines, node, resolved.text)
        return _Module(
            "\n".join(lines),
            tuple(reversed(imports)),
            tuple(reversed(outside)),
            host_packages,
            file,
            content_digest(content),
        )

    def resolve(
        self, node: ast.Import | ast.ImportFrom, package: Parts, where: str, *, is_entry: bool = False
    ) -> ResolvedImport:
        """Resolve an import in a module of `package`, or in the entry; messages begin with `where`.

        Raises:
            BuildError: the import cannot be written with relative names.
        """
        if isinstance(node, ast.Import):
            return self._resolve_names(node, package, where)
        own = self.user.base(node) if self.user and is_entry and node.level else None
        base = self._base(node, package, where) if own is None else (OWN, *own)
        if base is None:
            top = _outside(node.module or "", where)
            return ResolvedImport(outside=(top,) if top else ())
        members = [(*base, alias.name) for alias in node.names]
        modules = [member for member in members if self._is_module(member)]
        if base == (OWN,):
            modules = members
        elif base[:1] != (OWN,) or len(modules) < len(members):
            modules.insert(0, base)
        names = ", ".join(map(ast.unparse, node.names))
        text = f"from {_dots(package)}{'.'.join(base)} import {names}"
        is_relative = node.level > 0 and own is None
        return ResolvedImport(tuple(modules), text=None if is_relative else text)

    def _resolve_names(self, node: ast.Import, package: Parts, where: str) -> ResolvedImport:
        """Resolve `import a, b.c as d`."""
        modules, outside, statements = [], [], []
        for alias in node.names:
            base = self._absolute(alias.name)
            is_own = base is not None and base[0:1] == (OWN,)
            if base is None or not (is_own or alias.asname or base == DECLARATIONS):
                outside += [top for top in (_outside(alias.name, where),) if top]
                statements.append(f"import {ast.unparse(alias)}")
                continue
            modules.append(base)
            dots = _dots(package)
            if alias.asname or len(base) == 2:
                name = alias.asname or alias.name
                statements.append(f"from {dots}{'.'.join(base[:-1])} import {base[-1]} as {name}")
            else:  # binds the first name; importing the submodules makes them its attributes
                statements.append(f"from {dots}{OWN} import {base[1]}")
                statements.append(f"from {dots}{'.'.join(base[:-1])} import {base[-1]} as _{base[-1]}")
        return ResolvedImport(tuple(modules), tuple(outside), "; ".join(statements) if modules else None)

    def _is_module(self, parts: Parts) -> bool:
        if self.user and parts[0] == OWN:
            return self.user.find(parts[1:]) is not None
        return self.file(parts).exists()

    def _absolute(self, module: str) -> Parts | None:
        """Return the module of the package for an absolute name, None if it is not in the package."""
        names = tuple(module.split("."))
        if names[:2] == ("yawbench", "components"):
            return names[2:]
        if names[:2] == ("yawbench", "vocabulary"):
            names = names[1:]
        if names[0] in BESIDE:
            return names if len(names) > 1 else None
        if self.user and names == ("yawbench",):
            return DECLARATIONS
        is_own = self.user and (self.user.find(names) or self.user.find(names[:1]))
        return (OWN, *names) if is_own else None

    def _base(self, node: ast.ImportFrom, package: Parts, where: str) -> Parts | None:
        """Return the module of the package to which a `from` refers, None for the standard library."""
        if node.level == 0:
            return self._absolute(node.module or "")
        if node.level > len(package) + 1:
            raise BuildError(
                f"{where}: the relative import leaves the package of the components",
                code="component-import-forbidden",
            )
        return package[: len(package) + 1 - node.level] + tuple(node.module.split(".") if node.module else ())


_PYTHONFMU = '"""The part of PythonFMU 0.7.0 (MIT licence) that runs inside an FMU."""\n'


def _module_file(folder: Path, parts: Parts) -> Path:
    package = folder.joinpath(*parts, "__init__.py")
    return package if package.exists() or not parts else folder.joinpath(*parts[:-1], parts[-1] + ".py")


def _dots(package: Parts) -> str:
    """Return the dots with which relative names begin in a module of `package`."""
    return "." * (len(package) + 1)


def _replace(lines: list[str], node: ast.Import | ast.ImportFrom, text: str) -> None:
    """Replace a statement in the lines of a module, without changing line numbers."""
    first, last = node.lineno - 1, (node.end_lineno or node.lineno) - 1
    before = lines[first].encode()[: node.col_offset].decode()
    after = lines[last].encode()[node.end_col_offset :].decode()
    if isinstance(node, ast.ImportFrom):
        module = text.partition(" import ")[0]  # imported names keep their lines and comments
        lines[first] = before + _FROM.sub(module, lines[first][len(before) :], count=1)
        return
    lines[first : last + 1] = [before + text + after, *[""] * (last - first)]


_FROM = re.compile(r"from\s+[.\w]+")


@lru_cache(maxsize=1024)  # chosen: several times the number of modules
def _syntax(text: str) -> tuple[tuple[ast.Import | ast.ImportFrom, ...], tuple[str, ...]]:
    """Return the imports of a module, last first, and the `host_packages` that it declares."""
    tree = ast.parse(text)
    imports = sorted(_imports(tree), key=lambda node: (-node.lineno, -node.col_offset))
    return tuple(imports), _declared_packages(tree)


def _imports(tree: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    """Yield all imports that are executed, that is, none below `if TYPE_CHECKING:`."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node
        elif isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            for other in node.orelse:
                yield from _imports(ast.Module([other], []))
        elif not isinstance(node, ast.expr):  # expressions contain no statements
            yield from _imports(node)


NOT_PACKED = "which is not in the standard library; an FMU must run in a Python with nothing else installed"
_WAYS_OUT = (
    '. Declare host_packages = ("{package}",) in the component if every host\'s Python has it, take an FMU '
    "from elsewhere, or run the controller as plain Python with the library `yawbench`"
)


def _outside(name: str, where: str) -> str | None:
    """Return the package of an absolute import, None if it is in the standard library."""
    top = name.partition(".")[0]
    ours = name if top == "yawbench" else f"yawbench.{name}"
    if top in ("components", *BESIDE) or ours.split(".")[1] in ("components", "vocabulary"):
        raise BuildError(
            f"{where}: write 'from {ours}{'.<module>' if ours.count('.') == 1 else ''} import ...'",
            code="component-import-forbidden",
        )
    return None if top in sys.stdlib_module_names else top


def _declared_packages(tree: ast.Module) -> tuple[str, ...]:
    """Return the `host_packages` declared by a class of a module, which must be literals."""
    for node in ast.walk(tree):
        match node:
            case ast.Assign([ast.Name("host_packages")], value) | ast.AnnAssign(
                ast.Name("host_packages"), _, ast.expr() as value
            ):
                with contextlib.suppress(ValueError, TypeError):
                    return tuple(map(str, ast.literal_eval(value)))
    return ()


def _shown(file: Path) -> str:
    """Return a file's name for messages: its folder and name."""
    return f"{file.parent.name}/{file.name}"
