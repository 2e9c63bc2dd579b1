"""Overrides are named beside the title of everything drawn or printed from a run."""

from __future__ import annotations

import json
from html import unescape
from pathlib import Path

import pytest

from tests.orchestrator.recorded import car, noted
from tests.refusals import mentions
from yawbench.figures.panels import LabelledRun
from yawbench.figures.plots import changed_each, draw
from yawbench.figures.style import save
from yawbench.orchestrator.plan import Override
from yawbench.orchestrator.results.reader import load_results
from yawbench.orchestrator.scenario.overrides import changed, with_changes

UNITS = (
    "driver_sine", "reference_single_track", "controller_off", "controller_fuzzy_feedback", "plant_two_dof",
    "tyre_magic_formula_1987",
)  # fmt: skip
SCENARIO = Path(__file__).parents[2] / "scenarios" / "fuzzy_feedback" / "single_sine.yaml"
SET = ("--set", "inputs.friction*=0.3", "--set", "vehicle.mass=1700", "--set", "stop_time=0.05")
WORDS = ("inputs.friction* = 0.3", "vehicle.mass = 1700", "stop_time = 0.05 s")
SWEEP = f"""
title: Amplitudes
scenario: {SCENARIO}
axes: {{amplitude: {{vary: driver.amplitude, values: [0.1, 0.12]}}}}
metrics: {{sideslip: {{metric: peak(sideslip)}}}}
limits:
  small: {{says: Largest amplitude, of: amplitude, holds_if: [{{metric: sideslip, at_most: 10 deg}}]}}
"""


