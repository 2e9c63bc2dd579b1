"""Fits of scenarios: the truth is found again, mistakes have a line, the page has what was found."""

from __future__ import annotations

import contextlib
import io
import json
from pathlib import Path

import numpy as np
import pytest
from lxml import html

import yawbench as yb
from tests.command_line import status_of
from tests.commands.test_output import ALWAYS, documented
from tests.measured_cars.samples import Samples
from tests.reports.browser import DESK, PHONE, Browser
from tests.reports.flaws import check_whole, looks
from tests.reports.made_up import unpacked
from yawbench.figures.display import shown
from yawbench.foundation.errors import ScenarioError
from yawbench.measured_cars.fit_file import load_fit
from yawbench.orchestrator.scenario import yaml_lines

TRUTH = {"yaw_inertia": 1791.6, "front": 0.72, "rear": 1.0}
SCENARIO = """title: 7 DOF
vehicle: {vehicle}
stop_time: {stop}
step_size: 0.004
speed: 25
friction: 0.9
units:
  plant: {{fmu: plant_seven_dof}}
  tyre: {{fmu: tyre_magic_formula}}
inputs:
  steer_angle: {{file: {file}}}
  wheel_torque_*: 0
"""
MEASURED = """files: [run.csv]
time: {unit: s}
signals:
  steer_angle: {column: steer_angle, unit: rad}
  velocity_x: {column: velocity_x, unit: m/s}
  sideslip: {column: sideslip, unit: rad}
  yaw_rate: {column: yaw_rate, unit: rad/s}
  acceleration_y: {column: acceleration_y, unit: m/s2}
car: made up
source: a run
licence: none
date: 2024-01-01
"""
FIT = """title: A car fitted to itself
scenario: scenario.yaml
measured: measured.yaml
training: [{begin: 0, end: 3 s}]
held_out: [{begin: 3 s, end: 4 s}]
compared: {yaw_rate: 0.1 deg/s, acceleration_y: 0.05 m/s2}
settling: 0.2 s
free:
  vehicle.yaw_inertia: {low: 800, high: 4000, start: 2200}
  vehicle.cornering_stiffness_scale_front: {low: 0.3, high: 2, start: 0.85}
  vehicle.cornering_stiffness_scale_rear: {low: 0.3, high: 2, start: 0.8}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scenario, the recording of a run of it, and a fit file."""
    place = tmp_path_factory.mktemp("fit")
    vehicle = Path(__file__).parents[2] / "scenarios" / "vehicles" / "mid_size.yaml"
    times = np.arange(0.0, 4.005, 0.01)
    steer = 0.03 * np.sin(2.0 * np.pi * 0.7 * np.maximum(times - 0.3, 0.0))
    table = np.column_stack([times, steer])
    np.savetxt(place / "steer.csv", table, delimiter=",", header="time,steer_angle [rad]", comments="")
    (place / "truth.yaml").write_text(SCENARIO.format(vehicle=vehicle, stop=4, file="steer.csv"))
    run = yb.load(place / "truth.yaml").run()
    names = ("velocity_x", "sideslip", "yaw_rate", "acceleration_y")
    columns = [times, steer, *(np.interp(times, run.time, run[f"plant.{name}"]) for name in names)]
    header = ",".join(["time", "steer_angle", *names])
    np.savetxt(place / "run.csv", np.column_stack(columns), delimiter=",", header=header, comments="")
    (place / "measured.yaml").write_text(MEASURED)
    (place / "scenario.yaml").write_text(SCENARIO.format(vehicle=vehicle, stop=4, file="measured.yaml"))
    (place / "fit.yaml").write_text(FIT)
    return place


@pytest.fixture(scope="module")
def fitted(folder: Path) -> tuple[Path, dict]:
    """What `yawbench fit --json` writes, and its answer."""
    with contextlib.redirect_stdout(io.StringIO()) as said:
        assert status_of("fit", folder / "fit.yaml", "--out", folder / "out", "--jobs", "1", "--json") == 0
    return folder / "out", json.loads(said.getvalue())


