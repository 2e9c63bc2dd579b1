"""Builds FMUs from components: finds changed components, builds, checks and installs their FMUs.

    build_all(out)                       all components of the project, in Python or in C
    build_component(source, out, ...)    any component, optionally with other default values

An FMU is current if it was built from the same sources by the same builder, whichever compiler was
installed; a key of these is in the stamp of its archive. One that lacks its native library for want of a
compiler is built again when there is one. If a component cannot be built, its old FMU is kept, but runs do
not use it (see `rebuild_stale`).
"""

from __future__ import annotations

import contextlib
import functools
import os
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from yawbench.foundation.errors import BuildError, Diagnostic
from yawbench.foundation.safe_files import write_whole
from yawbench.foundation.workers import Pool
from yawbench.vocabulary.roles import ROLES

from .archive import runs_as
from .build_stamp import PLAIN, BuildStamp, Edition, read_stamp
from .c.c_recipe import CRecipe, find_c_components
from .check import defects, reference_files
from .compiler import TO_WINDOWS, Platform, can_compile, compile_launcher
from .fmi3_archive import ONLY_FMI2, to_fmi3
from .packing import python_libraries, to_bytes
from .presentation import CREDITS, presented
from .recipe import TOOL, PythonRecipe, natural_name
from .source_files import Parts, Sources, UserModules

HERE = Path(__file__).resolve().parent
COMPONENTS = HERE.parent / "components"

Recipe = PythonRecipe | CRecipe
"""Instructions for building an FMU, by the language of its component."""
BuildProgress = Callable[[str, str], None]
"""Called with the name of an FMU and its outcome: built, current, removed or failed."""


@dataclass
class Report:
    """Outcome of a build: names of FMUs."""

    built: list[str] = field(default_factory=list)
    current: list[str] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    in_python: dict[str, str] = field(default_factory=dict)  # built without a native library -> why
    notes: dict[str, str] = field(default_factory=dict)  # native -> what of it was never compared with Python
    warning: str = ""  # reason if the FMUs have no launcher
    only_fmi2: dict[str, str] = field(default_factory=dict)  # not built as FMI 3.0 -> why
    not_on_windows: list[str] = field(
        default_factory=list
    )  # native here, without a native library for Windows


def find_components(root: Path = COMPONENTS) -> dict[str, Parts]:
    """Return the Python components below `root`, as name of FMU -> module."""
    modules: dict[str, Parts] = {}
    for folder in sorted(root.iterdir()):
        if folder.is_dir() and folder.name in ROLES:
            for file in sorted(folder.glob("*.py")):
                if file.name != "__init__.py":
                    module = (folder.name, file.stem)
                    modules[natural_name(module)] = module
    return modules


def find_recipes(root: Path = COMPONENTS) -> dict[str, Recipe]:
    """Return the recipes of all components below `root`, by name of FMU."""
    sources = Sources(root)
    in_python = {name: PythonRecipe(name, module, sources) for name, module in find_components(root).items()}
    return in_python | {name: CRecipe(folder) for name, folder in find_c_components(root).items()}


def build_all(
    out: Path,
    *,
    components: Iterable[str] | None = None,
    force: bool = False,
    progress: BuildProgress | None = None,
    root: Path = COMPONENTS,
    edition: Edition = PLAIN,
) -> Report:
    """Build changed components into `out`: all, or those with the given FMU names.

    If all are built without errors, FMUs whose components no longer exist are removed.

    Raises:
        BuildError: some components cannot be built; all others are built.
    """
    known = find_recipes(root)
    chosen = list(known) if components is None else list(dict.fromkeys(components))
    unknown = [name for name in chosen if name not in known]
    if unknown:
        sentences = [f"there is no component {name!r}; there are: {', '.join(known)}" for name in unknown]
        raise BuildError(sentences, code="component-unknown")
    errors: dict[str, list[Diagnostic]] = {}
    report = Report()
    report_progress = progress or (lambda name, what: None)
    stale = []
    for name in chosen:
        if not force and _is_current(known[name], out / f"{name}.fmu", root, edition):
            report.current.append(name)
            report_progress(name, "current")
        else:
            stale.append(name)
    for name, problems in _built(stale, known, out, root, edition):
        if [problem.code for problem in problems] == [ONLY_FMI2]:
            report.only_fmi2[name] = problems[0].message
            continue
        if problems:
            errors[name] = problems
        else:
            report.built.append(name)
        report_progress(name, "failed" if problems else "built")
    if errors:
        raise BuildError([error for name in chosen for error in errors.get(name, [])])
    report.built.sort(key=chosen.index)
    for name in report.built:
        how = runs_as(out / f"{name}.fmu")
        if how is not None and not how.native:
            report.in_python[name] = how.why
        elif how is not None and how.note:
            report.notes[name] = how.note
        if not has_native_library(out / f"{name}.fmu", TO_WINDOWS):
            report.not_on_windows.append(name)
    if edition.fmi == 2 and any(isinstance(known[name], PythonRecipe) for name in report.built):
        report.warning = compile_launcher()[1]
    if components is None and out.is_dir():
        for fmu in sorted(out.glob("*.fmu")):
            stamp = read_stamp(fmu)
            if fmu.stem not in known and stamp is not None and stamp.is_component:
                fmu.unlink()
                report.removed.append(fmu.stem)
                report_progress(fmu.stem, "removed")
    return report