@pytest.fixture
def yawbench(yawbench, fmus, tmp_path, monkeypatch):
    """Run the command line in an empty folder; return all it printed."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments, fmus=fmus):
        status, out, said = yawbench(*arguments, *(["--fmus", fmus] if fmus else []))
        assert status == 0, said
        return out, said

    return run


def flat(text):
    """Return a text without the line breaks of a terminal."""
    return " ".join(text.split())


def texts(figure):
    """Return all text that stands outside the panels of a figure."""
    return flat(" ".join(text.get_text() for text in figure.texts))


@pytest.mark.exhaustive
def test_everything_made_of_a_run_names_all_that_was_changed(yawbench, tmp_path):
    out, said = yawbench("run", SCENARIO, *SET, "--swap", "controller=controller_off", "--out", "r",
                         "--metric", "peak(sideslip)")  # fmt: skip
    wanted = ("controller_off for controller", *WORDS)
    record = json.loads((tmp_path / "r/run.json").read_text())
    assert [one["place"] for one in record["changes"]] == [
        "controller", "inputs.friction*", "vehicle.mass", "stop_time",
    ]  # fmt: skip
    shown = {"metrics": flat(out), "messages": flat(said)}

    yawbench("animate", "r", fmus=None)
    shown["viewer"] = unescape((tmp_path / "r/view.html").read_text())
    shown["check"] = flat(yawbench("check", SCENARIO, *SET, "--swap", "controller=controller_off")[0])
    for name, text in shown.items():
        assert [words for words in wanted if words not in text] == [], name

    shown = {}
    swaps = ("--swap", "controller=controller_off,controller_fuzzy_feedback", "--jobs", "1")
    shown["comparison"] = flat(yawbench("compare", SCENARIO, *SET, *swaps, "--out", "c")[0])
    shown["page"] = unescape((tmp_path / "c/report.html").read_text())
    (tmp_path / "sweep.yaml").write_text(SWEEP)
    out, said = yawbench("sweep", "sweep.yaml", *SET, "--jobs", "1", "--out", "s")
    shown |= {"limits": flat(out), "messages": flat(said)}
    shown["sweep"] = unescape((tmp_path / "s/report.html").read_text())
    steps = ("--halvings", "2", "--signal", "plant.velocity_x", "--out", "h")
    shown["convergence"] = flat(yawbench("converge", SCENARIO, *SET, *steps)[0])
    for name, text in shown.items():
        assert [words for words in WORDS if words not in text] == [], name


def made(*changes):
    """Return a made-up run whose record names changes."""
    results = car()
    return noted(results, changes=[change.record for change in changes])


ICE = Override.of("inputs.friction*", 0.3, "--set")
OFF = Override.of("controller", "mine/controller_off.fmu", "--swap")
SLOW = Override.of("plant.initial_speed", "50 km/h", "--set")


def test_an_overlay_names_what_was_changed_for_all_and_for_each():
    runs = [LabelledRun("a", made(ICE, OFF)), LabelledRun("b", made(ICE, SLOW))]
    said = "inputs.friction* = 0.3; a: controller_off for controller; b: plant.initial_speed = 50 km/h"
    for title in ("", "Figure 7"):
        assert f"changed: {said}" in texts(draw(runs, ["yaw_rate"], title=title))


def test_a_long_list_of_changes_is_wrapped_and_never_cut(tmp_path):
    many = [Override.of(f"controller.gain_{k}", k / 7, "--set") for k in range(40)]
    figure = draw([LabelledRun("a", made(*many))], ["yaw_rate"])
    save(figure, tmp_path / "long", ["svg"])
    assert all(f"controller.gain_{k} = " in texts(figure) for k in range(40))
    assert max(len(line) for text in figure.texts for line in text.get_text().splitlines()) <= 165


def test_the_heading_of_a_page_on_one_run_and_its_text_in_python_name_what_was_changed():
    from lxml import html

    import yawbench as yb
    from yawbench.reports.viewer import page

    run = made(SLOW)
    run.record.title = "ISO 3888-2 at 60 km/h, mu 0.9"
    full = f"{run.record.title} (changed: plant.initial_speed = 50 km/h)"
    assert html.fromstring(page([LabelledRun("a", run)])).findtext(".//h1") == full
    assert full in repr(yb.Run(run))
    assert html.fromstring(yb.view(yb.Run(run)).html).findtext(".//h1") == full
    assert html.fromstring(page([LabelledRun("a", made())])).findtext(".//h1") == made().record.title


def test_a_page_on_several_runs_names_what_was_changed_beside_their_titles():
    from lxml import html

    import yawbench as yb

    slow, fast = made(SLOW), made()
    slow.record.title, fast.record.title = "Lane change at 60 km/h", "Lane change at 80 km/h"
    shown = html.fromstring(yb.view([yb.Run(slow), yb.Run(fast)]).html)
    assert mentions(shown.findtext(".//h1"), "60 km/h", "50 km/h", "80 km/h")
    fast.record.title = slow.record.title
    named = html.fromstring(yb.view({"slow": yb.Run(slow), "other": yb.Run(fast)}).html)
    (below,) = [p.text for p in named.iter("p") if slow.record.title in (p.text or "")]
    assert mentions(below, "slow", "50 km/h")


def test_changes_are_told_in_words():
    assert mentions(changed([OFF, ICE]), "controller_off", "inputs.friction*", "0.3")
    assert mentions(changed([Override.of("plant.locked", True, "--set")]), "plant.locked", "true")
    assert changed([Override.of("step_size", 0.002, "study")]) == "step_size = 0.002 s"
    assert mentions(
        changed([Override.of("vehicle", "/cars/saloon.yaml", "sweep")]), "saloon.yaml", "vehicle", "file"
    )
    assert mentions(with_changes("Lane change", [ICE]), "inputs.friction*", "0.3")
    assert with_changes("Lane change", []) == "Lane change"
    assert changed_each([("a", [ICE]), ("b", [ICE])]) == "inputs.friction* = 0.3"
    assert changed_each([("a", []), ("b", [ICE])]) == "b: inputs.friction* = 0.3"
    assert changed_each([("controller_off", [OFF, ICE]), ("b", [ICE])]) == "inputs.friction* = 0.3"


def test_the_record_of_a_swap_reads_back_as_it_was(yawbench, tmp_path):
    yawbench("run", SCENARIO, "--swap", "controller=controller_off", "--set", "stop_time=0.01", "--out", "r")
    assert load_results(tmp_path / "r").record.overrides == (
        Override.of("controller", "controller_off", "--swap"),
        Override.of("stop_time", 0.01, "--set"),
    )
