"""Make components into FMUs: find what has changed, build it, check it, put it in place.

    build_all(out)                       every component of the project, in Python or in C
    build_component(source, out, ...)    one from anywhere, or one with other default values

An FMU is current if it was built from the same sources, by the same builder, with the same
launcher; a key of all these stands in its archive's mark. What cannot be built keeps the FMU that
it has; who runs scenarios does not use it (see `upkeep`).
"""

from __future__ import annotations

import contextlib
import functools
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from orchestrator.errors import BuildError, Diagnostic
from orchestrator.files import draft_of, remove_draft
from orchestrator.fmu.binary import NATIVE, REASON, runs_as
from orchestrator.workers import Pool
from vocabulary.roles import ROLES

from .c.c_recipe import CRecipe, find_c_components
from .check import defects, reference_files
from .closure import Parts, Sources
from .compiler import compile_launcher
from .mark import BuildStamp, read_mark
from .native.build import LATER
from .packing import to_bytes
from .presentation import CREDITS, presented
from .recipe import TOOL, PythonRecipe, natural_name

HERE = Path(__file__).resolve().parent
COMPONENTS = HERE.parent / "components"

Recipe = PythonRecipe | CRecipe
"""One FMU that can be built."""
BuildProgress = Callable[[str, str], None]
"""Called with the name of an FMU and what became of it: built, current, removed or failed."""


@dataclass
class Report:
    """What a build did, by name of FMU."""

    built: list[str] = field(default_factory=list)
    current: list[str] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    in_python: dict[str, str] = field(default_factory=dict)  # built without a native library -> why
    warning: str = ""  # why FMUs that were built have no launcher, if they have none


def find_components(root: Path = COMPONENTS) -> dict[str, Parts]:
    """Return name of FMU -> module of every component in Python below `root`."""
    found: dict[str, Parts] = {}
    for folder in sorted(root.iterdir()):
        if folder.is_dir() and folder.name in ROLES:
            for file in sorted(folder.glob("*.py")):
                if file.name != "__init__.py":
                    module = (folder.name, file.stem)
                    found[natural_name(module)] = module
    return found


def find_recipes(root: Path = COMPONENTS) -> dict[str, Recipe]:
    """Return name of FMU -> recipe of every component below `root`."""
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
) -> Report:
    """Build the components that have changed into `out`, all or those named (names of FMUs).

    If all could be built, FMUs of components that are gone are removed.

    Raises:
        BuildError: with one sentence or more per component that cannot be built; all others are.
    """
    known = find_recipes(root)
    chosen = list(known) if components is None else list(dict.fromkeys(components))
    unknown = [name for name in chosen if name not in known]
    if unknown:
        sentences = [f"there is no component {name!r}; there are: {', '.join(known)}" for name in unknown]
        raise BuildError(sentences, code="component-unknown")
    errors: list[Diagnostic] = []
    report = Report()
    tell = progress or (lambda name, what: None)
    stale = []
    for name in chosen:
        remove_draft(out / f"{name}.fmu")
        if not force and _is_current(known[name], out / f"{name}.fmu", root):
            report.current.append(name)
            tell(name, "current")
        else:
            stale.append(name)
    for name, found in _built(stale, known, out, root):
        errors += found
        if not found:
            report.built.append(name)
        tell(name, "failed" if found else "built")
    if errors:
        raise BuildError(errors)
    report.built.sort(key=chosen.index)
    for name in report.built:
        how = runs_as(out / f"{name}.fmu")
        if how is not None and how != NATIVE:
            report.in_python[name] = how.removeprefix("Python: ")
    if any(isinstance(known[name], PythonRecipe) for name in report.built):
        report.warning = compile_launcher()[1]
    if components is None and out.is_dir():
        for fmu in sorted(out.glob("*.fmu")):
            mark = read_mark(fmu)
            if fmu.stem not in known and mark is not None and mark.is_component:
                fmu.unlink()
                report.removed.append(fmu.stem)
                tell(fmu.stem, "removed")
    return report


def _is_current(recipe: Recipe, target: Path, root: Path) -> bool:
    try:
        return read_mark(target) == replace(component_mark(recipe, root), key=recipe.key(), tool=TOOL)
    except (BuildError, OSError):
        return False


def _built(
    names: list[str], known: Mapping[str, Recipe], out: Path, root: Path
) -> Iterator[tuple[str, list[Diagnostic]]]:
    """Build components, as many at a time as there are processors; yield each with what is wrong with it."""
    if len(names) < 2 or sys.platform == "win32":
        for name in names:
            yield name, errors_of(known[name], out, root)
        return
    with Pool(preload=[__name__]) as pool:
        for finished in pool.each(_build_one, [(name, out, root) for name in names]):
            name = names[finished.number]
            lost = f"{name}: the process that built it {finished.died}"
            died = [Diagnostic("build-process-died", lost)] if finished.died else []
            if finished.error is not None:
                raise finished.error
            yield name, died or finished.value


def _build_one(name: str, out: Path, root: Path) -> list[Diagnostic]:
    """Build a component in a worker and return what is wrong with it."""
    with contextlib.redirect_stdout(sys.stderr):  # components may print while they are imported
        return errors_of(_recipes(root)[name], out, root)


