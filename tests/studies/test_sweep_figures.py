"""Figures, limits and tables of sweeps, of values made up in place of runs."""

from __future__ import annotations

import math

import pyarrow.parquet as pq
import pytest

from tests.orchestrator.fakes import Clock, make_plan
from tests.orchestrator.recorded import car, noted
from tests.refusals import each_mentions, mentions, refused
from yawbench.foundation.errors import Diagnostic, ResultsError
from yawbench.studies.experiment import PlannedExperiment
from yawbench.studies.experiment_result import ExperimentResult
from yawbench.studies.jobs import Job, MeasuredRun, measured
from yawbench.studies.limits import limit_table, limits_of
from yawbench.studies.load_experiment import load_experiment
from yawbench.studies.result_figures import draw_over_axes
from yawbench.studies.result_files import columns_of, write_findings
from yawbench.studies.tables import to_pandas

SWEEP = """
title: Made up
scenario: none.yaml
axes:
  friction: {vary: inputs.friction, values: [0.2, 0.5, 1.0]}
  speed: {vary: plant.initial_speed, from: 36, to: 144, count: 4, unit: km/h, says: Entry speed}
  control: {vary: controller, values: {a: without, b: with}}
metrics:
  sideslip: {metric: peak(sideslip), heading: Largest sideslip}
limits:
  stable: {says: Stable up to, of: speed, holds_if: [{metric: sideslip, below: 10 deg}]}
figures:
  - {name: limit, kind: limit, limit: stable, x: friction, lines: control}
  - {name: map, kind: map, metric: sideslip, x: friction, y: speed, panels: control, mark: 10 deg, largest: 1}
  - {name: curve, kind: curve, metric: sideslip, x: speed, lines: control, panels: friction, mark: 10 deg}
  - name: some
    kind: curve
    metric: sideslip
    x: speed
    lines: control
    panels: friction
    only: {friction: [0.5]}
  - {name: names, kind: curve, metric: sideslip, x: control, lines: friction, panels: speed, scale: log}
  - name: narrow
    kind: curve
    metric: sideslip
    x: control
    lines: speed
    panels: friction
    only: {control: b, speed: [36, 144]}
"""  # fmt: skip


def degrees(friction, speed, control):
    """Return the sideslip that a run would come to [degrees]; None for one that failed."""
    if friction == 0.2 and control == "b" and speed == 72.0:
        return None
    return (speed / 36) ** 2 / friction * (1.0 if control == "a" else 0.25)


@pytest.fixture
def swept(tmp_path):
    """Return the sweep with a value for every run."""

    def make(value=degrees):
        (tmp_path / "sweep.yaml").write_text(SWEEP)
        sweep = load_experiment(tmp_path / "sweep.yaml")
        plan = make_plan({"plant": Clock(sideslip=math.sin)})
        jobs, records = [], []
        for number, point in enumerate(sweep.points):
            jobs.append(Job("", tmp_path, tmp_path, plan=plan, key=f"{number:032}"))
            found = value(*(level.value for level in point))
            values = {} if found is None else {"sideslip": (math.radians(found), "rad")}
            records.append(
                MeasuredRun(values, () if values else (Diagnostic("run-failed", "plant: it failed"),))
            )
        units = {"friction": "1", "speed": "m/s"}
        return ExperimentResult(
            sweep,
            records,
            {},
            PlannedExperiment(sweep, jobs, [job.key for job in jobs], units, {"sideslip": "rad"}, {}),
        )

    return make


def figure(swept, name):
    specs = {spec.name: spec for spec in swept.spec.figures}
    return draw_over_axes(swept, specs[name])


def legend(drawn):
    return [text.get_text() for text in drawn.legends[0].get_texts()]


def test_a_limit_is_the_largest_value_that_holds_with_all_below_it(swept):
    made = swept()
    found = {
        (limit.others["friction"].value, limit.others["control"].value): (limit.largest, limit.beyond)
        for limit in limits_of(made, made.spec.limits["stable"])
    }
    assert found == {
        (0.2, "a"): (36.0, 72.0),
        (0.2, "b"): (36.0, 72.0),  # there the run failed
        (0.5, "a"): (72.0, 108.0),
        (0.5, "b"): (144.0, None),
        (1.0, "a"): (108.0, 144.0),
        (1.0, "b"): (144.0, None),
    }
    again = swept(lambda friction, speed, control: 50.0 if speed == 72.0 else 1.0)
    assert {limit.largest for limit in limits_of(again, again.spec.limits["stable"])} == {36.0}
    table = limit_table(made, "stable")
    assert table.rows[0] == ["0.2", "without", "36.0", "72.0"]
    assert table.rows[1] == ["0.2", "with", "36.0", "72.0 (the run failed)"]
    assert table.rows[3] == ["0.5", "with", "144", "-"]
    assert mentions(table.title, "km/h", "Stable")


