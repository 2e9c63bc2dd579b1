"""Additions by CONTRIBUTING's table: what is added to its one place works wherever the program uses it."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import yawbench as yb
from tests.command_line import status_of
from tests.orchestrator.fakes import Clock, Stage, Witness, make_plan
from tests.refusals import mentions, refused
from yawbench.foundation.errors import ScenarioError
from yawbench.metrics.verdict import compare
from yawbench.orchestrator.coupling_algorithms import ALGORITHMS, CouplingAlgorithm, CouplingWeights
from yawbench.orchestrator.fault_kinds import KINDS, FaultKind
from yawbench.orchestrator.master.simulate import simulate_in_memory
from yawbench.orchestrator.results import file_formats
from yawbench.orchestrator.results.recorder import ColumnRecorder
from yawbench.orchestrator.scenario.overrides import read_changes
from yawbench.proving_ground import standard_tests
from yawbench.proving_ground.standard_tests import DRIVEN, TESTS, SeriesRun, StandardTest, evaluation
from yawbench.studies.axis_figures import MetricDrawing
from yawbench.studies.experiment import PlannedExperiment
from yawbench.studies.experiment_result import ExperimentResult
from yawbench.studies.jobs import Job, MeasuredRun
from yawbench.studies.load_experiment import load_experiment
from yawbench.studies.result_figures import draw_all
from yawbench.studies.schema import FIGURE_KINDS, FigureKind

UNITS = ("driver_sine",)
STEERED = """\
title: A driver alone
stop_time: 1
step_size: 10 ms
units: {driver: {fmu: driver_sine, parameters: {amplitude: 0.3, frequency: 1.0, start_time: 0.0}}}
"""


@pytest.fixture
def steered(fmus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> yb.Scenario:
    """A scenario of one FMU."""
    monkeypatch.chdir(tmp_path)
    Path("steered.yaml").write_text(STEERED)
    Path("fmus").symlink_to(fmus)
    return yb.load("steered.yaml")


def test_a_kind_of_fault_is_one_entry(steered, monkeypatch):
    floor = FaultKind("at least value", lambda signal, held: lambda t, x: max(x, signal.value), "{x}")
    monkeypatch.setitem(KINDS, "floor", floor)
    at, healthy = "driver.steer_angle", steered.run()["driver.steer_angle"]
    assert np.min(healthy) < -0.01
    seen = steered.fault(at, kind="floor", value=-0.01).run()["driver.steer_angle"]
    assert seen == pytest.approx(np.maximum(healthy, -0.01))
    assert mentions(
        str(read_changes(faults=[f"{at}: floor 1 deg"])[0]), "--fault driver.steer_angle", "1 deg", "floor"
    )
    with refused(
        ScenarioError, "value-invalid", names=("--fault driver.steer_angle", "1 deg", "seed 3", "floor")
    ):
        read_changes(faults=[f"{at}: floor 1 deg seed 3"])


class NpzRecorder(ColumnRecorder):
    """Records a run as NumPy's archive."""

    file = "results.npz"

    def _complete(self, record):
        names = ["time", *self.columns]
        data = io.BytesIO()
        np.savez(data, **dict(zip(names, self._columns.arrays(), strict=True)))
        self._append(data.getvalue())


class NpzFile:
    """NumPy's archive of results."""

    def __init__(self, path, texts=None):
        self._columns = np.load(path)
        self.names = list(self._columns)

    def blocks(self, columns):
        yield [file_formats.plain(self._columns[name]) for name in columns]


def test_a_format_is_a_module_and_an_entry(steered, monkeypatch):
    module = ModuleType("yawbench.orchestrator.results.npz")
    module.NpzRecorder, module.NpzFile = NpzRecorder, NpzFile
    monkeypatch.setitem(sys.modules, module.__name__, module)
    entry = file_formats.Format("results.npz", "NumPy's archive", "npz:NpzRecorder", "npz:NpzFile", 8)
    monkeypatch.setitem(file_formats.FORMATS, "npz", entry)
    monkeypatch.setitem(file_formats.FILES, "npz", entry.file)
    for name in ("npz", "csv"):
        assert status_of("run", "steered.yaml", "--format", name, "--out", name) == 0
    assert sorted(path.name for path in Path("npz").iterdir()) == ["results.npz", "run.json"]
    binary, text = yb.open("npz"), yb.open("csv")
    assert list(binary.results) == list(text.results)
    assert all((binary[name] == text[name]).all() for name in text.results)
    assert status_of("diff", "npz", "csv") == 0