_recipes = functools.cache(find_recipes)
"""`find_recipes`, once for each worker process."""


def errors_of(recipe: Recipe, out: Path, root: Path) -> list[Diagnostic]:
    """Build a component and return what is wrong with it."""
    try:
        bring_up_to_date(recipe, out / f"{recipe.name}.fmu", component_mark(recipe, root), force=True)
    except BuildError as error:
        return error.diagnostics
    return []


def component_mark(recipe: Recipe, root: Path = COMPONENTS) -> BuildStamp:
    """Return the mark of a component of the project, still without its key."""
    return BuildStamp(recipe.name, key="", source=f"components/{recipe.source.relative_to(root).as_posix()}")


def build_component(
    source: Path,
    out: Path,
    *,
    role: str | None = None,
    name: str | None = None,
    defaults: Mapping[str, Any] | None = None,
    force: bool = False,
    root: Path = COMPONENTS,
) -> Path:
    """Build one component into `out` and return the FMU.

    Args:
        source: a Python file, inside `root` or anywhere: then it imports the project's modules as
            `components.<...>` and its own neighbours as `.<neighbour>`; or the folder of a unit
            in C.
        role: folder of a role, such as "controllers"; if left out, the source's folder says it, or
            the file's name ("controller_idea.py").
        name: of the FMU; default `<role>_<file>`.
        defaults: other default values of parameters.
        root: the folder `components`.
    """
    source = source.resolve()
    recipe = recipe_of(source, role=role, name=name, defaults=defaults, root=root)
    target = out.absolute() / f"{recipe.name}.fmu"
    mark = BuildStamp(
        recipe.name,
        key="",
        source=Path(os.path.relpath(source, target.parent.resolve())).as_posix(),
        home=target.parent.name,
        role=recipe.module[0] if isinstance(recipe, PythonRecipe) else "",
        defaults=dict(defaults or {}),
    )
    bring_up_to_date(recipe, target, mark, force)
    return target


def recipe_of(
    source: Path,
    *,
    role: str | None = None,
    name: str | None = None,
    defaults: Mapping[str, Any] | None = None,
    root: Path = COMPONENTS,
) -> Recipe:
    """Return the recipe of one source (see `build_component`).

    Raises:
        BuildError: no such file, no role, or a name that is none.
    """
    if source.is_dir():
        return CRecipe(source)
    if not source.is_file():
        raise BuildError(f"{source}: there is no such file", code="component-unreadable")
    stem = source.stem
    if role is None and source.parent.name in ROLES:
        role = source.parent.name
    for folder, other in ROLES.items():
        if role in (None, folder) and stem.startswith(other.name + "_"):
            role, stem = folder, stem[len(other.name) + 1 :]
            break
    if role not in ROLES:
        raise BuildError(
            f"{source}: which role? Put it into a folder called one of: {', '.join(ROLES)}",
            code="component-without-role",
        )
    elsewhere = {} if source.is_relative_to(root) else {role: source.parent}
    sources = Sources(root, elsewhere=elsewhere)
    recipe = PythonRecipe(
        name or natural_name((role, stem)), (role, source.stem), sources, dict(defaults or {})
    )
    if not recipe.name.isidentifier() or not recipe.name.isascii():
        raise BuildError(f"{recipe.name}: the name of an FMU is made of letters, digits and _")
    return recipe


def bring_up_to_date(
    recipe: Recipe, target: Path, mark: BuildStamp, force: bool = False, *, hurry: bool = False
) -> bool:
    """Build an FMU unless it is current; return whether it was built. `mark` is still without its key.

    With `hurry`, a native library that takes long to make is left for later, and the mark says so.

    Raises:
        BuildError: each problem begins with the FMU's name.
    """
    remove_draft(target)
    try:
        mark = replace(mark, key=recipe.key(), tool=TOOL)
        if not force and read_mark(target) == mark:
            return False
        files, modules = recipe.make(hurry=hurry)
        if files.get(REASON) == LATER.encode():
            mark = mark.unfinished()
        credits = CREDITS if mark.is_component else {}
        if mark.is_component:
            target.parent.mkdir(parents=True, exist_ok=True)
            with draft_of(target, to_bytes(files, mark)) as draft:
                made = reference_files(draft, *modules)
            files |= {path: text.encode() for path, text in made.items()}
        files = presented(files, recipe.listing(), role=recipe.role, credits=credits)
        put(target, to_bytes(files, mark), *modules)
    except BuildError as error:
        raise BuildError([
            replace(one, message=f"{recipe.name}: {one.message}") for one in error.diagnostics
        ]) from None  # fmt: skip
    except OSError as error:
        raise BuildError(
            f"{recipe.name}: cannot be read or written: {error}", code="component-unreadable"
        ) from None
    return True


def put(target: Path, content: bytes, *modules: str) -> None:
    """Check an FMU, whose Python modules are called `modules`, and put it in its place in one stroke.

    Raises:
        BuildError: what is wrong with it; the place is left as it was.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    with draft_of(target, content) as draft:
        problems = defects(draft, *modules)
        if problems:
            raise BuildError(problems)
        draft.chmod(0o644)
        os.replace(draft, target)
