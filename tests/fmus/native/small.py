"""Small components that are translated, compiled and driven beside Python."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

from yawbench.fmus.build import recipe_of
from yawbench.fmus.compiler import compiler_command
from yawbench.fmus.native import compare_with_python
from yawbench.fmus.native.build import FLAGS, HEADERS
from yawbench.fmus.staging import staged

HEAD = '''"""A small component."""

import math
from array import array
from bisect import bisect_right
from dataclasses import dataclass
from itertools import chain, pairwise, repeat
from operator import mul
from typing import NamedTuple

from ..fmi.component import Component
from ..fmi.variables import output, parameter, signal


@dataclass(frozen=True)
class Parameters:
    """Parameters of all kinds."""

    gain: float = parameter(2.0, "1", "A number", "chosen: a test", minimum=-10.0)
    count: int = parameter(3, None, "An integer", "chosen: a test")
    on: bool = parameter(True, None, "A switch", "chosen: a test")
    mode: str = parameter("first", None, "A choice", "chosen: a test", choices=("first", "second", "third"))


'''
UNIT = '''
class Unit(Component):
    """A small unit."""

    Parameters = Parameters
    inputs = (signal("a", "1", "A"), signal("b", "1", "B"))
    outputs = (output("y", "a", "b", unit="1", text="Y"),)

'''


def source(body: str, before: str = "") -> str:
    """Return the text of a component with these methods, after these functions and classes."""
    indented = "".join(f"    {line}\n" if line.strip() else "\n" for line in body.splitlines())
    return HEAD + before + "\n" + UNIT + indented


@contextmanager
def component_of(text: str, folder: Path) -> Iterator[tuple[type[Any], Path]]:
    """Import a component; yield its class and the folder of its package."""
    file = folder / "small.py"
    file.write_text(text)
    recipe = recipe_of(file, role="controllers")
    with staged(recipe._files, "yawbench_small") as stage:
        yield stage.component(recipe.module), stage.folder / "yawbench_small"


def compiled(text: str, folder: Path, optimization: str = "-O0") -> Path:
    """Compile C text as a unit is, but fast."""
    (folder / "unit.c").write_text(text)
    for name, file in HEADERS.items():
        (folder / name).write_bytes(file.read_bytes())
    command = [*compiler_command(), optimization, "-fPIC", *FLAGS, "unit.c", "-o", "unit.so", "-lm"]
    subprocess.run(command, cwd=folder, check=True, stderr=subprocess.PIPE, text=True)
    return folder / "unit.so"


@contextmanager
def fewer_steps() -> Iterator[None]:
    """Compare in fewer steps than a build does: small laws are soon known."""
    with patch.multiple(compare_with_python, STEPS=100, FEW=12, SEARCH=2000):
        yield
