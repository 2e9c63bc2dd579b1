"""Which source files one FMU needs: the transitive closure of its imports, and nothing more.

Only the closure is packed and only the closure is hashed, so touching `mathematics/fuzzy.py` changes the
FMUs that use it and no other. Imports are read from the syntax tree; nothing is executed. Every
absolute import must be of the standard library, because the host's Python may have nothing else, or
of what the component declares as its `host_packages`.
Three are allowed and made relative: `components.<...>`, as a file outside this project writes it, and
`vocabulary.<...>` and `pythonfmu.<...>`, of which each FMU carries its own copy, so that another FMU's
version of them in the same process cannot come between.
"""

from __future__ import annotations

import ast
import contextlib
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import pythonfmu

import vocabulary
from orchestrator.errors import BuildError

from .evidence import SourceDigests, content_digest

Parts = tuple[str, ...]
"""A module's dotted name inside the package, split: ("controllers", "fnn")."""

PYTHONFMU = Path(pythonfmu.__file__).resolve().parent
"""Folder of the installed PythonFMU."""
BESIDE = {"pythonfmu": PYTHONFMU, "vocabulary": Path(vocabulary.__file__).resolve().parent}
"""Package that an FMU carries a copy of beside the components -> its folder."""
_ABSOLUTE = re.compile(rf"\bfrom\s+(?:components\b\.?|(?=(?:{'|'.join(BESIDE)})\.))")
"""How an import begins that is made relative."""


@dataclass(frozen=True)
class _Module:
    """One source file: its text, and the modules of the package it imports."""

    text: str
    imports: tuple[tuple[Parts, str], ...]  # and where: file:line
    outside: tuple[tuple[str, str], ...] = ()  # packages outside the standard library, and where
    host_packages: tuple[str, ...] = ()  # of these, those that the component in it declares
    file: Path | None = None
    digest: str = ""  # of the file's content


class Sources:
    """The source files of components, read and parsed once.

    Args:
        root: folder of the package `components`.
        elsewhere: folder of the package -> a folder outside of `root` whose files come first.
    """

    def __init__(self, root: Path, *, elsewhere: Mapping[str, Path] | None = None) -> None:
        self.root = root
        self.elsewhere = dict(elsewhere or {})
        self.evidence: dict[Parts, dict[str, str]] = {}  # of a closure that has been found: see `evidence`
        self._modules: dict[Parts, _Module | None] = {}

    def closure(self, module: Parts) -> dict[str, str]:
        """Return path -> text of every file that importing `module` executes, sorted.

        Raises:
            BuildError: a file that is missing, cannot be parsed or imports what no FMU may.
        """
        files: dict[str, str] = {}
        evidence: dict[str, str] = {}
        folders: set[Path] = set()
        waiting = [(module, "")]
        seen: set[Parts] = set()
        first = self._module(module)
        allowed = first.host_packages if first is not None else ()
        while waiting:
            parts, where = waiting.pop()
            if parts in seen:
                continue
            seen.add(parts)
            found = self._module(parts)
            if found is None:
                raise BuildError(
                    f"{where}there is no module {'.'.join(parts)} in {self.root}{self._namesake(parts)}",
                    code="component-import-forbidden",
                )
            waiting += [(parts[:i], where) for i in range(len(parts))]  # the packages above it
            is_package = self.file(parts).name == "__init__.py"
            files["/".join((*parts, "__init__") if is_package else parts) + ".py"] = found.text
            waiting += found.imports
            for package, line in found.outside:
                if package not in allowed:
                    raise BuildError(
                        f"{line}: imports {package}, {_WAYS_OUT.format(package=package)}",
                        code="component-import-forbidden",
                    )
            if found.file is not None:
                evidence[str(found.file)] = found.digest
                folders.add(found.file.parent)  # a new file in it can come before one that is known
        self.evidence[module] = evidence | SourceDigests().evidence(sorted(folders))
        return dict(sorted(files.items()))

    def _namesake(self, parts: Parts) -> str:
        """Return where a module of this name stands, as the end of a sentence; names are used once."""
        found = [file.relative_to(self.root).with_suffix("") for file in self.root.glob(f"*/{parts[-1]}.py")]
        return "".join(f"; did you mean components.{'.'.join(file.parts)}?" for file in found[:1])

    def file(self, parts: Parts) -> Path:
        """Return the file of a module or package, whether or not it exists."""
        if parts and parts[0] in BESIDE:
            return _module_file(BESIDE[parts[0]], parts[1:])
        if len(parts) > 1 and parts[0] in self.elsewhere:
            file = _module_file(self.elsewhere[parts[0]], parts[1:])
            if file.exists():
                return file
        return _module_file(self.root, parts)

    def _module(self, parts: Parts) -> _Module | None:
        """Return a module of the package, None if there is none."""
        if parts not in self._modules:
            file = self.file(parts)
            found = None
            if parts == ("pythonfmu",):
                found = _Module(_PYTHONFMU, ())
            elif file.exists():
                found = self._parse(file, parts)
            elif self.root.joinpath(*parts).is_dir() or (len(parts) == 1 and parts[0] in self.elsewhere):
                found = _Module("", ())  # a folder without __init__.py
            self._modules[parts] = found
        return self._modules[parts]

    def _parse(self, file: Path, parts: Parts) -> _Module:
        name = _shown(file)
        try:
            content = file.read_bytes()
            text = content.decode("utf-8").replace("\r\n", "\n")
            tree = ast.parse(text)
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
        for node in _imports(tree):
            where = f"{name}:{node.lineno}"
            if isinstance(node, ast.Import):
                outside += [(top, where) for alias in node.names if (top := _outside(alias.name, where))]
                continue
            base = self._base(node, package, where)
            if base is None:
                outside += [(top, where)] if (top := _outside(node.module or "", where)) else []
                continue
            if node.level == 0:
                dots = "." * (len(package) + 1)  # relative, in the line as it stands
                lines[node.lineno - 1] = _ABSOLUTE.sub(f"from {dots}", lines[node.lineno - 1], 1)
            modules = [base] + [(*base, a.name) for a in node.names if self.file((*base, a.name)).exists()]
            imports += [(module, f"{where}: ") for module in modules]
        return _Module(
            "\n".join(lines),
            tuple(imports),
            tuple(outside),
            _declared_packages(tree),
            file,
            content_digest(content),
        )

    def _base(self, node: ast.ImportFrom, package: Parts, where: str) -> Parts | None:
        """Return the module of the package that a `from` imports from, None for the standard library."""
        names = tuple(node.module.split(".")) if node.module else ()
        if node.level == 0:
            if names[0] == "components":
                return names[1:]
            if names[0] in BESIDE and len(names) > 1:
                return names
            return None
        if node.level > len(package) + 1:
            raise BuildError(
                f"{where}: the relative import goes beyond the package of the components",
                code="component-import-forbidden",
            )
        return package[: len(package) + 1 - node.level] + names


