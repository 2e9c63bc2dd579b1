"""The stages of the orchestrator import one way only."""

from __future__ import annotations

import ast
import functools
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

PRODUCT = ("components", "vocabulary", "fmus", "orchestrator", "yawbench")
ROOT = Path(__file__).parents[2]
ORCHESTRATOR = Path(__file__).parents[2] / "orchestrator"
STAGES = (
    {"errors", "messages", "signal_names", "plan", "cache", "safe_files"}
    | {"coupling_algorithms", "fault_kinds", "motion"},
    {"fork_server", "supervised_process", "workers", "interrupts"},
    {"scenario"},
    {"measured"},
    {"fmu"},
    {"wiring"},
    {"results"},
    {"metrics"},
    {"master"},  # hands rows to a recorder of `results`, has `metrics` look at them
    {"figures"},
    {"tyre_stand"},  # measures for plans what units want to know of their tyres
    {"planner"},
    {"evaluation"},
    {"experiments"},
    {"interop", "handling"},
    {"pages"},
    {"commands"},
    {"cli"},
)
"""Folders and modules, each set allowed to import those before it; a folder also itself."""
RANK = {name: rank for rank, stage in enumerate(STAGES) for name in stage}
SOURCES = sorted(ORCHESTRATOR.rglob("*.py"))


@functools.cache
def tree_of(path: Path) -> ast.Module:
    """Return what a file says."""
    return ast.parse(path.read_text(encoding="utf-8"))


@functools.cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """Return all that stands in a file, in no order."""
    return tuple(ast.walk(tree_of(path)))


def imported_by(path: Path) -> Iterator[tuple[int, str]]:
    """Yield (line, absolute dotted name) of every import of a module, also of those inside functions."""
    package = ("orchestrator", *path.relative_to(ORCHESTRATOR).parent.parts)
    for node in nodes_of(path):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            module = [*base, *([node.module] if node.module else [])]
            for alias in node.names:
                yield node.lineno, ".".join([*module, alias.name])


def stage_of(dotted: str) -> str | None:
    """Return the stage an import of the orchestrator belongs to, None of anything else."""
    parts = dotted.split(".")
    return parts[1] if parts[0] == "orchestrator" and len(parts) > 1 else None


def all_imports() -> Iterator[tuple[str, str, str]]:
    """Yield (stage of the module, file:line, what it imports)."""
    for path in SOURCES:
        relative = path.relative_to(ORCHESTRATOR)
        for line, dotted in imported_by(path):
            yield relative.parts[0].removesuffix(".py"), f"{relative}:{line}", dotted


def test_every_folder_and_module_has_a_place_among_the_stages():
    found = {path.relative_to(ORCHESTRATOR).parts[0].removesuffix(".py") for path in SOURCES}
    assert found - {"__init__"} <= set(RANK)


def test_a_module_imports_only_its_own_stage_and_those_before_it():
    backwards = []
    for own, where, dotted in all_imports():
        stage = stage_of(dotted)
        if stage is None or stage == own:
            continue
        if not (RANK[stage] < RANK[own] or RANK[stage] == RANK[own] <= 1):
            backwards.append(f"{where} imports {dotted}")
    assert backwards == []


def test_the_orchestrator_never_imports_components():
    assert [where for _, where, dotted in all_imports() if dotted.split(".")[0] == "components"] == []


def test_the_vocabulary_imports_nothing_but_the_standard_library():
    found = set()
    for path in (ROOT / "vocabulary").glob("*.py"):
        for node in nodes_of(path):
            if isinstance(node, ast.Import):
                found |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                found.add((node.module or "").partition(".")[0] if node.level == 0 else ".")
    assert found <= sys.stdlib_module_names


def modules() -> dict[str, Path]:
    """Return every module of the product by its dotted name."""
    found = {}
    for folder in PRODUCT:
        for path in sorted((ROOT / folder).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def needs(name: str, files: dict[str, Path]) -> set[str]:
    """Return the modules that a module imports, also inside functions and for its types alone."""
    path = files[name]
    package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    found = set()
    for node in nodes_of(path):
        if isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            names = [f"{module}.{alias.name}" for alias in node.names]
            found |= {one if one in files else module for one in names}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return (found & files.keys()) - {name}


def test_no_module_imports_itself_by_way_of_others():
    files = modules()
    sorter = TopologicalSorter({name: needs(name, files) for name in files})
    sorter.prepare()  # a CycleError names the circle