def test_a_coupling_algorithm_is_one_entry(steered, monkeypatch):
    averaged = CouplingAlgorithm(
        lambda timing, k: CouplingWeights(0.5, 0.5), lambda period, direct: period, needs_before=True
    )
    monkeypatch.setitem(ALGORITHMS, "averaged", averaged)
    units = {"source": Clock(x=lambda t: t), "target": Witness()}
    plan = make_plan(units, ["source.x -> target.end"], step="1/8", n_steps=8, algorithm="averaged")
    results = simulate_in_memory(plan, opener=Stage(units))
    assert results["target.y"][1:] == pytest.approx(results.time[1:] - 1 / 16)
    assert steered.set({"algorithm": "averaged"}).plan().algorithm == "averaged"
    with refused(ScenarioError, "value-invalid", names=("algorithm=average", "'averaged'", "'average'")):
        steered.set({"algorithm": "average"})


def test_a_standard_test_with_its_series_is_a_module_and_an_entry(steered, monkeypatch):
    @evaluation
    def evaluate(judged, trace):
        judged.add("angle", "largest angle", np.max(np.abs(trace["steering_wheel_angle"])), "rad")
        judged.rule("some", compare(judged["angle"], "above", 0.15, "rad", why="larger than 0.15 rad"))

    def drive(driver):
        runs = [SeriesRun(f"{a:g}", f"{a:g} rad", {"driver.amplitude": a}, "wiggle") for a in (0.1, 0.2)]
        judged = driver.make(runs)
        return standard_tests.TestSeries(
            judged, f"{len(judged)} runs of {driver.duration:g} s.", {"runs": len(judged)}
        )

    module = ModuleType("yawbench.proving_ground.wiggle")
    module.evaluate, module.drive = evaluate, drive
    monkeypatch.setitem(sys.modules, module.__name__, module)
    entry = StandardTest(
        "wiggle", "a dummy", "wiggle:evaluate", ("angle",), driving="wiggle:drive", driven_as=("wiggle-1",)
    )
    monkeypatch.setitem(TESTS, "wiggle", entry)
    monkeypatch.setitem(DRIVEN, "wiggle-1", entry)
    for command in ("drive", "evaluate"):
        monkeypatch.delitem(sys.modules, f"yawbench.commands.{command}", raising=False)
    assert status_of("drive", "wiggle-1", "--scenario", "steered.yaml", "--out", "out") == 0
    found = json.loads(Path("out/evaluation.json").read_text())
    assert found["series"] == {"runs": 2}
    assert [run["verdict"] for run in found["runs"]] == ["failed", "passed"]
    assert status_of("evaluate", "wiggle", "out/0.1", "--no-figures") == 0


class BarDrawing(MetricDrawing):
    """A bar per level of an axis."""

    def fill(self, axes, runs):
        values = [self.shown(self.value(run))[0] for run in runs]
        axes.bar([self.coordinate(self.at(run, self.spec.x), self.spec.x) for run in runs], values)


SWEEP = """\
title: Bars
scenario: steered.yaml
axes: {amplitude: {vary: driver.amplitude, values: [0.1, 0.2]}}
metrics: {angle: {metric: peak(driver.steer_angle)}}
figures: [{name: bars, kind: bar, metric: angle, x: amplitude}]
"""


def test_a_figure_on_the_report_is_a_drawing_and_an_entry(steered, monkeypatch):
    module = ModuleType("yawbench.studies.bars")
    module.BarDrawing = BarDrawing
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setitem(FIGURE_KINDS, "bar", FigureKind("metric", "bars:BarDrawing"))
    Path("bars.yaml").write_text(SWEEP)
    sweep = load_experiment(Path("bars.yaml"))
    jobs = [Job("", Path(), Path(), plan=steered.plan(), key=f"{k:032}") for k in range(2)]
    records = [MeasuredRun({"angle": (level.value, "rad")}) for (level,) in sweep.points]
    keys = [job.key for job in jobs]
    planned = PlannedExperiment(sweep, jobs, keys, {"amplitude": "rad"}, {"angle": "rad"}, {})
    drawn, problems = draw_all(ExperimentResult(sweep, records, {}, planned), Path("out"))
    assert (drawn, problems) == ({"bars": "Bars: bars"}, [])
    assert Path("out/figures/bars.svg").is_file()
    Path("bars.yaml").write_text(SWEEP.replace(", x: amplitude", ""))
    with pytest.raises(ScenarioError, match="a bar needs x"):
        load_experiment(Path("bars.yaml"))
