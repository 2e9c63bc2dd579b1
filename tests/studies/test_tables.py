"""One table, shown and written in every form from the same cells."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rich.console import Console

from yawbench.metrics.expressions import MetricValue
from yawbench.studies.tables import Column, Table, column, for_terminal, to_csv, to_latex, to_pandas


@pytest.fixture
def runs():
    rows = [
        ["50 % & more", MetricValue(0.5, "rad"), MetricValue(0.25, "%"), "3"],
        ["a|b_c\nd", None, MetricValue(2.0, "m"), "12"],
    ]
    return Table("Runs", ["run", "slip", "mixed", "count"], rows, ["made in 1 s"], numbers={3})


def test_numbers_of_one_unit_are_written_in_si_and_others_as_text(runs):
    assert [runs.unit(k) for k in range(4)] == [None, "rad", None, None]
    assert [runs.kind(k) for k in range(4)] == ["string", "float64", "string", "string"]
    assert to_csv(runs).splitlines() == [
        "run,slip [rad],mixed,count",
        "50 % & more,0.5,25.0 %,3",
        '"a|b_c',
        'd",,2.00 m,12',
    ]
    frame = to_pandas(runs)
    assert frame.attrs["units"] == {"slip": "rad"}
    assert frame["slip"].to_list() == pytest.approx([0.5, math.nan], nan_ok=True)
    assert frame["mixed"].to_list() == ["25.0 %", "2.00 m"]


def test_plain_numbers_of_a_column_are_shown_with_its_unit():
    table = Table.of_columns(
        [
            column("run", "int64", [1, 2]),
            column("slip", "float64", [0.5, None], {"unit": "rad", "description": "peak"}),
        ]
    )
    assert table.text() == [["1", "28.6 °"], ["2", "-"]]
    assert [table.is_number(k) for k in range(2)] == [True, True]
    assert to_pandas(table).dtypes.to_list() == [np.int64, np.float64]
    assert to_csv(table) == "run,slip [rad]\n1,0.5\n2,\n"


def test_a_table_is_the_same_on_the_terminal_and_in_latex(runs):
    console = Console(width=100)
    with console.capture() as printed:
        console.print(for_terminal(runs))
    latex = to_latex(runs)
    for cell in ("28.6 °", "2.00 m", "12", "made in 1 s", "Runs"):
        assert all(cell in text for text in (printed.get(), latex))
    assert r"\begin{tabular}{lrrr}" in latex
    assert r"50 \% \& more & 28.6 ° & 25.0 \% & 3 \\" in latex
    assert r"a|b\_c \newline d & - & 2.00 m & 12 \\" in latex


def test_a_table_without_rows_keeps_the_kinds_of_its_columns():
    table = Table("", [Column("run", "int64"), Column("slip", "float64", {"unit": "rad"})])
    assert to_pandas(table).dtypes.to_list() == [np.int64, np.float64]
    assert to_csv(table) == "run,slip [rad]\n"
