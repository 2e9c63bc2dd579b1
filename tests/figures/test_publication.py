"""Figures for publication: format, size, fonts, and the caller's settings of matplotlib."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from PIL import Image

from tests.command_line import status_of
from tests.orchestrator.recorded import car, write
from tests.refusals import each_mentions
from yawbench.figures import plots
from yawbench.figures.display import LabelledRun
from yawbench.figures.plots import draw
from yawbench.figures.style import LINES, STYLES

SINGLE = ("--panel", "yaw_rate")
OTHERS = ("sideslip", "acceleration_y", "steer_angle", "path")


@pytest.fixture
def run(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write(car(), tmp_path / "run")
    return Path("run")


@pytest.fixture(scope="module")
def two(tmp_path_factory) -> Path:
    """A folder with two runs, to which nothing is added."""
    folder = tmp_path_factory.mktemp("two")
    for name, gain in (("run", 1.0), ("other", 2.0)):
        write(car(gain), folder / name)
    return folder


@pytest.mark.sampled(1)
@pytest.mark.parametrize("style", STYLES)
def test_a_pdf_has_the_size_and_embedded_truetype_fonts(run, style):
    assert status_of("plot", run, *SINGLE, "--size", "88x60mm", "--style", style, "--out", "fig.pdf") == 0
    text = Path("fig.pdf").read_bytes()
    box = [float(one) for one in re.search(rb"/MediaBox \[([^]]*)\]", text)[1].split()]
    assert box[2:] == pytest.approx([88 / 25.4 * 72, 60 / 25.4 * 72], abs=0.01)
    assert b"/FontFile2" in text and b"/Type3" not in text
    assert [path.name for path in Path().iterdir() if path.is_file()] == ["fig.pdf"]


@pytest.mark.parametrize("kind", ["svg", pytest.param("png", marks=pytest.mark.exhaustive), "pdf"])
def test_the_format_is_that_of_the_option_or_the_file(run, kind):
    assert status_of("plot", run, *SINGLE, "--format", kind, "--out", "folder") == 0
    assert status_of("plot", run, *SINGLE, "--out", f"one.{kind}") == 0
    assert [path.name for path in Path("folder").iterdir()] == [f"overview.{kind}"]
    assert Path(f"one.{kind}").read_bytes() == Path(f"folder/overview.{kind}").read_bytes()


def test_a_png_has_the_pixels_of_its_size(run):
    assert status_of("plot", run, *SINGLE, "--size", "4x3in", "--style", "slides", "--out", "fig.png") == 0
    assert Image.open("fig.png").size == (600, 450)


def test_differences_and_time_spans_are_drawn_by_their_options(run, monkeypatch):
    write(car(2.0), Path("other"))
    drawn = []
    monkeypatch.setattr(plots, "draw", lambda *given: drawn.append(draw(*given)) or drawn[-1])
    both = ("plot", run, "other", "--label", "one", "--label", "two", *SINGLE, "--out", "fig.svg")
    for named in ("one", run, f"./{run}/"):
        assert status_of(*both, "--minus", named) == 0
    assert status_of(*both, "--minus", "two", "--during", "1 to 2.5 s") == 0
    (apart,) = drawn[0].axes[0].get_lines()
    wanted = np.degrees(car(2.0)["plant.yaw_rate"] - car()["plant.yaw_rate"])
    assert np.asarray(apart.get_ydata()) == pytest.approx(wanted)
    assert len({tuple(one.axes[0].get_lines()[0].get_ydata()) for one in drawn[:3]}) == 1
    (cut,) = drawn[3].axes[0].get_lines()
    assert (cut.get_xdata()[0], cut.get_xdata()[-1]) == (1.0, 2.5)
    rows = (car().time >= 1.0) & (car().time <= 2.5)
    assert np.asarray(cut.get_ydata()) == pytest.approx(-wanted[rows])


@pytest.mark.parametrize(
    ("options", "names"),
    [
        (("--size", "88"), ("--size 88", "0.5", "100 inches", "height")),
        (("--size", "0x60mm"), ("--size 0x60mm", "0.5", "100 inches", "height")),
        (("--size", "88x9999mm"), ("--size 88x9999mm", "0.5", "100 inches", "height")),
        (("--panel=sideslip", "--panel=path", "--size", "88x30mm"), ("88", "30 mm", "--panel", "--size")),
        (("--minus", "others"), ("--minus others", "other")),
        (("--minus", "run", "--page"), ("--minus", "page", "baseline")),
        (("--minus", "run", "--panel", "path"), ("--minus", "path", "position_y")),
        (("--during", "soon"), ("--during", "soon", "1 to 3 s")),
        (("--during", "at 2 s"), ("--during", "at 2 s", "1 to 3 s")),
        (("--during", "90 to 95 s"), ("run", "nothing", "90", "95 s")),
        (("--during", "1 to 2 s", "--page"), ("--during", "page")),
        (("--out", "fig.jpeg"), ("--out fig.jpeg", "figure")),
        (("--out", "fig.html"), ("--out fig.html", "--page", "figure", "page")),
        (("--out", "fig.svg", "--format", "pdf"), ("--out fig.svg", "--format", "pdf")),
        (("--page", "--style", "ieee"), ("--page", "--format", "--size", "--style")),
        (("--page", "--format", "pdf", "--out", "fig.pdf"), ("--page", "--format", "--size", "--style")),
    ],
)
def test_options_that_are_wrong_or_contradict_each_other_are_refused(
    two, monkeypatch, capsys, options, names
):
    monkeypatch.chdir(two)
    assert status_of("plot", "run", "other", *SINGLE, *options) == 2
    assert each_mentions(capsys.readouterr().err, names)
    assert sorted(path.name for path in Path().iterdir()) == ["other", "run"]


def test_a_difference_needs_two_runs(run, capsys):
    assert status_of("plot", run, "--minus", "run") == 2
    assert each_mentions(capsys.readouterr().err, ("--minus", "two runs"))


@pytest.mark.parametrize("style", ["ieee", pytest.param("elsevier", marks=pytest.mark.exhaustive)])
def test_a_style_grows_with_its_panels(run, style):
    sizes = []
    for panels in (SINGLE, (*SINGLE, *(f"--panel={name}" for name in OTHERS))):
        assert status_of("plot", run, *panels, "--style", style, "--out", "fig.png") == 0
        sizes.append(Image.open("fig.png").size)
    (single, low), (wide, high) = sizes
    assert wide == single and high > 2 * low


def test_a_legend_is_filled_as_lines_of_a_text_are():
    labels = ["no control", "fuzzy controller on sideslip", "adaptive fuzzy neural network"]
    with matplotlib.rc_context({**STYLES["ieee"], "figure.figsize": (88 / 25.4, 60 / 25.4)}):
        figure = draw([LabelledRun(label, car(k + 1.0)) for k, label in enumerate(labels)], ["sideslip"])
        rows = [[text.get_text() for text in row.get_texts()] for row in figure.legends]
        boxes = [row.get_window_extent() for row in figure.legends]
    assert rows == [labels[:2], [labels[2], "reference"]]
    assert max(box.x1 for box in boxes) <= figure.bbox.x1 and boxes[1].y1 <= boxes[0].y0


LATEX = r"\documentclass{article}\usepackage{pgf}\begin{document}\input{fig.pgf}\end{document}"


@pytest.mark.exhaustive  # LaTeX measures every text
@pytest.mark.skipif(not shutil.which("xelatex"), reason="LaTeX is not installed")
@pytest.mark.parametrize("panel", ["sideslip", "yaw_rate(sideslip)"])
def test_pgf_is_a_figure_in_every_engine_of_latex(run, panel):
    label = ("--label", "τ = −20 ms")
    assert status_of("plot", run, "--panel", panel, *label, "--style", "ieee", "--out", "fig.pgf") == 0
    text = Path("fig.pgf").read_text(encoding="utf-8")
    assert text.count(r"\begin{pgfpicture}") == 1 and r"\beta" in text and str(Path.home()) not in text
    for engine in filter(shutil.which, ("pdflatex", "xelatex", "lualatex")):
        command = [engine, "-interaction=nonstopmode", "-halt-on-error", "-jobname=doc", LATEX]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace")
        assert done.returncode == 0, done.stdout[-1500:]
        assert "Missing character" not in Path("doc.log").read_text(errors="replace")


@pytest.mark.skipif(bool(shutil.which("xelatex")), reason="LaTeX is installed")
def test_pgf_without_latex_is_refused_in_a_sentence(run, capsys):
    assert status_of("plot", run, *SINGLE, "--format", "pgf") == 2
    assert each_mentions(capsys.readouterr().err, ("run/overview.pgf", "PGF", "LaTeX"))


def test_the_callers_settings_of_matplotlib_hold():
    runs = [LabelledRun("a", car()), LabelledRun("b", car(2.0))]
    own = {"figure.figsize": (4.0, 3.0), "axes.grid": False, "font.size": 6, "lines.linewidth": 0.75}
    with matplotlib.rc_context({**own, "axes.prop_cycle": matplotlib.cycler(color=["#123456", "#654321"])}):
        figure = draw(runs, ["yaw_rate"])
    assert figure.get_size_inches().tolist() == [4.0, 3.0]
    lines = [line for line in figure.axes[0].get_lines() if line.get_color() in ("#123456", "#654321")]
    assert len(lines) == 2
    assert lines[0].get_linewidth() == pytest.approx(LINES[0]["linewidth"] / 2)
    assert not figure.texts
    with_ours = draw(runs, ["yaw_rate"])
    assert with_ours.get_size_inches()[0] == 10.0 and with_ours.texts
    assert [one.get_color() for one in with_ours.axes[0].get_lines()].count(LINES[0]["color"]) == 1