@pytest.fixture
def page(fitted) -> Path:
    return fitted[0] / "fit.html"


def test_a_car_is_found_again_and_the_single_track_stands_beside(fitted):
    out, answer = fitted
    data = json.loads((out / "fit.json").read_text())
    assert set(answer) == ALWAYS | documented()["fit"]
    assert answer["fit"] == data
    own, single = data["models"].values()
    for name, truth in zip(own["parameters"], TRUTH.values(), strict=True):
        assert own["parameters"][name]["value"] == pytest.approx(truth, rel=1e-4)
        assert own["parameters"][name]["interval"] is None  # of one piece
    assert own["sets"] <= 60
    for name in ("yaw_rate", "acceleration_y"):
        assert own["scores"]["held_out"][name]["rms"] < 0.1 * single["scores"]["held_out"][name]["rms"]
        for model in (own, single):
            windows = np.array(model["windows"]["held_out"][name])
            assert np.sqrt(np.mean(windows**2)) == pytest.approx(model["scores"]["held_out"][name]["rms"])
        assert own["scores"]["held_out"][name]["fit"] > 99.9
    assert data["verdict"].startswith("better than")
    assert "held-out" in answer["tables"][-1]["columns"][-1]["heading"]
    assert not (out / "sets").exists()
    assert "fitted to made up" in (out / "vehicle.yaml").read_text()
    vehicle = yaml_lines.read(out / "vehicle.yaml", what="vehicle file").data
    assert vehicle["parameters"]["yaw_inertia"] == pytest.approx(1791.6, rel=1e-4)


def test_an_interrupted_fit_goes_on(folder, monkeypatch):
    from yawbench.measured_cars import scenario_model as module

    made = []
    original = module.execute

    def stops(jobs, **options):
        made.append(len(jobs))
        if len(made) == 4:
            raise KeyboardInterrupt
        return original(jobs, **options)

    monkeypatch.setattr(module, "execute", stops)
    out = folder / "again"
    command = ("fit", one_parameter(folder, INERTIA, 60), "--out", out, "--jobs", "1")
    assert status_of(*command) == 130
    before = sum(made[:3])
    assert len(list((out / "sets").iterdir())) == before
    made.clear()
    made.extend([0] * 4)  # no further interruption
    assert status_of(*command) == 0
    total = json.loads((out / "fit.json").read_text())["models"]["7 DOF"]["sets"]
    assert sum(made) == total - before + 1  # one of the held-out window


def refused_fit(folder: Path, old: str, new: str) -> ScenarioError:
    path = folder / "wrong.yaml"
    path.write_text(FIT.replace(old, new))
    with pytest.raises(ScenarioError) as refused:
        yb.fit(path, workers=1)
    return refused.value


def test_a_parameter_without_effect_is_refused(folder):
    refused = refused_fit(folder, "free:\n", "free:\n  plant.low_speed: {low: 0.1, high: 2, start: 1}\n")
    assert refused.code == "fit-not-identifiable"
    assert "plant.low_speed" in str(refused)


@pytest.mark.parametrize(
    ("old", "new", "code", "lines", "name"),
    [
        ("compared: {yaw_rate:", "compared: {roll_rate:", "signal-unknown", {6}, "roll_rate"),
        ("begin: 3 s", "begin: 2 s", "fit-window", {5}, "training"),
        ("end: 4 s", "end: 9 s", "fit-window", {5}, "9 s"),
        ("{begin: 0,", "{segment: 2, begin: 0,", "segment-unknown", {4}, "2"),
        ("title: A", "titel: A", "key-unknown", {1}, "titel"),
        ("settling: 0.2 s", "settling: 3 s", "fit-window", {4, 5}, "settling"),
        ("settling: 0.2 s", "settling: 2.9999 s", "fit-window", {4, 5}, "settling"),
        ("yaw_rate: 0.1 deg/s", "yaw_rate: 1e-290", "fit-window", {4, 5}, "yaw_rate"),  # too large then
    ],
)
def test_mistakes_of_a_fit_file_have_a_line(folder, old, new, code, lines, name):
    refused = refused_fit(folder, old, new)
    assert {(one.code, one.location.line) for one in refused.diagnostics} >= {(code, k) for k in lines}
    assert name in str(refused)


