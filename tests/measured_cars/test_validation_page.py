"""Validations on pages: made-up tests of a car beside a run, in `yawbench validate --page` and in a study."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from lxml import html
from matplotlib.path import Path as Line

import yawbench as yb
from tests.measured_cars.samples import Samples
from tests.measured_cars.test_validation import line, write, write_study
from tests.orchestrator.recorded import write as write_run
from tests.reports.browser import DESK, PHONE, Browser
from tests.reports.flaws import COLOURS, check_whole, flaws, inaccessible, looks
from tests.reports.made_up import data_in, unpacked, whole_car
from yawbench.measured_cars.validation import CrossPlot
from yawbench.measured_cars.validation_page import validation_page, validation_sentence
from yawbench.metrics.verdict import apart
from yawbench.reports.page_parts import render
from yawbench.reports.study_page import chapter
from yawbench.studies.experiment_result import judge_results
from yawbench.studies.load_experiment import load_experiment


@pytest.fixture(scope="module")
def validation(tmp_path_factory):
    """A run along a = 10 delta, and four noisy tests of a car, the last two to the right."""
    folder = tmp_path_factory.mktemp("validation")
    rng = np.random.default_rng(5)
    for k in range(4):
        a_y = np.linspace(1.0, 5.2, 400) * (1.0 if k < 2 else -1.0)
        hand = 0.1 * a_y + 0.03 * np.sign(a_y) + rng.normal(0.0, 0.002, 400)
        path = write(folder, f"test{k}", hand, a_y + rng.normal(0.0, 0.03, 400), tests=1)
    files = ", ".join(f"test{k}_0.csv" for k in range(4))
    path.write_text(path.read_text(encoding="utf-8").replace("test3_0.csv", files), "utf-8")
    return yb.validate(yb.measured(line(folder, "run"), segment=1), path)


@pytest.fixture(scope="module")
def page(validation, tmp_path_factory) -> Path:
    file = tmp_path_factory.mktemp("page") / "validation.html"
    file.write_text(validation_page(validation), "utf-8")
    return file


def test_it_has_the_verdict_the_conditions_and_the_source_of_the_bands(validation, page):
    tree = html.fromstring(unpacked(page))
    (verdict,) = validation.verdicts.values()
    signals, conditions = tree.cssselect("main > table")
    (row,) = (row.text_content() for row in signals.cssselect("tbody tr"))
    distance = apart(verdict.value, 1.0, decimals=2)
    assert distance in row and verdict.status.value in row
    assert len(validation.conditions) == 2
    assert [row.cssselect(".verdict.good") != [] for row in conditions.cssselect("tbody tr")] == [True, True]
    text = tree.text_content()
    assert validation.source in text and validation.origin in text
    assert f"{distance} of the tolerance" in tree.xpath("string(//p[@class='said'])")


def test_a_distance_next_to_the_bound_never_reads_as_the_bound(validation):
    (verdict,) = validation.verdicts.values()
    near = replace(validation, verdicts={"steering_wheel_angle": replace(verdict, value=1.00004)})
    assert "1.00004 of" in validation_sentence(near)


@pytest.mark.parametrize("turns", [0.0, 6.0])
def test_the_band_drawn_is_the_band_judged_with_its_ends(turns):
    t = np.linspace(-1.0, 3.0, 400)
    x, y = t, 0.5 * np.sin(turns * t)
    wide, high = 0.2 + 0.06 * np.abs(x), 0.1 + 0.03 * np.abs(y)
    over, values = CrossPlot("roll_angle", t, x, y, wide, high, ()).outline

    def distance(at_x, at_y):
        return np.sqrt((((at_x[:, None] - x) / wide) ** 2 + ((at_y[:, None] - y) / high) ** 2).min(axis=1))

    edge = ~np.isnan(over)
    off = np.abs(distance(over[edge], values[edge]) - 1.0)
    assert np.quantile(off, 0.95) < 0.01 and off.max() < 0.05  # corners between two stretches are rounded
    assert (np.nanmin(over), np.nanmax(over)) == pytest.approx((-1.26, 3.38), abs=0.02)  # an end is round
    rng = np.random.default_rng(2)
    points = np.column_stack([rng.uniform(-2.0, 4.0, 3000), rng.uniform(-1.0, 1.0, 3000)])
    loops = np.split(np.column_stack([over, values]), np.flatnonzero(~edge))
    inside = np.zeros(len(points), dtype=int)
    for loop in loops:
        inside += Line(loop[~np.isnan(loop[:, 0])], closed=True).contains_points(points)
    far = distance(*points.T)
    clear = np.abs(far - 1.0) > 0.05
    assert np.array_equal((inside % 2 == 1)[clear], (far < 1.0)[clear])


def test_the_page_carries_run_band_and_tests_to_the_side_of_the_run(validation, page):
    samples, (plot,) = Samples(page), validation.plots
    data = samples.data
    labels = [run["label"] for run in data["runs"]]
    assert [labels[0], labels[-1]] == [validation.title, "tolerance"]
    assert [label.endswith(", mirrored") for label in labels[1:-1]] == [False, False, True, True]
    assert [run["band"] for run in data["runs"]] == 5 * [False] + [True]
    assert [view["x"] for view in data["views"]] == ["plant.acceleration_y", "time"]
    assert data["views"][1]["shown"] == [0, 1, 2, 3, 4]
    assert {name for name, *_ in data["limits"]} == {"steering_wheel_angle.distance"}
    for k, test in enumerate(plot.tests, start=1):
        for name, wanted in (
            ("plant.acceleration_y", test.over),
            ("plant.steering_wheel_angle", test.values),
            ("steering_wheel_angle.distance", test.distance),
        ):
            values, step = samples.of(k, name)
            assert np.abs(values - wanted).max() <= 0.5 * step * (1 + 1e-9), name


def test_a_recording_of_another_time_begins_with_the_run_so_that_the_slider_ends_with_the_data(validation):
    (plot,) = validation.plots
    late = replace(plot, tests=[plot.tests[0], replace(plot.tests[1], time=plot.tests[1].time + 749.0)])
    data = data_in(validation_page(replace(validation, plots=[late])))
    assert data["offsets"] == {"2": pytest.approx(plot.time[0] - late.tests[1].time[0])}
    assert data_in(validation_page(validation))["offsets"] == {}


@pytest.mark.parametrize(("width", "colours"), looks(PHONE, DESK, narrow=True))
def test_the_page_has_no_flaws_and_stays_within_its_budget(chromium: Browser, page, width, colours):
    check_whole(chromium, page, width, colours)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The findings of a study with two validations, and its page."""
    folder = tmp_path_factory.mktemp("study")
    write_study(folder, steer_angle="0.5 deg")
    run = whole_car()
    wheel = "driver.steering_wheel_angle"
    run.columns[wheel], run.units[wheel] = 15.0 * run.columns["driver.steer_angle"], "rad"
    write_run(run, folder / "ramp")
    findings = judge_results(load_experiment(folder / "study.yaml"), folder)
    page = folder / "report.html"
    page.write_text(render(chapter(findings, command="yawbench study", stale={}, folder=folder)), "utf-8")
    return findings, page


def test_a_study_has_a_chapter_on_its_validations(study):
    findings, page = study
    tree = html.fromstring(unpacked(page))
    near, far = findings.sections["validations"]
    assert len(tree.cssselect("#validations ~ h3")) == 2
    assert "2 tests of the car" in tree.text_content()
    assert {near.source, far.source} == {"chosen", near.source}


@pytest.mark.exhaustive
@pytest.mark.parametrize(("width", "colours"), [*product((PHONE, DESK), COLOURS)])
def test_the_page_of_a_study_with_validations_has_no_flaws(chromium: Browser, study, width, colours):
    chromium.open(study[1], width=width)
    assert flaws(chromium) == []
    assert inaccessible(chromium, colours) == []
