"""Imports go one way, from layer to layer; wings can be taken off; the table is the picture in the docs."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from yawbench import parts

ROOT = Path(__file__).parents[1]
LAYERS = (
    "vocabulary",
    "components",
    "foundation",
    "fmus",
    "orchestrator",
    "yawbench.measurements",
    "yawbench.vehicles",
    "yawbench.metrics",
    "yawbench.scene",
    "yawbench.events",
    "yawbench.figures",
    "yawbench.tyre_stand",
    "yawbench.planner",
    "yawbench.proving_ground",
    "yawbench.studies",
    "yawbench.reports",
    "yawbench.commands",
    "yawbench",
)
"""Folders, and modules of the bench, each of which imports only itself and those before it."""
WINGS = (*parts.WINGS, *parts.IMPORTED)
"""Folders that no other module imports; each may import all layers."""
OUTERMOST = ("yawbench.cli", "yawbench.__main__")
"""Modules that no other module imports but by running them."""


def module_files() -> dict[str, Path]:
    """Return every module as it is imported, without the links: dotted name -> file."""
    found = {}
    for folder in ("vocabulary", "components", "foundation", "fmus", "orchestrator", "yawbench"):
        for path in (ROOT / folder).rglob("*.py"):
            parts = path.relative_to(ROOT).with_suffix("").parts
            if folder == "yawbench" and len(parts) > 2 and (ROOT / "yawbench" / parts[1]).is_symlink():
                continue
            package = parts if folder == "yawbench" else ("yawbench", *parts)
            found[".".join(package[:-1] if package[-1] == "__init__" else package)] = path
    return found


FILES = module_files()


def tree_of(module: str) -> ast.Module:
    """Return the syntax tree of a module."""
    return ast.parse(FILES[module].read_text(encoding="utf-8"))


@cache
def imports_of(module: str) -> list[tuple[int, str]]:
    """Return line and name of every module of ours that a module imports, also in functions and for types."""
    found: list[tuple[int, str]] = []
    package = module.split(".")
    if FILES[module].name != "__init__.py":
        package.pop()
    for node in ast.walk(tree_of(module)):
        if isinstance(node, ast.Import):
            found += ((node.lineno, alias.name) for alias in node.names if alias.name in FILES)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            name = ".".join([*base, *([node.module] if node.module else [])])
            for alias in node.names:
                whole = f"{name}.{alias.name}"
                if whole in FILES or name in FILES:
                    found.append((node.lineno, whole if whole in FILES else name))
    return found


def layer_of(module: str) -> str:
    """Return the layer, wing or outermost module that a module belongs to."""
    inner = module.removeprefix("yawbench.")
    for name in sorted((*LAYERS, *WINGS, *OUTERMOST), key=len, reverse=True):
        for candidate in (module, inner):
            if name != "yawbench" and (candidate == name or candidate.startswith(f"{name}.")):
                return name
    return "yawbench"


def test_a_module_imports_only_its_own_layer_and_those_before_it():
    wrong = []
    for module in FILES:
        own = layer_of(module)
        for line, imported in imports_of(module):
            other = layer_of(imported)
            below = (
                other == own
                or ((own in WINGS or own in OUTERMOST) and other in LAYERS)
                or (own in LAYERS and other in LAYERS and LAYERS.index(other) < LAYERS.index(own))
                or (other in ("yawbench", "yawbench.cli") and own == "yawbench.__main__")
            )
            if not below and module != "yawbench":  # which names the types of wings for type checkers
                wrong.append(f"{FILES[module].relative_to(ROOT)}:{line} imports {imported}")
    assert wrong == []


def test_no_module_imports_itself_by_way_of_others():
    needs = {module: {name for _, name in imports_of(module)} - {module} for module in FILES}
    del needs["yawbench"]  # see above
    sorter = TopologicalSorter(needs)
    sorter.prepare()  # a CycleError names the circle


def test_folders_beside_the_package_are_imported_as_its_parts_alone():
    """`import orchestrator` would load every module of it a second time."""
    folders = "components|foundation|fmus|orchestrator|scenarios|vocabulary"
    whole = re.compile(rf"^ *(?:import|from) (?:{folders})\b.*", re.MULTILINE)
    beside = (f for room in ("tests", "campaigns", "benchmarks", "docs") for f in (ROOT / room).rglob("*.py"))
    found = {
        str(path): whole.findall(path.read_text(encoding="utf-8")) for path in (*FILES.values(), *beside)
    }
    assert {path: lines for path, lines in found.items() if lines} == {}


@pytest.mark.parametrize("layer", ["vocabulary", "components"])
def test_what_runs_inside_fmus_needs_the_standard_library_alone(layer):
    foreign = set()
    for module in FILES:
        if layer_of(module) == layer:
            for node in ast.walk(tree_of(module)):
                names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
                names += [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
                foreign |= {name.split(".")[0] for name in names}
    assert foreign - sys.stdlib_module_names <= {"yawbench", "pythonfmu"}


def test_the_orchestrator_knows_no_car():
    """A `Domain` tells of signals, quantities and files of cars; facts and roles are names of scenarios."""
    known = {
        imported
        for module in FILES
        if layer_of(module) == "orchestrator"
        for _, imported in imports_of(module)
        if layer_of(imported) == "vocabulary"
    }
    assert known == {"yawbench.vocabulary.facts", "yawbench.vocabulary.roles"}


def test_a_run_imports_nothing_that_draws_judges_or_makes_many_runs(tmp_path):
    program = (
        "import sys; from yawbench.cli import main\n"
        "try: main(['run', 'fnn_sideslip/25mps', '--set', 'stop_time=0.1', '--out', sys.argv[1]])\n"
        "except SystemExit: print(*sorted(sys.modules), file=sys.stderr)"
    )
    command = [sys.executable, "-c", program, str(tmp_path / "run")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    loaded = {layer_of(name) for name in done.stderr.split() if name in FILES}
    assert {"orchestrator", "yawbench.metrics", "yawbench.commands"} <= loaded
    modules = {name for name in done.stderr.split() if "." in name.removeprefix("yawbench.")}
    late = [f"yawbench.{room}" for room in ("figures", "proving_ground", "studies", "reports", "tyre_stand")]
    assert not {name for name in modules if name.startswith(tuple(f"{room}." for room in (*late, *WINGS)))}
    assert not modules & {*late}


def test_the_picture_in_the_docs_has_the_layers_in_this_order():
    text = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    picture = text.partition("## The picture")[2].partition("\n## ")[0]
    rows = re.findall(r"^    ([\w./]+)  ", picture, re.MULTILINE)
    drawn = [row.rstrip("/").replace("/", ".").removesuffix(".py") for row in rows]
    assert [name for name in drawn if name in LAYERS] == list(LAYERS)
    assert {name for name in drawn if name in WINGS} == set(WINGS)
