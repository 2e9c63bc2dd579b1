"""One table, shown and written in every form from the same cells."""

from __future__ import annotations

import math
import shutil
import subprocess

import numpy as np
import pytest
from rich.console import Console

import yawbench as yb
from yawbench.figures.latex import escaped
from yawbench.metrics.expressions import MetricValue
from yawbench.studies.tables import Table, column, to_csv, to_latex, to_pandas
from yawbench.studies.terminal_tables import TerminalTable
from yawbench.studies.uncertainty import SAMPLE_TABLES


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
    about = {"unit": "rad", "description": "peak"}
    columns = [column("run", "int64", [1, 2]), column("slip", "float64", [0.5, None], about)]
    table, empty = Table.of_columns(columns), Table("", [of for of, _ in columns])
    assert table.text() == [["1", "28.6 °"], ["2", "-"]]
    assert [table.is_number(k) for k in range(2)] == [True, True]
    for one in (table, empty):
        assert to_pandas(one).dtypes.to_list() == [np.int64, np.float64]
    assert (to_csv(table), to_csv(empty)) == ("run,slip [rad]\n1,0.5\n2,\n", "run,slip [rad]\n")


def test_a_table_is_the_same_on_the_terminal_and_in_latex(runs):
    console = Console(width=100)
    with console.capture() as printed:
        console.print(TerminalTable(runs))
    latex = to_latex(runs)
    for cell in ("28.6 ", "2.00 m", "12", "made in 1 s", "Runs"):
        assert all(cell in text for text in (printed.get(), latex))
    assert r"\begin{tabular}{lrrr}" in latex
    assert r"50 \% \& more & 28.6 \ensuremath{^\circ} & 25.0 \% & 3 \\" in latex
    assert r"\begin{tabular}[t]{@{}l@{}}a\textbar{}b\_c \\ d\end{tabular} & - & 2.00 m & 12 \\" in latex


ODD = (
    "".join(map(chr, [*range(0x20, 0x7F), *range(0xA1, 0x250), *range(0x370, 0x400)])),
    "√∫∂≤≥≠≈∞→✓✗★†±×·−–—‘’“”…€™⁻¹²₃½ﬁ％中🚗",
    "[0.5 m] at the beginning",
    "* at the beginning",
    "--set and ---",
)
"""Everything that a name, a title, a unit or a note may hold."""


@pytest.fixture
def tables_of_a_sample():
    axes = {"friction": yb.uniform(0.4, 0.9), "controller": ["controller_off", "controller_fnn"]}
    base, metrics = yb.load("fnn_sideslip/25mps"), ["peak(sideslip)", "spins(sideslip)"]
    made = yb.experiment(base, axes, metrics=metrics, points=8, design="saltelli").run()
    return "\n".join(made.to_latex(of=name) for name in SAMPLE_TABLES)


@pytest.mark.exhaustive
@pytest.mark.skipif(not shutil.which("pdflatex"), reason="there is no pdfLaTeX")
def test_tables_of_every_character_compile_with_booktabs_alone_and_are_readable(tmp_path, tables_of_a_sample):
    tables = [
        Table(text, ["a", text], [[text, 1.0], [f"{text}\nsecond", None]], [f"note {text}", "two\n\nlines"])
        for text in ODD
    ]
    body = "\n".join(to_latex(table, label=f"tab:{k}") for k, table in enumerate(tables)) + tables_of_a_sample
    document = rf"\documentclass{{article}}\usepackage{{booktabs}}\begin{{document}}{body}\end{{document}}"
    (tmp_path / "doc.tex").write_text(document, encoding="utf-8")
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "doc"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, errors="replace")
    assert done.returncode == 0, done.stdout[-1500:]
    log = (tmp_path / "doc.log").read_text(errors="replace")
    assert "Missing character" not in log and "not defined" not in log


def test_characters_that_latex_lacks_are_commands_or_numbers():
    assert escaped("δ_f ≤ 2 °/s² ") == (
        r"\ensuremath{\delta}\_f \ensuremath{\le} 2 \ensuremath{^\circ}/s\textsuperscript{2} "
    )
    assert escaped("λ φ ς Δ Β") == " ".join(
        rf"\ensuremath{{{one}}}" for one in (r"\lambda", r"\varphi", r"\varsigma", r"\Delta", r"\mathrm{B}")
    )
    assert escaped("Zürich 中 Ħ") == "Zürich {[}U+4E2D] {[}U+0126]"
    assert escaped("--set [1]") == "-{}-set {[}1]"
