"""Errors, orders and figures of convergence studies, from made-up runs of known order."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.changed import changed
from tests.orchestrator.recorded import results, write
from tests.refusals import mentions, refused
from yawbench.foundation.errors import Diagnostic, ResultsError, ScenarioError
from yawbench.studies.convergence import (
    convergence_figure,
    convergence_table,
    measure,
    refinements,
)
from yawbench.studies.experiment import NamedRun, experiment_of
from yawbench.studies.experiment_result import judge_results
from yawbench.studies.jobs import Job, Outcome

H = 0.04
SIGNAL = "plant.yaw_rate"


def made(folder: Path, orders: dict[str, int], halvings: int = 3, scale: float = 0.5, lost=()):
    """Return what runs of sin(t) come to whose error is scale * sin(2 t) h^order; `lost`: (run, why)."""
    runs = []
    for name, order in orders.items():
        for k in range(halvings + 1):
            step = H / 2**k
            t = np.linspace(0, 2, round(2 / step) + 1)
            recorded = results({SIGNAL: np.sin(t) + scale * step**order * np.sin(2 * t)}, t)
            write(recorded, folder / name / str(k), wall_time=float(2**k))
            given = changed(step_size=step, algorithm=name)
            runs.append(NamedRun(f"{name}/{k}", f"{name} {k}", "", Path("x.yaml"), given))
    experiment = experiment_of(Path("x.yaml"), runs, title="title")
    failed = [Outcome(Job(name, Path(), folder), (Diagnostic("run-failed", why),), 1) for name, why in lost]
    return judge_results(experiment, folder, failed)


def test_observed_orders_are_those_of_the_methods(tmp_path):
    rows = measure(made(tmp_path, {"extrapolated": 2, "gauss_seidel": 1}), SIGNAL)
    approx = pytest.approx
    assert [row.order for row in rows[:4]] == [approx(2.0, abs=1e-9), approx(2.0, abs=1e-9), None, None]
    assert [row.order for row in rows[4:]] == [approx(1.0, abs=1e-9), approx(1.0, abs=1e-9), None, None]


def test_errors_are_relative_to_the_peak_and_against_the_finest_run_of_the_first_algorithm(tmp_path):
    rows = measure(made(tmp_path, {"extrapolated": 2, "jacobi": 1}), SIGNAL)
    errors = {(row.algorithm, row.step): row.error for row in rows}
    finest = 0.5 * (H / 8) ** 2
    largest = np.max(np.abs(np.sin(2 * np.linspace(0, 2, 51))))
    peak = np.max(np.abs(np.sin(t := np.linspace(0, 2, 401)) + finest * np.sin(2 * t)))
    assert errors["extrapolated", H] == pytest.approx((0.5 * H**2 - finest) * largest / peak, rel=1e-9)
    assert errors["jacobi", H / 8] == pytest.approx((0.5 * H / 8 - finest) * largest / peak, rel=1e-9)
    assert errors["extrapolated", H / 8] is None


def test_a_failed_run_leaves_the_others_their_errors(tmp_path):
    lost = [("jacobi/0", "plant: not finite")]
    rows = measure(made(tmp_path, {"extrapolated": 2, "jacobi": 1}, lost=lost), SIGNAL)
    failed = rows[4]
    assert (failed.error, failed.order, failed.wall_time) == (None, None, None)
    assert mentions(failed.failed, "plant", "finite")
    assert rows[5].order == pytest.approx(1.0, abs=1e-9)
    text = convergence_table(rows, "title").text()
    assert mentions(text[4][2], "finite", "plant")


def test_without_the_finest_run_orders_are_left(tmp_path):
    lost = [("extrapolated/3", "the process of this run died")]
    rows = measure(made(tmp_path, {"extrapolated": 2}, lost=lost), SIGNAL)
    assert [row.error for row in rows] == [None] * 4
    assert rows[0].order == pytest.approx(2.0)
    *others, finest = (row[2] for row in convergence_table(rows, "title").text())
    assert others == ["-"] * 3
    assert mentions(finest, "failed", "the process of this run died")


def test_a_signal_that_is_zero_throughout_is_an_error(tmp_path):
    experiment = made(tmp_path, {"extrapolated": 2}).experiment
    for k in range(4):
        write(results({SIGNAL: np.zeros(3)}), tmp_path / "extrapolated" / str(k))
    with refused(ResultsError, "signal-zero", names=("plant.yaw_rate", "--signal")):
        measure(judge_results(experiment, tmp_path), SIGNAL)


def test_the_table_says_step_error_order_and_cost(tmp_path):
    rows = convergence_table(measure(made(tmp_path, {"extrapolated": 2}), SIGNAL), "title").text()
    for column, expected in (
        (0, ["extrapolated"] * 4),
        (1, ["40 ms", "20 ms", "10 ms", "5 ms"]),
        (3, ["2.00", "2.00", "-", "-"]),
        (4, ["1.00 s", "2.00 s", "4.00 s", "8.00 s"]),
    ):
        assert [row[column] for row in rows] == expected
    assert rows[-1][2] == "the finest"


def test_runs_that_do_not_differ_cannot_be_drawn(tmp_path):
    rows = measure(made(tmp_path, {"extrapolated": 2}, scale=0.0), SIGNAL)
    with refused(ResultsError, "nothing-to-draw"):
        convergence_figure(rows, SIGNAL, "title", "note")


SCENARIO = """
stop_time: 1
step_size: 0.004
algorithm: jacobi
units:
  plant: {fmu: plant_some}
  controller: {fmu: controller_some, step_size: 0.008}
"""


@pytest.mark.parametrize(
    ("asked", "expected"), [(["extrapolated", "jacobi"],) * 2, ([], ["jacobi"])], ids=["asked for", "default"]
)
def test_steps_are_halved_exactly_by_the_algorithms_asked_for_or_the_scenarios_own(asked, expected, tmp_path):
    (tmp_path / "s.yaml").write_text(SCENARIO)
    experiment = refinements(tmp_path / "s.yaml", halvings=3, signal=SIGNAL, algorithms=asked)
    found = [(job.changes[-2].value, job.changes[-1].value) for job in experiment.runs.values()]
    assert found == [(name, step) for name in expected for step in (0.004, 0.002, 0.001, 0.0005)]


def test_a_signal_without_its_unit_is_an_error(tmp_path):
    (tmp_path / "s.yaml").write_text(SCENARIO)
    names = ("--signal yaw_rate", "INSTANCE.VARIABLE", "plant.yaw_rate")
    with refused(ScenarioError, "option-invalid", names=names):
        refinements(tmp_path / "s.yaml", halvings=2, signal="yaw_rate", algorithms=[])
