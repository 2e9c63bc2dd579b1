"""Experiments that depend on the results of earlier ones: a bisection, side by side for several runs."""

from __future__ import annotations

import gc
import tracemalloc
from dataclasses import replace

import pytest

from tests.refusals import refused
from tests.studies.test_repeats import SCENARIO
from yawbench.foundation import workers
from yawbench.foundation.errors import Diagnostic, ResultsError, ScenarioError
from yawbench.orchestrator.plan import Override
from yawbench.studies.axes import DesignAxisSpec, Level, axis_of_levels
from yawbench.studies.executor import Executor, runner_of
from yawbench.studies.experiment import NamedRun, experiment_of
from yawbench.studies.jobs import MeasuredRun, Outcome, run_job
from yawbench.studies.limit_search import highest_passing, side_by_side

UNITS = ("sensor_ideal",)
GAIN = "sensor.yaw_rate_gain"
RATES = {"slow": 1.0, "fast": 2.0}
"""Run -> true yaw rate [rad/s]."""


def named_runs(folder):
    (folder / "gyro.yaml").write_text(SCENARIO)
    given = {name: Override.of("inputs.sensor.yaw_rate_true", rate, "test") for name, rate in RATES.items()}
    return [NamedRun(name, name, name, folder / "gyro.yaml", (change,)) for name, change in given.items()]


METRICS = {"last": {"metric": "final(sensor.yaw_rate)"}}


def over_gains(folder, *, runs=2, **levels):
    """Return an experiment of named runs along an axis of gains."""
    axis = DesignAxisSpec.model_validate({"vary": GAIN, **(levels or {"values": [0.5, 1.0]})})
    return experiment_of(
        folder / "e.yaml", named_runs(folder)[:runs], title="t", axes={"g": axis}, metrics=METRICS
    )


def bisected(folder, execute, limit, resolution):
    """Return run -> highest gain with a last value below a limit, and the lowest above, in rounds."""
    runs = named_runs(folder)

    def below(gains):
        design = [(name, (Level(gain, f"{gain:g}"),)) for name, gain in gains.items()]
        found = execute(
            experiment_of(
                folder / "bisection.yaml", runs, title="bisection", design=design,
                axes={"gain": axis_of_levels(GAIN, [level for _, (level,) in design])},
                metrics=METRICS,
            ),
            keep=False,
        )  # fmt: skip
        return {case.run.name: found.value(case, "last").number < limit for case in found.experiment.cases}

    bounds = {"first": 0.5, "step": 0.25, "resolution": resolution, "least": 0.0, "most": 1.0}
    return side_by_side({name: highest_passing(**bounds) for name in RATES}, below)


@pytest.fixture
def executor(tmp_path, fmus):
    """Return an executor in the folder, which resumes what is there, and the list of runs that it makes."""
    made = []

    def runner(jobs, done):
        for job in jobs:
            made.append(job)
            done(Outcome(job, value=run_job(job)))

    return lambda: (Executor(tmp_path, "bisection", runner, of_jobs={"fmus": fmus}), made)


def test_a_bisection_of_several_runs_resumes_with_what_is_in_the_journal(executor, tmp_path):
    execute, made = executor()
    with execute:
        found = bisected(tmp_path, execute, 0.7, 1 / 8)
    assert found == {"slow": (0.625, 0.75), "fast": (0.25, 0.375)}  # about 0.7 and 0.35
    assert len(made) == len(RATES) * 3
    with executor()[0] as execute:
        found = bisected(tmp_path, execute, 0.7, 1 / 16)
    assert found == {"slow": (0.6875, 0.75), "fast": (0.3125, 0.375)}
    assert len(made) == len(RATES) * 4  # one more halving


def test_rounds_of_a_search_share_their_processes_which_end_with_the_executor(tmp_path, fmus, monkeypatch):
    started = []

    class Counted(workers.Worker):
        def __init__(self, *arguments):
            started.append(self)
            super().__init__(*arguments)

    monkeypatch.setattr(workers, "Worker", Counted)
    with Executor(tmp_path, "bisection", runner_of(1, None), of_jobs={"fmus": fmus}) as execute:
        bisected(tmp_path, execute, 0.7, 1 / 8)  # three rounds
        assert len(started) == 1
        assert not started[0].child.ended()
    assert started[0].child.ended()