def _is_current(recipe: Recipe, target: Path, root: Path, edition: Edition) -> bool:
    try:
        stamp = replace(component_stamp(recipe, root, edition), key=recipe.key(), tool=TOOL)
        return _suffices(read_stamp(target), stamp, hurry=False)
    except (BuildError, OSError):
        return False


def _suffices(present: BuildStamp | None, wanted: BuildStamp, *, hurry: bool) -> bool:
    """Return whether an FMU has all that is wanted, but for a native library that it cannot have now."""
    if present is None:
        return False
    wanted = replace(wanted, edition=wanted.edition | present.edition)
    return present == wanted or (present == wanted.unfinished() and (hurry or not can_compile()))


def _built(
    names: list[str], known: Mapping[str, Recipe], out: Path, root: Path, edition: Edition
) -> Iterator[tuple[str, list[Diagnostic]]]:
    """Build components in parallel; yield each name with its errors, in the order of the names."""
    if len(names) < 2 or sys.platform == "win32":
        for name in names:
            yield name, errors_of(known[name], out, root, edition)
        return
    ended: dict[int, list[Diagnostic]] = {}
    due = 0
    with Pool(preload=[__name__]) as pool:
        for finished in pool.each(_build_one, [(name, out, root, edition) for name in names]):
            name = names[finished.number]
            lost = f"{name}: the process that built it {finished.died}"
            died = [Diagnostic("build-process-died", lost)] if finished.died else []
            if finished.error is not None:
                raise finished.error
            ended[finished.number] = died or finished.value
            while due in ended:
                yield names[due], ended.pop(due)
                due += 1


def _build_one(name: str, out: Path, root: Path, edition: Edition) -> list[Diagnostic]:
    """Build a component in a worker process and return its errors."""
    with contextlib.redirect_stdout(sys.stderr):  # components may print while they are imported
        return errors_of(_recipes(root)[name], out, root, edition)


_recipes = functools.cache(find_recipes)
"""`find_recipes`, cached in each worker process."""


def errors_of(recipe: Recipe, out: Path, root: Path, edition: Edition = PLAIN) -> list[Diagnostic]:
    """Build a component and return its errors."""
    try:
        stamp = component_stamp(recipe, root, edition)
        bring_up_to_date(recipe, out / f"{recipe.name}.fmu", stamp, force=True)
    except BuildError as error:
        return error.diagnostics
    return []


def component_stamp(recipe: Recipe, root: Path = COMPONENTS, edition: Edition = PLAIN) -> BuildStamp:
    """Return the stamp of a component of the project, without its key."""
    source = f"components/{recipe.source.relative_to(root).as_posix()}"
    return BuildStamp(recipe.name, key="", source=source, edition=edition)


def has_native_library(fmu: Path, platform: Platform) -> bool:
    """Return whether an FMU built here has a native library for a platform."""
    with zipfile.ZipFile(fmu) as archive:
        library = f"{fmu.stem}{platform.suffix}"
        folders = (platform.name, platform.folder)
        found = [path for f in folders if (path := f"binaries/{f}/{library}") in archive.namelist()]
        return any(archive.read(path) not in python_libraries() for path in found)


def build_component(
    source: Path,
    out: Path,
    *,
    role: str | None = None,
    name: str | None = None,
    defaults: Mapping[str, Any] | None = None,
    force: bool = False,
    root: Path = COMPONENTS,
    edition: Edition = PLAIN,
) -> Path:
    """Build a component into `out` and return the FMU.

    Args:
        source: a Python file inside or outside `root`, or the folder of a component in C. A file
            outside imports the project's modules as `components.<...>`, and those of its own folder or
            package by relative or absolute names.
        role: folder of a role, such as "controllers"; default: that of the source's folder or of the
            file's name ("controller_idea.py").
        name: name of the FMU; default `<role>_<file>`.
        defaults: other default values of parameters.
        root: the folder `components`.
        edition: version of FMI and contents.
    """
    source = source.resolve()
    recipe = recipe_of(source, role=role, name=name, defaults=defaults, root=root)
    target = out.absolute() / f"{recipe.name}.fmu"
    stamp = BuildStamp(
        recipe.name,
        key="",
        source=Path(os.path.relpath(source, target.parent.resolve())).as_posix(),
        home=target.parent.resolve().name,
        role=recipe.module[0] if isinstance(recipe, PythonRecipe) else "",
        defaults=dict(defaults or {}),
        edition=edition,
    )
    bring_up_to_date(recipe, target, stamp, force)
    return target


