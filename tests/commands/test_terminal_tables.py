"""Tables on terminals of any width: nothing of them is lost, whatever command prints them."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from rich.cells import cell_len

from tests.commands.terminal import seen_on_terminal
from yawbench.commands import output
from yawbench.metrics.expressions import MetricValue
from yawbench.studies.tables import Table

ROOT = Path(__file__).parents[2]
WIDTHS = (80, 100, 120)
WIDE = 400


@pytest.fixture
def printed(monkeypatch, capsys):
    """Print tables for a terminal of a width, as every command does, and return the text."""

    def text_of(width: int, of: list[Table]) -> str:
        monkeypatch.setenv("COLUMNS", str(width))
        capsys.readouterr()
        output.print_tables(of)
        return capsys.readouterr().out

    return text_of


def assert_whole(table: Table, printed) -> None:
    """Assert that all words, names and numbers of a table are whole at every width."""
    wide = {*printed(WIDE, [table]).split()}
    words = {word for word in wide if not set(word) <= {"─"}}
    assert words >= {*" ".join([table.title, *table.headings, *table.notes]).split()}
    for width in WIDTHS:
        lines = printed(width, [table]).splitlines()
        assert words <= {*" ".join(lines).split()}, width
        assert not [row for row in lines if cell_len(row) > width and len(row.split()) > 1]
        for k, cells in enumerate(zip(*table.text(), strict=True)):
            for text in (part.replace("\t", "    ") for cell in cells for part in cell.splitlines()):
                if cell_len(text) <= (32 if table.is_number(k) else 20 if k else width // 2):
                    assert any(text in row for row in lines), (width, text)
    assert words <= {*printed(40, [table]).split()}


ODD = Table(
    "A title that is much longer than a narrow terminal is wide, with a_name_that_is_longer_than_others",
    ["", "run", "a heading of many words over numbers", "95 % interval", "値", "what it says"],
    [
        ["α", "no control †", MetricValue(6234.0, "N.m"), "9.81 m/s²", "車両の横すべり角", "words. " * 12],
        ["β" * 3, "a very long name of a run, with 12 words", None, "1e-05 ± 0.12 m/s²", "é" * 9, ""],
        ["", "results/" + "folder/" * 20, MetricValue(-0.5, "rad"), "3.94 (3.6 to 4.0) °/s", "🚗", "a\nb\tc"],
    ],
    ["A note of 5 N·m about results/a/very/long/path/that/nobody/wants/to/see/broken/over/two/lines.csv"],
    numbers={3},
)  # fmt: skip


def test_names_in_other_scripts_and_words_longer_than_a_line_are_whole(printed):
    assert_whole(ODD, printed)
    narrow = printed(80, [ODD])
    assert "results/" + "folder/" * 20 in narrow  # to be copied
    assert "-28.6 °" in narrow


@pytest.mark.parametrize("width", [1, 20, 40, 60])
def test_a_very_narrow_terminal_has_everything_too(width, printed):
    assert {*ODD.notes[0].split(), "6234", "🚗", "results/" + "folder/" * 20} <= {
        *printed(width, [ODD]).split()
    }
    for table in (Table("", []), Table("t", ["a", "b"]), Table("", ["a"], [["x" * 90]]), Table("", [], [])):
        printed(width, [table])


def test_columns_that_do_not_fit_follow_with_the_names_of_their_rows(printed):
    headings = ["run", *(f"metric number {k}" for k in range(12))]
    rows = [[f"run {k}", *(MetricValue(1000.0 * k + j, "N.m") for j in range(12))] for k in range(3)]
    lines = printed(80, [Table("", headings, rows)]).splitlines()
    of_run = [row.split("   ") for row in lines if row.startswith(" run 2")]
    assert len(of_run) > 1
    numbers = [cell.strip() for row in of_run for cell in row[1:] if cell.strip()]
    assert numbers == [f"{2000 + j} N·m" for j in range(12)]


def test_rows_without_short_names_become_lists(printed):
    claims = [f"The {k}th claim says that " + "a car that is steered turns and " * 3 for k in range(2)]
    rows = [[claim, "6234 N·m (no control)", "does not reproduce", "by far", "0.5 rad"] for claim in claims]
    text = printed(60, [Table("", ["claim", "measured", "verdict", "margin", "nearest flip"], rows)])
    assert [row.split()[0] for row in text.splitlines() if row.startswith((" m", " v", " n"))] == [
        "measured", "verdict", "margin", "nearest",
    ] * 2  # fmt: skip
    assert text.count("does not reproduce") == 2


def test_tables_with_equal_names_stay_told_apart(printed):
    rows = [["jacobi", f"{k} ms", *("x" * 18 for _ in range(5))] for k in (1, 2)]
    text = printed(80, [Table("", ["algorithm", "step", *"abcde"], rows)])
    assert text.count("jacobi") == text.count("1 ms") + text.count("2 ms") > 2


def columns_of_output(environment: dict[str, str], terminal: tuple[int, int] | None = None) -> str:
    """Return what a real process prints, to a pipe or to a terminal of a size."""
    known = {
        name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES", "NO_COLOR")
    }
    command = [sys.executable, "-m", "yawbench", "list", "metrics"]
    if terminal is None:
        return subprocess.run(
            command, env={**known, **environment}, capture_output=True, text=True, check=True, cwd=ROOT
        ).stdout
    own = {**known, "TERM": "xterm", **environment}
    return re.sub(r"\x1b\[[0-9;]*m", "", seen_on_terminal(command, "stdout", terminal, env=own, cwd=ROOT))


@pytest.mark.parametrize(
    ("environment", "terminal", "width"),
    [
        ({"COLUMNS": "0"}, None, 140), ({"TERM": "dumb"}, (50, 100), 100),
        ({"COLUMNS": "120"}, (50, 80), 120), ({}, (0, 0), 140),
    ],
)  # fmt: skip
def test_output_is_as_wide_as_the_terminal_or_as_columns_says(environment, terminal, width):
    lines = columns_of_output(environment, terminal).splitlines()
    assert width - 15 < max(map(cell_len, lines)) <= width
    assert all(name in " ".join(lines) for name in ("relative_path_error(x)", "of the signal"))
