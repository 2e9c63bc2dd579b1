"""Make components into FMUs: find what has changed, build it, check it, put it in place.

    build_all(out)                       every component of the project
    build_component(file, out, ...)      one file from anywhere, or one with other default values

An FMU is current if it was built from the same sources, by the same builder, with the same
launcher; a key of all these stands in its archive's comment. An FMU whose component can no longer
be built, or no longer exists, is removed, so that nobody runs yesterday's model by mistake.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from components.fmi.roles import ROLES
from orchestrator.errors import BuildError

from .archive import pack, read_mark, to_bytes
from .closure import Parts, Sources
from .compiler import compile_launcher
from .staging import PYTHONFMU, missing_signals, staged, variant

HERE = Path(__file__).resolve().parent
COMPONENTS = HERE.parent / "components"

Progress = Callable[[str, str], None]
"""Called with the name of an FMU and what became of it: built, current, removed or failed."""


@dataclass
class Report:
    """What a build did, by name of FMU."""

    built: list[str] = field(default_factory=list)
    current: list[str] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    warning: str = ""  # why the FMUs have no launcher, if they have none


@dataclass(frozen=True)
class _Recipe:
    """One FMU to be built."""

    name: str
    module: Parts
    sources: Sources
    defaults: Mapping[str, Any]
    kind: str  # "component", or "file": one that is not removed with the others

    @property
    def is_variant(self) -> bool:
        return bool(self.defaults) or self.name != natural_name(self.module)


def find_components(root: Path = COMPONENTS) -> dict[str, Parts]:
    """Return name of FMU -> module of every component below `root`."""
    found: dict[str, Parts] = {}
    for folder in sorted(root.iterdir()):
        if folder.is_dir() and folder.name in ROLES:
            for file in sorted(folder.glob("*.py")):
                if file.name != "__init__.py":
                    module = (folder.name, file.stem)
                    found[natural_name(module)] = module
    return found


def build_all(
    out: Path,
    *,
    components: Iterable[str] | None = None,
    force: bool = False,
    progress: Progress | None = None,
    root: Path = COMPONENTS,
) -> Report:
    """Build the components that have changed into `out`, all or those named (names of FMUs).

    Raises:
        BuildError: with one sentence or more per component that cannot be built; all others are.
    """
    known = find_components(root)
    chosen = list(known) if components is None else list(dict.fromkeys(components))
    unknown = [name for name in chosen if name not in known]
    if unknown:
        raise BuildError(f"there is no component {name!r}; there are: {', '.join(known)}" for name in unknown)
    problems: list[str] = []
    sources = Sources(root, pythonfmu=PYTHONFMU)
    launcher, warning = compile_launcher()
    report = Report(warning=warning)
    tell = progress or (lambda name, what: None)
    for name in chosen:
        recipe = _Recipe(name, known[name], sources, {}, "component")
        try:
            made = _bring_up_to_date(recipe, out / f"{name}.fmu", launcher, force)
        except BuildError as error:
            problems += error.problems
            if (read_mark(out / f"{name}.fmu") or "").startswith("component "):
                with contextlib.suppress(OSError):  # a folder that cannot be written is the problem told
                    (out / f"{name}.fmu").unlink()
            tell(name, "failed")
        else:
            (report.built if made else report.current).append(name)
            tell(name, "built" if made else "current")
    if components is None and out.is_dir():
        for fmu in sorted(out.glob("*.fmu")):
            if fmu.stem not in known and (read_mark(fmu) or "").startswith("component "):
                fmu.unlink()
                report.removed.append(fmu.stem)
                tell(fmu.stem, "removed")
    if problems:
        raise BuildError(problems)
    return report


def build_component(
    file: Path,
    out: Path,
    *,
    role: str | None = None,
    name: str | None = None,
    defaults: Mapping[str, Any] | None = None,
    force: bool = False,
    root: Path = COMPONENTS,
) -> Path:
    """Build the component in `file` into `out` and return the FMU.

    Args:
        file: inside `root`, or anywhere: then it imports the project's modules as
            `components.<...>` and its own neighbours as `.<neighbour>`.
        role: folder of a role, such as "controllers"; if left out, the file's folder says it, or
            the file's name ("controller_idea.py").
        name: of the FMU; default `<role>_<file>`.
        defaults: other default values of parameters.
    """
    file = file.resolve()
    if not file.is_file():
        raise BuildError(f"{file}: there is no such file")
    stem = file.stem
    if role is None and file.parent.name in ROLES:
        role = file.parent.name
    for folder, other in ROLES.items():
        if role in (None, folder) and stem.startswith(other.name + "_"):
            role, stem = folder, stem[len(other.name) + 1 :]
            break
    if role not in ROLES:
        raise BuildError(f"{file}: which role? Put it into a folder called one of: {', '.join(ROLES)}")
    elsewhere = {} if file.is_relative_to(root) else {role: file.parent}
    sources = Sources(root, pythonfmu=PYTHONFMU, elsewhere=elsewhere)
    natural = natural_name((role, stem))
    recipe = _Recipe(name or natural, (role, file.stem), sources, dict(defaults or {}), "file")
    if not recipe.name.isidentifier() or not recipe.name.isascii():
        raise BuildError(f"{recipe.name}: the name of an FMU is made of letters, digits and _")
    target = out / f"{recipe.name}.fmu"
    launcher, _ = compile_launcher()
    _bring_up_to_date(recipe, target, launcher, force)
    return target


def natural_name(module: Parts) -> str:
    """Return the name of the FMU that a module becomes: `<role>_<file>`."""
    return f"{ROLES[module[0]].name}_{module[-1]}"


def _bring_up_to_date(recipe: _Recipe, target: Path, launcher: bytes | None, force: bool) -> bool:
    """Build an FMU unless it is current; return whether it was built.

    Raises:
        BuildError: each problem begins with the FMU's name.
    """
    try:
        files = recipe.sources.closure(recipe.module)
        mark = f"{recipe.kind} {_key(recipe, files, launcher)}"
        if not force and read_mark(target) == mark:
            return False
        content, modules = _make(recipe, files, launcher, mark)
        put(target, content, *modules)
    except BuildError as error:
        raise BuildError([f"{recipe.name}: {problem}" for problem in error.problems]) from None
    except OSError as error:
        raise BuildError(f"{recipe.name}: cannot be written: {error}") from None
    return True


def _key(recipe: _Recipe, files: Mapping[str, str], launcher: bytes | None) -> str:
    """Return a hash of all that decides what the FMU's bytes are."""
    parts = [recipe.name, ".".join(recipe.module), json.dumps(dict(recipe.defaults)), _builder()]
    parts += [hashlib.sha256(launcher or b"").hexdigest(), _hash(files)]
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]