def recipe_of(
    source: Path,
    *,
    role: str | None = None,
    name: str | None = None,
    defaults: Mapping[str, Any] | None = None,
    root: Path = COMPONENTS,
) -> Recipe:
    """Return the recipe of a source (see `build_component`).

    Raises:
        BuildError: the file does not exist, has no role, or the name is invalid.
    """
    if source.is_dir():
        return CRecipe(source)
    if not source.is_file():
        raise BuildError(f"{source}: no such file", code="component-unreadable")
    stem = source.stem
    if role is None and source.parent.name in ROLES:
        role = source.parent.name
    for folder, other in ROLES.items():
        if role in (None, folder) and stem.startswith(other.name + "_"):
            role, stem = folder, stem[len(other.name) + 1 :]
            break
    if role not in ROLES:
        raise BuildError(
            f"{source}: has no role: put it into a folder with one of the names {', '.join(ROLES)}",
            code="component-without-role",
        )
    module = (role, source.stem)
    for above in source.parents:  # a component of a checkout is built with the modules of that checkout
        if above.name == root.name and (above / "fmi" / "component.py").is_file():
            root = above
    user = None if source.is_relative_to(root) else UserModules(source)
    sources = Sources(root, user=user, entry=module)
    recipe = PythonRecipe(name or natural_name((role, stem)), module, sources, dict(defaults or {}))
    if not recipe.name.isidentifier() or not recipe.name.isascii():
        raise BuildError(f"{recipe.name}: the name of an FMU may contain letters, digits and _ only")
    return recipe


def bring_up_to_date(
    recipe: Recipe, target: Path, stamp: BuildStamp, force: bool = False, *, hurry: bool = False
) -> bool:
    """Build an FMU unless it is current; return whether it was built. `stamp` comes without its key.

    What the present FMU has beyond the wanted edition is kept. With `hurry`, a native library that takes long
    to build is postponed, and the stamp records that.

    Raises:
        BuildError: each problem begins with the FMU's name.
    """
    try:
        stamp = replace(stamp, key=recipe.key(), tool=TOOL)
        present = read_stamp(target)
        if not force and _suffices(present, stamp, hurry=hurry):
            return False
        if present is not None and not force:
            stamp = replace(stamp, edition=stamp.edition | present.edition)
        made = recipe.make(hurry=hurry and stamp.edition.fmi == 2, edition=stamp.edition)
        files, modules = made.files, made.modules
        if made.later:
            stamp = stamp.unfinished()
        credits = CREDITS if stamp.is_component else {}
        if stamp.is_component:
            target.parent.mkdir(parents=True, exist_ok=True)
            with _draft(target, to_bytes(files, stamp)) as draft:
                reference = reference_files(draft, *modules)
            files |= {path: text.encode() for path, text in reference.items()}
        files = presented(files, recipe.listing(), role=recipe.role, credits=credits)
        put(target, to_bytes(to_fmi3(files) if stamp.edition.fmi == 3 else files, stamp), *modules)
    except BuildError as error:
        raise BuildError([
            replace(diagnostic, message=f"{recipe.name}: {diagnostic.message}")
            for diagnostic in error.diagnostics
        ]) from None  # fmt: skip
    except OSError as error:
        raise BuildError(
            f"{recipe.name}: cannot be read or written: {error}", code="component-unreadable"
        ) from None
    return True


def put(target: Path, content: bytes, *modules: str) -> None:
    """Check an FMU with the Python modules `modules`, and move it to its place atomically.

    Raises:
        BuildError: the FMU is defective; an existing FMU is not changed.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    with _draft(target, content) as draft:
        if problems := defects(draft, *modules):
            raise BuildError(problems)
    write_whole(target, content)


@contextlib.contextmanager
def _draft(target: Path, content: bytes) -> Iterator[Path]:
    """Write the content of an FMU to a temporary folder, to be checked before it replaces the FMU."""
    with tempfile.TemporaryDirectory(prefix="yawbench-build-") as folder:
        draft = Path(folder) / target.name
        draft.write_bytes(content)
        yield draft
