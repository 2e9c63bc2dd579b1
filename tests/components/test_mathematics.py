"""Integration against closed forms, and sums that have the same bits on every Python."""

from __future__ import annotations

import ast
from math import cos, exp, log2, sin
from pathlib import Path

import pytest

from yawbench import components
from yawbench.components.mathematics.integrators import rk4
from yawbench.components.mathematics.sums import added, dot


def oscillate(steps, until=2.0, omega=3.0):
    y = (1.0, 0.0)
    h = until / steps
    for k in range(steps):
        y = rk4(lambda t, s: (s[1], -(omega**2) * s[0]), k * h, h, y)
    return y[0] - cos(omega * until), y[1] + omega * sin(omega * until)


def test_a_cubic_in_time_is_integrated_exactly():
    (y,) = rk4(lambda t, s: (4.0 * t**3 - 3.0 * t**2 + 2.0,), 1.0, 0.5, (5.0,))
    assert y == pytest.approx(5.0 + (1.5**4 - 1.0) - (1.5**3 - 1.0) + 1.0, abs=1e-14)


def test_one_step_of_growth_is_the_exponential_series_to_the_fourth_power():
    (y,) = rk4(lambda t, s: s, 0.0, 0.3, (1.0,))
    assert y == pytest.approx(1 + 0.3 + 0.3**2 / 2 + 0.3**3 / 6 + 0.3**4 / 24, rel=1e-15)
    assert abs(y - exp(0.3)) < 0.3**5 / 100


def test_the_error_falls_with_the_fourth_power_of_the_step():
    coarse, fine = (max(map(abs, oscillate(n))) for n in (100, 200))
    assert 3.9 < log2(coarse / fine) < 4.1


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