@cache
def _builder() -> str:
    """Return a hash of this builder and of what it takes from PythonFMU."""
    content = hashlib.sha256()
    theirs = [*sorted(PYTHONFMU.glob("resources/binaries/*/*")), PYTHONFMU / "builder.py"]
    for file in [*sorted(HERE.glob("*.py")), *theirs]:
        content.update(file.read_bytes())
    return content.hexdigest()


def _hash(files: Mapping[str, str]) -> str:
    content = hashlib.sha256()
    for path, text in sorted(files.items()):
        content.update(f"{path}\0{len(text)}\0{text}".encode())
    return content.hexdigest()


def _make(
    recipe: _Recipe, files: dict[str, str], launcher: bytes | None, mark: str
) -> tuple[bytes, tuple[str, str]]:
    """Return the archive of an FMU and the names of its package and its entry module."""
    module = recipe.module
    if recipe.is_variant:
        with staged(files, "yawbench_variant", "yawbench_variant_entry") as stage:
            text = variant(stage.component(module), recipe.name, recipe.defaults)
        module = (*module[:-1], f"{module[-1]}_variant")
        files = files | {"/".join(module) + ".py": text}
    version = _hash(files)[:12]
    package, entry = f"yawbench_{version}", f"{recipe.name}_{version}"
    with staged(files, package, entry) as stage:
        component = stage.component(module)
        problems = missing_signals(ROLES[module[0]], component.variables)
        if problems:
            raise BuildError(problems)
        built = stage.build(recipe.name, component)
        packed = pack(built, name=recipe.name, version=version, launcher=launcher)
    return to_bytes(packed, mark), (package, entry)


def put(target: Path, content: bytes, *modules: str) -> None:
    """Check an FMU, whose Python modules are called `modules`, and put it in its place in one stroke.

    Raises:
        BuildError: what is wrong with it; the place is left as it was.
    """
    from .check import defects  # fmpy takes its time; nobody waits for it if everything is current

    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=target.parent, prefix=".", suffix=".draft", delete=False) as draft:
        draft.write(content)
    try:
        problems = defects(Path(draft.name), *modules)
        if problems:
            raise BuildError(problems)
        os.chmod(draft.name, 0o644)
        os.replace(draft.name, target)
    finally:
        Path(draft.name).unlink(missing_ok=True)
