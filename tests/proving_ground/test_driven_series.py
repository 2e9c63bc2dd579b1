"""`evaluate` on the folder of `drive`: the same verdict, and the evaluation of `drive` stays."""

from __future__ import annotations

import json
import shutil
from math import degrees, radians
from pathlib import Path

import numpy as np
import pytest

from tests.command_line import status_of
from tests.orchestrator.recorded import results, write
from tests.proving_ground.test_sine_with_dwell import slow_steer, trace
from tests.refusals import mentions
from yawbench.commands.evaluate import DRIVE, EvaluatedRuns
from yawbench.orchestrator.results.reader import load_results
from yawbench.proving_ground.sine_with_dwell import amplitudes, judge_series
from yawbench.proving_ground.standard_tests import TESTS
from yawbench.proving_ground.trace import Trace, trace_of

DWELL = TESTS["sine-with-dwell"]


def sampled(last: float) -> np.ndarray:
    return np.arange(0.0, last, 0.01)


UNITS = {
    "driver.steering_wheel_angle": "rad",
    "plant.yaw_rate": "rad/s",
    "plant.acceleration_y": "m/s2",
    "plant.sideslip": "rad",
    "plant.velocity_x": "m/s",
}


def record(folder: Path, made: Trace, **changes: object) -> Path:
    """Write a trace as the results of a run."""
    columns = {name: made.signals[name.partition(".")[2]] for name in UNITS if name.partition(".")[2] in made}
    return write(results(columns, made.time, UNITS), folder, **changes)


@pytest.fixture
def series(driven, tmp_path) -> Path:
    """A copy of the folder of a driven series."""
    return Path(shutil.copytree(driven, tmp_path / "series"))


@pytest.fixture(scope="module")
def driven(tmp_path_factory) -> Path:
    """The folder of a driven series with A = 180 degrees, which asks for two amplitudes to each side.

    Beside its runs are those of slowly increasing steer, which give 40 degrees. The last run failed after the
    times that are judged, so it is judged as far as it goes.
    """
    place = tmp_path_factory.mktemp("driven")
    angle, traces = radians(180.0), []
    for name, side in (("left", 1.0), ("right", -1.0)):
        record(place / "slowly_increasing_steer" / name, slow_steer(side, sampling=sampled))
        for amplitude in amplitudes(angle):
            label = f"{name}_first/{degrees(amplitude):.2f}"
            failed = side < 0.0 and amplitude == amplitudes(angle)[-1]
            error = {"kind": "SimulationError", "message": "the car has rolled over"}
            changes = {"status": "failed", "error": error} if failed else {}
            record(place / label, trace(side * amplitude, sampling=sampled), **changes)
            traces.append(trace_of(load_results(place / label), label))
    judged = [DWELL.evaluate(one, angle) for one in traces]
    of_series = judge_series(judged, angle)
    EvaluatedRuns(DRIVE, DWELL, traces, judged, of_series, angle, place).conclude(each=False)
    return place


def content(folder: Path) -> dict:
    """Return an evaluation without the command that made it."""
    read = json.loads((folder / "evaluation.json").read_text())
    return {key: value for key, value in read.items() if key != "command"}


def evaluate(*arguments: object, test: str = "sine-with-dwell") -> int:
    return status_of("evaluate", test, *arguments, "--no-figures")


def test_the_verdict_is_that_of_drive_and_its_file_is_kept(series, capsys):
    before, driven = (series / "evaluation.json").read_bytes(), content(series)
    assert driven["series"]["criteria"]["stability"]["verdict"] == "passed"
    for _ in range(2):  # its own may be replaced
        assert evaluate(series) == 0
    own = content(series / "evaluated")
    assert own["series"] == driven["series"]
    assert own["A"] == driven["A"]
    assert [run["label"] for run in own["runs"]] == [run["label"] for run in driven["runs"]]
    evaluate(series, test="step-steer")
    capsys.readouterr()
    assert evaluate(series, "--out", series) == 2
    assert str(series) in capsys.readouterr().err
    assert (series / "evaluation.json").read_bytes() == before


def test_runs_of_slowly_increasing_steer_in_a_folder_give_a_and_are_not_judged(series):
    number = len(content(series)["runs"])
    (series / "evaluation.json").unlink()  # as of a series that was interrupted before its verdict
    for options, angle in (((), 40.0), (("--angle", "180 deg"), 180.0)):
        assert evaluate(series, *options) == 0
        own = content(series)
        assert degrees(own["A"]) == pytest.approx(angle)
        labels = [run["label"] for run in own["runs"]]
        assert len(labels) == number - 1  # the failed run has not completed
        assert not any("slowly_increasing_steer" in label for label in labels)
        assert own["series"]["criteria"]["stability"]["verdict"] == "not judged"  # a run is missing


@pytest.mark.parametrize("text", ["[]", "{", '{"command": "drive", "test": "sine-with-dwell", "runs": 3}'])
def test_an_evaluation_that_cannot_be_read_is_kept_and_not_followed(text, series):
    (series / "evaluation.json").write_text(text)
    assert evaluate(series) == 0
    assert (series / "evaluation.json").read_text() == text
    assert (series / "evaluated" / "evaluation.json").is_file()


def test_series_with_different_a_are_not_judged_as_one(series, tmp_path, capsys):
    other = Path(shutil.copytree(series, tmp_path / "other"))
    data = json.loads((other / "evaluation.json").read_text())
    (other / "evaluation.json").write_text(json.dumps(data | {"A": 0.9 * data["A"]}))
    assert evaluate(series, other) == 2
    assert mentions(capsys.readouterr().err, "180.0", "162.0")