def test_the_table_says_of_every_run_how_it_ended_and_why(swept):
    made = swept()
    run = car()
    noted(run, ended={"unit": "plant", "time": 0.5, "message": "plant: ended the run at t = 0.5 s"})
    made.records[0] = measured(run, (("sideslip", "peak(sideslip)", None),))
    table = to_pandas(columns_of(made))
    ends = dict(zip(table["status"], table["reason"].fillna(""), strict=True))
    assert ends == {
        "ended early": "plant: ended the run at t = 0.5 s",
        "completed": "",
        "failed": "plant: it failed",
    }
    assert made.records[0].values == {"sideslip": None}


def test_a_limit_is_drawn_as_a_line_and_a_band_to_the_first_value_that_fails(swept):
    drawn = figure(swept(), "limit")
    (axes,) = drawn.axes
    assert mentions(axes.get_ylabel(), "km/h", "Entry")
    assert axes.get_lines()[0].get_ydata().tolist() == [36.0, 72.0, 108.0]
    assert axes.collections[0].get_paths()[0].get_extents().y1 == 144.0
    assert legend(drawn)[:2] == ["without", "with"]
    assert each_mentions(legend(drawn)[2:], ("first value", "fails"), ("all values", "hold"))


def test_a_map_has_a_cell_per_run_a_cross_where_it_failed_and_the_edge_of_the_mark(swept):
    drawn = figure(swept(), "map")
    without, with_, bar = drawn.axes
    cells = without.collections[0].get_array()
    assert cells.shape == (4, 3)
    assert cells[0].tolist() == pytest.approx([5.0, 2.0, 1.0])
    assert headings(drawn)[:2] == ["without", "with"]
    crosses = [line for line in with_.get_lines() if line.get_marker() == "x"]
    assert crosses[0].get_xydata().tolist() == [[0.2, 72.0]]
    assert mentions(bar.get_ylabel(), "Largest", "sideslip")
    assert each_mentions(legend(drawn), ("10.0 °", "line"), ("never", "number"))


def headings(drawn):
    return [axes.get_title(loc="left") for axes in drawn.axes]


def test_curves_have_a_panel_per_level_and_only_those_that_are_asked_for(swept):
    drawn = figure(swept(), "curve")
    assert headings(drawn) == ["friction 0.2", "friction 0.5", "friction 1.0"]
    assert drawn.axes[0].get_lines()[0].get_ydata().tolist() == pytest.approx([5.0, 20.0, 45.0, 80.0])
    assert mentions(drawn.axes[0].get_xlabel(), "km/h", "Entry")
    assert headings(figure(swept(), "some")) == ["friction 0.5"]
    never = swept(lambda friction, speed, control: math.inf if speed == 36.0 else 1.0)
    crosses = [line for line in figure(never, "curve").axes[0].get_lines() if line.get_marker() == "x"]
    assert crosses[0].get_xdata() == [36.0]  # what never ends


def test_an_axis_of_names_is_drawn_in_its_order_with_only_the_values_that_are_asked_for(swept):
    names, narrow = (figure(swept(), name).axes[-1] for name in ("names", "narrow"))
    assert [tick.get_text() for tick in names.get_xticklabels()] == ["without", "with"]
    assert names.get_yscale() == "log"
    assert [tick.get_text() for tick in narrow.get_xticklabels()] == ["with"]
    assert [line.get_xydata().tolist() for line in narrow.get_lines()] == [[[0.0, 0.25]], [[0.0, 4.0]]]


def test_a_metric_that_no_run_gives_cannot_be_drawn(swept):
    with refused(ResultsError, "nothing-to-draw"):
        figure(swept(lambda *point: None), "curve")


def test_equal_sweeps_give_equal_tables_to_the_byte(swept, tmp_path):
    for name in ("one", "other"):
        write_findings(swept(), {}, tmp_path / name)
    assert (tmp_path / "one/table.parquet").read_bytes() == (tmp_path / "other/table.parquet").read_bytes()
    table = pq.read_table(tmp_path / "one/table.parquet")
    assert table["speed"].to_pylist()[:4] == [10.0, 10.0, 20.0, 20.0]
    assert table["sideslip"].null_count == 1
    assert [why for why in table["reason"].to_pylist() if why] == ["plant: it failed"]
    assert table.schema.field("sideslip").metadata[b"metric"] == b"peak(sideslip)"