INERTIA = "{low: 800, high: 4000, start: 2200}"


def one_parameter(folder: Path, inertia: str, most_sets: int) -> Path:
    """Write a fit of a car's inertia alone."""
    file = folder / "one.yaml"
    free = f"most_sets: {most_sets}\nfree:\n  vehicle.yaw_inertia: {inertia}\n"
    file.write_text(FIT.partition("free:")[0] + free)
    return file


@pytest.mark.parametrize(
    ("inertia", "most_sets"),
    [
        ("{low: 800, high: 1000, start: 900}", 60),  # the truth lies beyond
        ("{low: 800, high: 4000, start: 3999.999}", 2),  # no set but the first
        (INERTIA, 2),
    ],
)
def test_a_fit_of_one_parameter_that_ends_where_it_began_or_at_a_bound_has_a_result(
    inertia, most_sets, folder, tmp_path, yawbench
):
    file = one_parameter(folder, inertia, most_sets)
    status, _, said = yawbench("fit", file, "--out", tmp_path, "--jobs", "1")
    assert status == 0, said
    own, _ = json.loads((tmp_path / "fit.json").read_text())["models"].values()
    (parameter,) = own["parameters"].values()
    assert 800 <= parameter["value"] <= 4000
    assert (tmp_path / "fit.html").is_file()


# Its page


def test_every_number_of_its_tables_is_that_of_the_file(page):
    data = json.loads(page.with_name("fit.json").read_text(encoding="utf-8"))
    tree = html.fromstring(unpacked(page))
    scores, *tables = tree.cssselect("main table:not(.yv *)")
    rows = [[cell.text_content().strip() for cell in row] for row in scores.cssselect("tbody tr")]
    wanted = [(name, title) for name in ("yaw_rate", "acceleration_y") for title in data["models"]]
    assert [tuple(row[:2]) for row in rows] == wanted
    for (name, title), row in zip(wanted, rows, strict=True):
        unit = {"yaw_rate": "rad/s", "acceleration_y": "m/s2"}[name]
        for part, cells in (("training", row[2:5]), ("held_out", row[5:8])):
            score = data["models"][title]["scores"][part][name]
            texts = [shown(score["rms"], unit), shown(score["largest"], unit), f"{score['fit']:.1f} %"]
            assert cells == texts
    assert len(tables[0].cssselect("tbody tr")) == len(TRUTH)
    said = tree.xpath("string(//p[@class='said'])")
    assert tables[0].getnext().text_content().count("no intervals: 1 piece of 5 s, fewer than 5") == 1
    assert "kg·m2" in tables[0].text_content()
    assert [table.findtext("caption") for table in tables[2:]] == [  # its speed is the same all the time
        "Rms differences over |acceleration_y|, held-out windows"
    ]
    assert said[:1].lower() + said[1:].rstrip(".") == data["verdict"]


def test_its_samples_are_the_measured_ones_and_its_views_histories_and_cross_plots_of_all_three(folder, page):
    samples, fit = Samples(page), load_fit(folder / "fit.yaml")
    assert [view["x"] for view in samples.data["views"]] == ["time", "plant.acceleration_y"]
    assert samples.data["runs"][0]["label"] == "made up" and len(samples.data["runs"]) == 3
    times, _ = samples.of(0, "time")
    for window in (each.window for each in (*fit.training, *fit.held_out)):
        for name in ("yaw_rate", "acceleration_y"):
            values, step = samples.of(0, f"plant.{name}")
            found = np.interp(window.times[1:-1], times, values)
            assert np.abs(found - window.measured[name][1:-1]).max() <= step


@pytest.mark.parametrize(("width", "colours"), looks(PHONE, DESK, narrow=False))
def test_the_page_has_no_flaws_and_stays_within_its_budget(chromium: Browser, page, width, colours):
    check_whole(chromium, page, width, colours)
