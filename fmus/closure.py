"""The source files that an FMU needs: the transitive closure of its imports.

Only the closure is packed and hashed, so a change of `mathematics/fuzzy.py` changes only the FMUs that use
it. Imports are read from the syntax tree; nothing is executed. Absolute imports must be of the standard
library, because the host's Python may have nothing else, or of packages that the component declares as
`host_packages`.
Three packages are allowed and their imports made relative: `components.<...>`, used by files outside this
project, and `vocabulary.<...>` and `pythonfmu.<...>`. Each FMU carries its own copy of these, so that it does
not use another FMU's version in the same process.
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
"""Packages that are copied into FMUs besides the components -> their folders."""
_ABSOLUTE = re.compile(rf"\bfrom\s+(?:components\b\.?|(?=(?:{'|'.join(BESIDE)})\.))")
"""Beginning of an import that is made relative."""


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
        self.evidence: dict[Parts, dict[str, str]] = {}  # module -> evidence of its closure, see `evidence`
        self._modules: dict[Parts, _Module | None] = {}

    def closure(self, module: Parts) -> dict[str, str]:
        """Return path -> text of every file that importing `module` executes, sorted.

        Raises:
            BuildError: a file is missing, cannot be parsed, or imports what an FMU must not.
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
                raise BuildError(
                    f"{where}no module {'.'.join(parts)} in {self.root}{self._namesake(parts)}",
                    code="component-import-forbidden",
                )
            waiting += [(parts[:i], where) for i in range(len(parts))]  # the packages above it
            is_package = self.file(parts).name == "__init__.py"
            files["/".join((*parts, "__init__") if is_package else parts) + ".py"] = source.text
            waiting += source.imports
            for package, line in source.outside:
                if package not in allowed:
                    raise BuildError(
                        f"{line}: imports {package}, {_WAYS_OUT.format(package=package)}",
                        code="component-import-forbidden",
                    )
            if source.file is not None:
                evidence[str(source.file)] = source.digest
                folders.add(source.file.parent)  # a new file in it can come before one that is known
        self.evidence[module] = evidence | SourceDigests().evidence(sorted(folders))
        return dict(sorted(files.items()))

    def _namesake(self, parts: Parts) -> str:
        """Return a suggestion, as the end of a message: a module of this name in another package."""
        matches = [
            file.relative_to(self.root).with_suffix("") for file in self.root.glob(f"*/{parts[-1]}.py")
        ]
        return "".join(f"; did you mean components.{'.'.join(file.parts)}?" for file in matches[:1])

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
            source = None
            if parts == ("pythonfmu",):
                source = _Module(_PYTHONFMU, ())
            elif file.exists():
                source = self._parse(file, parts)
            elif self.root.joinpath(*parts).is_dir() or (len(parts) == 1 and parts[0] in self.elsewhere):
                source = _Module("", ())  # a folder without __init__.py
            self._modules[parts] = source
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
                dots = "." * (len(package) + 1)  # relative, edited in the line itself
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
                f"{where}: the relative import leaves the package of the components",
                code="component-import-forbidden",
            )
        return package[: len(package) + 1 - node.level] + names


_PYTHONFMU = '"""The part of PythonFMU 0.7.0 (MIT licence) that runs inside an FMU."""\n'


def _module_file(folder: Path, parts: Parts) -> Path:
    package = folder.joinpath(*parts, "__init__.py")
    return package if package.exists() or not parts else folder.joinpath(*parts[:-1], parts[-1] + ".py")


def _imports(tree: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    """Yield all imports that run, so none below `if TYPE_CHECKING:`."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node
        elif isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            for other in node.orelse:
                yield from _imports(ast.Module([other], []))
        else:
            yield from _imports(node)


_WAYS_OUT = (
    "which is not in the standard library; an FMU must run in a Python with nothing else installed. "
    'Declare host_packages = ("{package}",) in the component if every host\'s Python has it, take an FMU '
    "from elsewhere, or run the controller as plain Python with the library `yawbench`"
)


def _outside(name: str, where: str) -> str | None:
    """Return the package of an absolute import, None if it is in the standard library."""
    top = name.partition(".")[0]
    if top in ("components", *BESIDE):
        raise BuildError(
            f"{where}: write 'from {name}{'.<module>' if name == top else ''} import ...'",
            code="component-import-forbidden",
        )
    return None if top in sys.stdlib_module_names else top


def _declared_packages(tree: ast.Module) -> tuple[str, ...]:
    """Return the `host_packages` that a class of a module declares, which must be literals."""
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
