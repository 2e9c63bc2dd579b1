"""Sums that have the same bits on every Python."""

from __future__ import annotations

import ast
from pathlib import Path

from yawbench import components
from yawbench.components.mathematics.sums import added, dot

WHOLE = {"self.rolling", "self.lost"}
"""Lists of booleans, whose sums are whole numbers."""


def test_numbers_are_added_from_the_first_to_the_last_and_rounded_after_each() -> None:
    values = [1.0, 1e100, 1.0, -1e100]  # what sum() makes 2.0 of since Python 3.12
    assert added(values) == 0.0
    assert dot(values, [1.0] * 4) == 0.0
    assert added([0.1] * 10) == 0.1 + 0.1 + 0.1 + 0.1 + 0.1 + 0.1 + 0.1 + 0.1 + 0.1 + 0.1 != 1.0
    assert added([]) == 0.0


def test_no_component_leaves_its_rounding_to_the_python_that_runs_it() -> None:
    wrong = []
    for file in Path(components.__file__).parent.rglob("*.py"):
        for call in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if not (isinstance(call, ast.Call) and ast.unparse(call.func) in ("sum", "math.fsum", "fsum")):
                continue
            (of,) = call.args
            counts = isinstance(of, ast.GeneratorExp) and isinstance(of.elt, ast.Compare)
            if not counts and ast.unparse(of) not in WHOLE:
                wrong.append(f"{file.name}:{call.lineno}: {ast.unparse(call)}")
    assert wrong == []
