"""Time series as inputs: read from files, checked before the run, exact at the instants of the coupling."""

from __future__ import annotations

import hashlib
import json
import math
import os
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from tests.command_line import status_of
from tests.fmus.fake_fmus import Var, make_fmu, out
from tests.orchestrator.fakes import Behaviour, Clock, Function, Integrator, Stage
from tests.orchestrator.fakes import make_plan as fake_plan
from tests.orchestrator.recorded import car, write
from tests.refusals import each_mentions, mentions, refused, texts_of
from yawbench.foundation.errors import ResultsError, YawbenchError
from yawbench.interop.ssp_write import write_ssp
from yawbench.orchestrator.master.simulate import simulate
from yawbench.orchestrator.plan import InputSeries, Plan
from yawbench.orchestrator.recordings.recording_formats import ColumnFile
from yawbench.orchestrator.results.freshness import staleness
from yawbench.orchestrator.results.reader import load_results
from yawbench.orchestrator.scenario.loader import load_scenario
from yawbench.orchestrator.wiring.make_plan import make_plan
from yawbench.vocabulary.wheels import WHEELS

pytestmark = pytest.mark.usefixtures("common_cache")


class Witness(Behaviour):
    """Writes down its inputs at every step: `middle` is integrated, `end` is passed through."""

    inputs = ("middle", "end", "count", "word")
    outputs = {"y": ("end",)}
    types = {"count": "Integer", "word": "String"}

    def __init__(self) -> None:
        self.seen: list[tuple] = []

    def advance(self, t, h, u):
        self.seen.append((t, *(u[name] for name in self.inputs)))

    def output(self, t, u):
        return {"y": u["end"]}


def ramp() -> InputSeries:
    return InputSeries("f.csv", "c", "0", False, np.array([0.0, 0.3, 2.0]), np.array([1.0, 4.0, -13.0]))


def texts(*values: object) -> InputSeries:
    return InputSeries("f.csv", "c", "0", True, np.array([0.0, 0.25, 0.5]), np.array(values, dtype=object))


def run(algorithm: str, period: int, tmp_path: Path, step: str = "1/8", **series: InputSeries) -> list[tuple]:
    """Run a witness of series, with constants for its other inputs; return what it has seen."""
    witness = Witness()
    given = {"middle": ramp(), "end": ramp(), "count": texts(7, 8, 9), "word": texts(*"abc")} | series
    plan = fake_plan(
        {"w": witness},
        step=step, n_steps=12, algorithm=algorithm, periods={"w": period},
        constants={"w": {name: one.first(0.0) for name, one in given.items()}},
    )  # fmt: skip
    plan.instances[0].series.update(given)
    simulate(plan, tmp_path, opener=Stage({"w": witness}))
    return witness.seen


@pytest.mark.parametrize("period", [1, 3])
@pytest.mark.parametrize(
    ("algorithm", "middle", "end"),
    [("jacobi", 0.0, 0.0), ("gauss_seidel", 1.0, 1.0), ("extrapolated", 0.5, 1.0)],
)
def test_a_series_has_its_exact_value_where_the_coupling_asks(algorithm, middle, end, period, tmp_path):
    seen = run(algorithm, period, tmp_path)
    assert len(seen) == 12 // period
    h = period / 8
    for t, at_middle, at_end, count, word in seen:
        assert at_middle == pytest.approx(np.interp(t + middle * h, [0, 0.3, 2], [1, 4, -13]), abs=1e-12)
        assert at_end == pytest.approx(np.interp(t + end * h, [0, 0.3, 2], [1, 4, -13]), abs=1e-12)
        place = min(int((t + end * h) * 4 + 1e-9), 2)
        assert (count, word) == ((7, 8, 9)[place], "abc"[place])


def test_a_held_series_keeps_each_value_until_the_next(tmp_path):
    """An instant in decimals counts as reached: 0.1 + 0.2 is more than 0.3 in binary numbers, as 3 x 0.1."""
    step = InputSeries("f", "c", "0", True, np.array([0.0, 0.1 + 0.2]), np.array([0.0, 1.0]))
    seen = run("gauss_seidel", 1, tmp_path, step="1/10", middle=step)
    assert [one[1] for one in seen[:4]] == [0.0, 0.0, 1.0, 1.0]


