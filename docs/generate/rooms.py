"""Pages of the rooms of the code: what each is for, its modules, what it may import, where its tests are."""

from __future__ import annotations

import ast
import inspect
from functools import partial
from pathlib import Path

from tests.test_layers import LAYERS, WINGS

from .text import NOTE, cell, code, docstring, table

ROOT = Path(__file__).resolve().parents[2]
INNER = ("fmus", "orchestrator")
"""Rooms with rooms in them."""


def rooms() -> list[str]:
    """Return the rooms as folders, in the order in which they may be imported."""
    folders = [name.replace(".", "/") for name in (*LAYERS, *WINGS) if name != "yawbench"]
    found = [folder for folder in folders if (ROOT / folder).is_dir()]
    return [inner for folder in found for inner in (folder, *_inner(folder))]


def _inner(folder: str) -> list[str]:
    if folder not in INNER:
        return []
    packages = sorted(path.parent for path in (ROOT / folder).glob("*/__init__.py"))
    return [path.relative_to(ROOT).as_posix() for path in packages]


def page(room: str) -> str:
    """Return the page of a room."""
    modules = sorted(path for path in (ROOT / room).glob("*.py") if path.stem != "__init__")
    return "\n".join([
        f"# {room}/",
        NOTE,
        "",
        docstring(_doc(ROOT / room / "__init__.py")),
        f"**May import** {_imports(room)}. **Tests**: {_tests(room)}.",
        "",
        table(
            ["module", "what it has"],
            [[code(path.name), cell(_doc(path).partition("\n")[0].rstrip("."))] for path in modules],
        ),
    ])  # fmt: skip


def _doc(file: Path) -> str:
    return inspect.cleandoc(ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "")


def _imports(room: str) -> str:
    """Return what the test of layers lets a room import."""
    if room.replace("/", ".") in WINGS:
        return "every room but other wings; nothing imports it"
    layer = next(name for name in LAYERS if f"{room}/".startswith(f"{name.replace('.', '/')}/"))
    before = LAYERS[: LAYERS.index(layer)]
    return "only the standard library" if not before else f"itself and {', '.join(map(code, before))}"


def _tests(room: str) -> str:
    parts = room.removeprefix("yawbench/").split("/")
    for depth in range(len(parts), 0, -1):
        if (folder := ROOT.joinpath("tests", *parts[:depth])).is_dir():
            return code(folder.relative_to(ROOT).as_posix() + "/")
    return code("tests/")


def pages() -> dict[str, partial[str]]:
    """Return the pages: path in the docs -> what returns its text."""
    return {f"rooms/{room.replace('/', '_')}.md": partial(page, room) for room in rooms()}
