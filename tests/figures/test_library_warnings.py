"""No warning of a library reaches users, however a run has grown: metrics, tests, figures, pages, tables."""

from __future__ import annotations

import subprocess
import sys
import warnings
from dataclasses import replace

import numpy as np
import pytest

from tests.command_line import status_of
from tests.orchestrator.recorded import write
from tests.reports.made_up import whole_car
from yawbench.figures.display import digits_of
from yawbench.figures.panels import LabelledRun
from yawbench.figures.plots import draw
from yawbench.figures.style import save
from yawbench.metrics.expressions import STANDARD, evaluate_all
from yawbench.metrics.measures import catalogue
from yawbench.reports.divergence import divergence
from yawbench.reports.viewer import page

GROWTH = {
    "all at once": lambda t: np.choose(np.clip(t, 0, 3).astype(int), [1.0, 1e308, np.inf, np.nan]),
    "no number": lambda t: np.where(t > 1.5, np.nan, 1.0),
    "zero": lambda t: np.zeros_like(t),
    "infinite": lambda t: np.where(t > 1.5, np.inf, 1.0) * np.where(t > 2.5, -1.0, 1.0),
    "huge": lambda t: 10.0 ** (75 * t),
}  # fmt: skip


def grown(kind: str):
    """Return a run whose signals have grown, with changing signs."""
    run = whole_car(n=161)
    turns = np.where(np.arange(run.time.size) % 2, -1.0, 1.0)
    with np.errstate(all="ignore"):
        factor = GROWTH[kind](run.time) * turns
        columns = {name: np.asarray(values, float) * factor for name, values in run.columns.items()}
    return replace(run, columns=columns)


@pytest.fixture
def silent():
    """Turn warnings of libraries into errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


@pytest.mark.parametrize("kind", GROWTH)
@pytest.mark.sampled(3)
@pytest.mark.usefixtures("silent")
def test_the_library_warns_of_no_arithmetic(kind, tmp_path):
    run, usual = grown(kind), whole_car(n=161)
    every = [
        f"{one.name}({x})" for one in catalogue() for x in ("sideslip", "yaw_rate") if one.name != "value"
    ]
    evaluate_all(run, [*STANDARD, *every])
    divergence(run, usual)
    divergence(usual, run)
    runs = [LabelledRun("grown", run), LabelledRun("usual", usual)]
    page(runs)
    save(draw(runs), tmp_path / "drawn", ["png"])


@pytest.mark.parametrize("kind", GROWTH)
@pytest.mark.sampled(2)
def test_commands_print_no_warning_of_a_library(kind, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write(grown(kind), tmp_path / "grown")
    write(whole_car(n=161), tmp_path / "usual")
    commands = [
        *(
            "plot grown usual --out drawn.png",
            "animate grown --out a.html",
            "diff grown usual",
            "list runs .",
        ),
        *(f"evaluate {test} grown" for test in ("turn-response", "straight-braking", "frequency-response")),
    ]
    for command in commands:
        assert status_of(*command.split()) in (0, 1, 2), command
        out, said = capsys.readouterr()
        for text in ("Warning", "site-packages", "numpy", "Traceback", "error in yawbench itself"):
            assert text not in out + said, (command, said)


def test_users_own_warnings_are_shown_and_those_of_libraries_are_not(tmp_path):
    program = """
import sys, warnings
import numpy as np
from yawbench.foundation.errors import hide_library_warnings
from yawbench.orchestrator.results import reader
hide_library_warnings()
warnings.warn("of mine")
warnings.warn_explicit("of numpy", RuntimeWarning, np.__file__, 1)
warnings.warn_explicit("of ours", RuntimeWarning, reader.__file__, 1)
warnings.warn_explicit("of python", UserWarning, warnings.__file__, 1)
"""
    (tmp_path / "mine.py").write_text(program)
    done = subprocess.run([sys.executable, tmp_path / "mine.py"], capture_output=True, text=True, check=True)
    assert "of mine" in done.stderr
    assert not [word for word in ("numpy", "ours", "python 1", "of python") if word in done.stderr]


def test_numbers_beyond_all_digits_have_an_exponent():
    assert digits_of(1e300) == "1.00e+300"
    assert digits_of(-6.234e17) == "-6.23e+17"
    assert digits_of(123456789.0) == "123456789"