def test_cases_left_out_count_only_if_they_are_finished(executor, tmp_path):
    execute, made = executor()
    experiment = over_gains(tmp_path)
    with execute:
        first = execute(experiment, only=lambda case: case.run.name == "slow")
        assert [record.made for record in first.records] == [True, True, False, False]
        again = execute(experiment, only=lambda case: case.run.name == "fast")
        assert [again.value(case, "last").number for case in experiment.cases] == [0.5, 1.0, 1.0, 2.0]
    assert len(made) == 4
    assert all((job.out / "run.json").is_file() for job in made)


def test_plans_of_runs_hold_what_an_experiment_may_depend_on(executor, tmp_path):
    execute, _ = executor()
    with execute:
        (plan, _) = execute.plans(named_runs(tmp_path))
        assert plan.time(plan.n_steps) == pytest.approx(0.1)
        wrong = replace(named_runs(tmp_path)[0], changes=(Override.of("sensor.gian", 1.0, "test"),))
        with pytest.raises(ScenarioError):
            execute.plans([wrong])


def bytes_per_run(folder, fmus, monkeypatch, *, few=10, many=40):
    """Return how many bytes each run adds to what an experiment holds when all have been planned and made."""
    monkeypatch.setattr("yawbench.studies.on_demand.IN_MEMORY", 1)
    monkeypatch.setattr("os.fsync", lambda file: None)

    def runner(jobs, done):
        for job in jobs:
            done(Outcome(job, value=MeasuredRun({"last": (job.plan.time(job.plan.n_steps), "rad/s")})))

    def held(count):
        experiment = over_gains(folder, runs=1, **{"from": 0.5, "to": 1.5, "count": count})
        with Executor(folder / f"{count}", "many", runner, of_jobs={"fmus": fmus}) as execute:
            tracemalloc.start()
            result = execute(experiment, keep=False)
            gc.collect()
            traced, _ = tracemalloc.get_traced_memory()
            tracemalloc.stop()
        assert result.not_made == 0
        return traced

    held(few)  # what is made once for all experiments
    return (held(many) - held(few)) / (many - few)


def test_memory_holds_neither_plans_nor_cases_of_a_campaign(tmp_path, fmus, monkeypatch):
    assert bytes_per_run(tmp_path, fmus, monkeypatch) < 500  # its key and its record


def test_plans_that_cannot_be_stored_are_one_sentence(executor, tmp_path, monkeypatch):
    monkeypatch.setattr("yawbench.studies.on_demand.IN_MEMORY", 1)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "missing"))
    execute, _ = executor()
    with execute, refused(ResultsError, names=(tmp_path / "missing", "TMPDIR")):
        execute.plans(named_runs(tmp_path))


def found_by(passing, **bounds):
    search = highest_passing(**bounds)
    return side_by_side({"x": search}, lambda values: {name: passing(v) for name, v in values.items()})["x"]


@pytest.mark.parametrize("edge", [47.3, 60.0, 61.26, 83.0])
def test_the_highest_passing_value_is_found_to_the_resolution_from_either_side(edge):
    asked = []

    def passing(v):
        asked.append(v)
        return v < edge

    good, bad = found_by(passing, first=60.0, step=10.0, resolution=0.5, least=10.0, most=250.0)
    assert good < edge <= bad <= good + 0.5
    assert len(asked) == len(set(asked)) < 12


def test_a_search_where_all_or_no_values_pass_ends_at_the_bounds():
    bounds = {"first": 60.0, "step": 10.0, "resolution": 0.5, "least": 35.0, "most": 82.0}
    assert found_by(lambda v: True, **bounds) == (82.0, None)
    assert found_by(lambda v: False, **bounds) == (None, 35.0)


@pytest.mark.parametrize(("code", "counts"), [("results-unwritable", False), ("fmu-call-failed", True)])
def test_a_search_concludes_nothing_from_a_failure_of_the_machine(code, counts, executor, tmp_path):
    execute, _ = executor()

    def runner(jobs, done):
        for job in jobs:
            done(Outcome(job, (Diagnostic(code, "why it failed"),), 1))

    with replace(execute, runner=runner) as failing:
        found = failing(over_gains(tmp_path), keep=False)
    assert [record.status for record in found.records] == ["failed"] * 4
    if counts:
        assert found.of_models() is found
        return
    with refused(ResultsError, "runs-missing", names=("why it failed", "4 runs")):
        found.of_models()