@pytest.mark.parametrize(("algorithm", "order"), [("extrapolated", 2.0), ("jacobi", 1.0)])
def test_an_integrated_series_is_of_second_order_when_extrapolated(algorithm, order, tmp_path):
    times = np.linspace(0.0, 1.0, 1001)
    error = []
    for n in (10, 20):
        units = {"a": Integrator()}
        plan = fake_plan(units, step=f"1/{n}", n_steps=n, algorithm=algorithm, constants={"a": {"rate": 1.0}})
        plan.instances[0].series.update(rate=InputSeries("f", "c", "0", False, times, np.exp(times)))
        simulate(plan, tmp_path / str(n), opener=Stage(units))
        error.append(abs(load_results(tmp_path / str(n))["a.x"][-1] - math.e))
    assert math.log2(error[0] / error[1]) == pytest.approx(order, abs=0.1)


# From files


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory elsewhere, and a scenario's folder with FMUs and data."""
    make_fmu(
        tmp_path / "fmus/plant.fmu",
        inputs=[
            Var("steer_angle", "rad", minimum=-2.0),
            Var("torque_*", "N.m"),
            Var("gear", type="Integer", start=1),
            Var("on", type="Boolean", start=False),
        ],
        outputs=[out("yaw_rate", unit="rad/s")],
    )
    make_fmu(tmp_path / "fmus/driver.fmu", outputs=[out("steer_angle", unit="rad")])
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs/data.csv").write_text(
        "\ufefftime [ms],delta [deg],t_fl,t_fr,t_rl,t_rr,gear,on\n"
        "0,0,1,2,3,4,1,0\n500,90,1,2,3,4,2,1\n1000,180,1,2,3,4,3,0\n",
        encoding="utf-8",
    )
    return tmp_path


GIVEN = {
    "plant.steer_angle": "{file: data.csv, column: delta}",
    "torque_*": "{file: data.csv, column: t_*}",
    "gear": "{file: data.csv}",
    "on": "{file: data.csv}",
}


def scenario(**changed: str | None) -> Path:
    """Write a scenario; arguments are inputs, with _ for the dot of `plant.`"""
    given = GIVEN | {k.replace("plant_", "plant.", 1): v for k, v in changed.items()}
    inputs = "".join(f'  "{key}": {value}\n' for key, value in given.items() if value is not None)
    path = Path("runs/a.yaml")
    path.write_text(f"stop_time: 1\nstep_size: 0.1\nunits: {{plant: {{fmu: plant}}}}\ninputs:\n{inputs}")
    return path


def plan_of(path: Path) -> Plan:
    return make_plan(load_scenario(path))


def problem(path: Path) -> str:
    with pytest.raises(YawbenchError) as caught:
        plan_of(path)
    assert caught.value.exit_status == 2
    (sentence,) = texts_of(caught.value)
    return sentence.partition(": ")[2]


def test_columns_are_read_relative_to_the_scenario_in_units_and_types_of_the_inputs(folder: Path) -> None:
    (plant,) = plan_of(scenario()).instances
    steer = plant.series["steer_angle"]
    assert steer.times.tolist() == [0.0, 0.5, 1.0]
    assert steer.values.tolist() == pytest.approx([0.0, math.pi / 2, math.pi])
    assert [plant.series[f"torque_{w}"].values[0] for w in WHEELS] == [1, 2, 3, 4]
    assert plant.series["gear"].values.tolist() == [1, 2, 3]
    assert plant.series["on"].values.tolist() == [False, True, False]
    assert plant.series["gear"].held
    assert plant.constants["gear"] == 1
    assert steer.sha256 == hashlib.sha256(Path("runs/data.csv").read_bytes()).hexdigest()


def test_a_series_for_a_units_input_goes_before_equal_names(folder: Path) -> None:
    path = scenario()
    path.write_text(path.read_text().replace("units: {", "units: {driver: {fmu: driver}, "))
    made = plan_of(path)
    assert made.wires == ()
    assert each_mentions(texts_of(made), ("plant.steer_angle", "driver.steer_angle"))