_PYTHONFMU = '"""The part of PythonFMU 0.7.0 (MIT licence) that runs inside an FMU."""\n'


def _module_file(folder: Path, parts: Parts) -> Path:
    package = folder.joinpath(*parts, "__init__.py")
    return package if package.exists() or not parts else folder.joinpath(*parts[:-1], parts[-1] + ".py")


def _imports(tree: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    """Yield every import that runs, so none below `if TYPE_CHECKING:`."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node
        elif isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            for other in node.orelse:
                yield from _imports(ast.Module([other], []))
        else:
            yield from _imports(node)


_WAYS_OUT = (
    "which is outside the standard library; an FMU must run in a Python that has nothing else installed. "
    'Declare host_packages = ("{package}",) in the component if every host\'s Python has it, take an FMU '
    "from elsewhere, or run the controller as plain Python with the library `yawbench`"
)


def _outside(name: str, where: str) -> str | None:
    """Return the package that an absolute import needs beyond the standard library, if it does."""
    top = name.partition(".")[0]
    if top in ("components", *BESIDE):
        raise BuildError(
            f"{where}: write 'from {name}{'.<module>' if name == top else ''} import ...'",
            code="component-import-forbidden",
        )
    return None if top in sys.stdlib_module_names else top


def _declared_packages(tree: ast.Module) -> tuple[str, ...]:
    """Return what the classes of a module declare as `host_packages`, which must be written out."""
    for node in ast.walk(tree):
        match node:
            case ast.Assign([ast.Name("host_packages")], value) | ast.AnnAssign(
                ast.Name("host_packages"), _, ast.expr() as value
            ):
                with contextlib.suppress(ValueError, TypeError):
                    return tuple(map(str, ast.literal_eval(value)))
    return ()


def _shown(file: Path) -> str:
    """Return a file's name as messages give it: the last folder and the file."""
    return f"{file.parent.name}/{file.name}"