@pytest.mark.parametrize("form", ["parquet", "csv"])
def test_recorded_results_are_a_source_with_their_units(form, folder) -> None:
    """Series of a run of any format; degrees that were recorded arrive as radians."""
    units = {"driver": Clock(angle=lambda t: 90.0 * t)}
    plan = fake_plan(units, step="1/10", n_steps=10)
    object.__setattr__(plan.instances[0].fmu.variables["angle"], "unit", "deg")
    simulate(plan, folder / "recorded", opener=Stage(units), format=form)
    path = scenario(plant_steer_angle=f"{{file: ../recorded/results.{form}, column: driver.angle}}")
    (plant,) = plan_of(path).instances
    assert plant.series["steer_angle"].values[-1] == pytest.approx(math.pi / 2)
    assert plant.series["steer_angle"].times[-1] == pytest.approx(1.0)


def test_check_and_run_json_tell_of_a_series_and_a_changed_file_makes_results_stale(folder, capsys) -> None:
    path = scenario()
    assert status_of("check", path) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert mentions(shown, "steer_angle", "data.csv")
    assert mentions(shown, "data.csv", "scenario", "plant")
    plant = Function(lambda t, u: {"yaw_rate": u["steer_angle"]}, [], ["yaw_rate"])
    simulate(plan_of(path), folder / "out", opener=Stage({"plant": plant}))
    record = json.loads((folder / "out/run.json").read_text())["fmus"]["plant"]
    digest = hashlib.sha256(Path("runs/data.csv").read_bytes()).hexdigest()
    assert record["series"]["steer_angle"] == {
        "file": "data.csv", "column": "delta", "interpolation": "linear", "sha256": digest
    }  # fmt: skip
    assert "steer_angle" not in record["constants"]
    assert staleness(plan_of(path), folder / "out") is None
    data = Path("runs/data.csv")
    data.write_text(data.read_text().replace("500,90", "500,91"))
    assert mentions(staleness(plan_of(path), folder / "out"), "plant", "series")


@pytest.mark.parametrize(
    ("given", "names"),
    [
        ("file: dta.csv", ("runs/dta.csv: ",)),
        ("file: data.txt", ("runs/data.txt: ",)),
        ("file: data.csv, column: dlta", ("data.csv", "'dlta'", "'delta'")),
        ("file: data.csv, column: delta, time: t", ("data.csv", "'t'")),
        ("file: data.csv, column: 't_fl [m]'", ("data.csv", "'t_fl [m]'", "'t_fl'")),
        ("file: data.csv, column: word", ("data.csv", "'word'", "value 2", "'high'")),
        ("file: data.csv, column: void", ("data.csv", "'void'")),
        ("file: data.csv, column: far", ("data.csv", "'far'", "value 2", "inf")),
        ("file: data.csv, column: mass", ("data.csv", "'mass'", "'kg'", "rad")),
        ("file: data.csv, column: low", ("data.csv", "-2 rad", "-7.0")),
        ("file: data.csv, column: twice", ("data.csv", "2 columns", "'twice'")),
        ("file: back.csv, column: x", ("back.csv", "0.5 s", "value 3", "time")),
        ("file: short.csv, column: x", ("short.csv", "0", "0.5 s", "1 s", "'extrapolate: hold'")),
        ("file: uneven.csv, column: x", ("runs/uneven.csv", "3", "1 values", "2 columns")),
        ("file: empty.csv, column: x", ("runs/empty.csv", "rows")),
        ("file: long.csv, column: x", ("runs/long.csv", "field")),
        ("file: data.csv, colum: x", ("'column'", "unknown", "key")),
        ("column: x", ("'file'", "missing")),
        ("file: data.csv, interpolation: cubic", ("'linear'", "'held'", "'cubic'")),
    ],
)
def test_what_is_wrong_with_a_series_is_said_before_the_run(given, names, folder: Path) -> None:
    files = {
        "data.csv": "time [s];delta;t_fl;word;void;far;mass [kg];low;twice;twice\n"
        "0;0;0;1;;1;1;0;0;0\n0.5;0;0;high;nan;inf;1;-7;0;0\n1;0;0;1;;1;1;0;0;0\n",
        "data.txt": "", "back.csv": "time,x\n0,0\n0.5,1\n0.5,2\n", "short.csv": "time\tx\n0\t0\n0.5\t1\n",
        "uneven.csv": "time,x\n0,0\n1\n", "empty.csv": "time,x\n", "long.csv": f"time,x\n0,{'1' * 200_000}\n",
    }  # fmt: skip
    for name, text in files.items():
        (folder / "runs" / name).write_text(text)
    path = scenario(plant_steer_angle=f"{{{given}}}", gear="1", on="true", **{"torque_*": "0"})
    assert mentions(problem(path), *names)


def test_a_series_may_hold_its_ends_and_a_held_one_reaches_one_interval_on(folder: Path) -> None:
    (folder / "runs/short.csv").write_text("time,x\n0.25,1\n0.5,2\n")
    hold = "{file: short.csv, column: x, extrapolate: hold}"
    (plant,) = plan_of(scenario(plant_steer_angle=hold)).instances
    assert plant.series["steer_angle"].at(np.array([0.0, 0.375, 9.0])).tolist() == [1.0, 1.5, 2.0]
    (folder / "runs/short.csv").write_text("time,x\n0,1\n0.5,2\n")
    held = "{file: short.csv, column: x, interpolation: held}"
    assert plan_of(scenario(plant_steer_angle=held)).instances[0].series["steer_angle"].held


def test_a_series_leaves_out_cells_without_a_value_and_reads_clocks(folder: Path) -> None:
    (folder / "runs/data.csv").write_text(
        "logger 7\n\ntime;delta;gear\n;deg;\n12:00:00.00;0;1\n12:00:00.25;;\n12:00:00.50;90;2\n"
        "12:00:01.00;180;3\n"
    )
    path = scenario(plant_steer_angle="{file: data.csv, column: delta}", on="true", **{"torque_*": "0"})
    (plant,) = plan_of(path).instances
    for name, values in (("steer_angle", [0.0, math.pi / 2, math.pi]), ("gear", [1, 2, 3])):
        assert plant.series[name].times.tolist() == [0.0, 0.5, 1.0]
        assert plant.series[name].values.tolist() == pytest.approx(values)


def test_an_archive_for_other_programs_has_no_place_for_a_series(folder: Path) -> None:
    names = ("a.ssp", "plant.steer_angle", "plant.torque_*", "plant.gear", "plant.on")
    with refused(ResultsError, "ssp-unsupported", names=names):
        write_ssp(plan_of(scenario()), folder / "a.ssp")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names here")
@pytest.mark.parametrize("form", ["csv", "parquet", "mf4"])
def test_a_series_from_a_pipe_or_a_device_is_refused_without_a_wait(form: str, folder: Path) -> None:
    os.mkfifo(f"runs/pipe.{form}")
    os.symlink("/dev/zero", f"runs/zero.{form}")
    for name in ("pipe", "zero"):
        said = problem(scenario(plant_steer_angle=f"{{file: {name}.{form}, column: delta}}"))
        assert mentions(said, f"runs/{name}.{form}", "socket", "device")


def test_a_long_series_takes_little_more_memory_than_its_file(folder: Path) -> None:
    rows = (f"{i / 2e3},{i % 90},1,2,3,4,1,0,{'x' * 20},a,b,c,d,e,f\n" for i in range(4_000))
    heading = "time,delta,t_fl,t_fr,t_rl,t_rr,gear,on,note,a,b,c,d,e,f\n"
    Path("runs/data.csv").write_text(heading + "".join(rows))
    path = scenario()
    tracemalloc.start()
    plan_of(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 6 * Path("runs/data.csv").stat().st_size


def test_a_record_beside_recorded_results_gives_units_or_a_sentence(tmp_path: Path) -> None:
    file = write(car(n=5), tmp_path / "run") / "results.csv"
    beside = file.with_name("run.json")
    assert ColumnFile(file).column("driver.steer_angle", "time").unit == "rad"
    beside.write_text("{")
    with refused(ValueError, names=("run.json", "line 1", "column 2")):
        ColumnFile(file)
