"""Sensors with the numbers of a CAN network: their messages are what cantools encodes and decodes."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import yawbench as yb
from tests.cars import make_plan
from tests.changed import changed
from tests.fmus.fake_fmus import Var, make_fmu
from tests.refusals import mentions, refused
from yawbench.foundation.errors import ScenarioError, YawbenchError
from yawbench.interop.can_log import write_log
from yawbench.interop.can_signals import read_dbc, sensor_parameters
from yawbench.orchestrator.master.simulate import simulate
from yawbench.orchestrator.recordings.recording_formats import ColumnFile
from yawbench.orchestrator.results.reader import load_results
from yawbench.orchestrator.scenario.loader import load_scenario

cantools = pytest.importorskip("cantools")

UNITS = (
    "driver_sine", "sensor_ideal", "estimator_observer", "reference_steady_state", "controller_off",
    "allocator_single_wheel", "wheel_control_hydraulic", "plant_fourteen_dof", "tyre_magic_formula",
)  # fmt: skip
SCENARIO = Path(__file__).parents[2] / "scenarios" / "proving_ground" / "ordinary_sine_sensors.yaml"
DBC = """VERSION ""
NS_ :
BS_:
BU_: SENSORS ESP
BO_ 416 Inertial: 8 SENSORS
 SG_ YawRate : 0|16@1- (0.005,0) [-160|160] "deg/s" ESP
 SG_ LateralAcceleration : 16|16@1- (0.00127465,0) [-0.1|0.1] "g" ESP
 SG_ Shifted : 32|16@1+ (0.002,-65.5357) [0|0] "m/s2" ESP
 SG_ Biased : 48|16@1+ (0.01,-327.68) [0|0] "m/s^2" ESP
BO_ 417 Wheels: 4 SENSORS
 SG_ FrontLeft : 0|16@1+ (0.01,0) [0|300] "km/h" ESP
BO_ 2147484066 Pressures: 2 SENSORS
 SG_ FrontLeft : 0|12@1+ (0.1,0) [0|0] "bar" ESP
 SG_ Valid : 12|1@1+ (1,0) [0|1] "bar" ESP
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 416 10;
BA_ "GenMsgCycleTime" BO_ 417 20;
"""
RADIUS = 0.3
CHANNELS = {
    "yaw_rate": "Inertial.YawRate",
    "acceleration_y": "Inertial.LateralAcceleration",
    "wheel_speed": "Wheels.FrontLeft",
    "acceleration_x": "Inertial.Shifted",
}
SI = {"m/s2": 1.0, "deg/s": math.pi / 180, "g": 9.80665, "km/h": 1 / 3.6 / RADIUS}


@pytest.fixture(scope="module")
def dbc(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("dbc") / "car.dbc"
    path.write_text(DBC, encoding="cp1252")
    return path


@pytest.fixture(scope="module")
def run(dbc, fmus, tmp_path_factory):
    """The results of a run with a sensor that has the numbers of the network."""
    given = sensor_parameters(read_dbc(dbc), CHANNELS, wheel_radius=RADIUS)
    settings = [f"sensor.{name}={value!r}" for name, value in given.items()]
    changes = changed(swaps=["sensor=sensor_ideal"], settings=settings, stop_time=3)
    plan = make_plan(load_scenario(SCENARIO, changes=changes), fmus=fmus)
    return load_results(simulate(plan, tmp_path_factory.mktemp("can") / "out").folder)


def test_every_message_of_a_run_is_what_the_network_carries(dbc, run):
    database = cantools.database.load_file(dbc)
    names = {"wheel_speed": ("plant.wheel_speed_fl", "sensor.wheel_speed_fl")}
    saturated = 0
    for channel, where in CHANNELS.items():
        owner, signal = where.split(".")
        message = database.get_message_by_name(owner)
        about = message.get_signal_by_name(signal)
        true, measured = names.get(channel, (f"plant.{channel}", f"sensor.{channel}"))
        every = round(message.cycle_time / 1000 / 0.0025)
        truth, seen = run[true][::every], run[measured][::every]
        assert np.ptp(truth) > 5 * about.scale * SI[about.unit]
        for value, sent in zip(truth / SI[about.unit], seen / SI[about.unit], strict=True):
            if about.minimum is not None:
                value = min(max(value, about.minimum), about.maximum)
                saturated += value in (about.minimum, about.maximum)
            others = {other.name: other.offset for other in message.signals}
            data = message.encode({**others, signal: value}, strict=False)
            decoded = message.decode(data)[signal]
            assert sent == pytest.approx(decoded, abs=1e-9)
        whole = run[measured].size // every * every
        held = run[measured][:whole].reshape(-1, every)
        assert (held == held[:, :1]).all()
    assert saturated > 10


@pytest.mark.parametrize("ending", ["blf", "asc"])
def test_a_log_of_a_run_is_a_recording_of_its_messages(dbc, run, yawbench, ending):
    pytest.importorskip("can")
    log = dbc.with_name(f"run.{ending}")
    pairs = {
        "yaw_rate": "Inertial.YawRate",
        "acceleration_y": "Inertial.LateralAcceleration",
        "wheel_speed_fl": "Wheels.FrontLeft",
    }
    columns = [f"sensor.{name}={signal}" for name, signal in pairs.items()]
    options = ["--dbc", dbc, "--out", log, "--wheel-radius", RADIUS]
    status, _, said = yawbench("export-can", run.folder, *columns, *options)
    assert status == 0, said
    file = ColumnFile(log)
    for (name, signal), cycle, unit in zip(pairs.items(), (4, 4, 8), ("deg/s", "g", "km/h"), strict=True):
        got = file.column(signal.partition(".")[2], "time")
        assert (got.unit, got.time_unit) == (unit, "s")
        assert got.times == pytest.approx(run.time[::cycle], abs=2e-6)
        assert got.values * SI[unit] == pytest.approx(run[f"sensor.{name}"][::cycle], abs=1e-9)
    with refused(ValueError, names=("'YawRate'",)):
        file.column("YawRat", "time")


def test_a_log_is_a_recording_of_a_measured_car_and_a_time_series_of_an_input(dbc, run):
    pytest.importorskip("can")
    folder = dbc.parent
    rate = run["sensor.yaw_rate"][::4]
    assert write_log(run, dbc, {"sensor.yaw_rate": "Inertial.YawRate"}, folder / "run.blf") == rate.size
    (folder / "car.yaml").write_text("files: [run.blf]\nsignals: {yaw_rate: YawRate}\n")
    assert yb.measured(folder / "car.yaml")["yaw_rate"] == pytest.approx(rate, abs=1e-9)
    make_fmu(folder / "a.fmu", inputs=[Var("rate", "rad/s")], outputs=["y"])
    (folder / "s.yaml").write_text(
        "stop_time: 3\nstep_size: 0.01\nunits: {a: {fmu: ./a.fmu}}\n"
        "inputs: {a.rate: {file: run.blf, column: YawRate, interpolation: held}}\n"
    )
    (unit,) = make_plan(load_scenario(folder / "s.yaml")).instances
    assert unit.series["rate"].values == pytest.approx(rate, abs=1e-12)


@pytest.mark.parametrize(
    ("content", "others", "names"),
    [
        ("", (), ("DBC", "run.dbc", "none")),
        ("", ("a.dbc", "b.dbc"), ("DBC", "a.dbc", "b.dbc")),
        ("not a log", ("car.dbc",), ("damaged",)),
    ],
)
def test_a_log_that_cannot_be_decoded_is_refused(tmp_path, content, others, names):
    pytest.importorskip("can")
    for name in others:
        (tmp_path / name).write_text(DBC, encoding="cp1252")
    (tmp_path / "run.blf").write_text(content)
    with refused(ValueError, names=names):
        ColumnFile(tmp_path / "run.blf")


@pytest.mark.parametrize(
    ("column", "signal", "file", "names"),
    [
        ("yaw_rate", "Inertial.Yaw", "a.blf", ("'Inertial.Yaw'", "'Inertial.YawRate'")),
        ("yaw_rate", "Wheels.FrontLeft", "a.blf", ("'km/h'", "rad/s")),
        ("brake_pressure_fl", "Pressures.FrontLeft", "a.blf", ("Pressures", "cycle")),
        ("yaw_rat", "Inertial.YawRate", "a.blf", ("yaw_rat",)),
        ("yaw_rate", "Inertial.YawRate", "a.txt", (".blf", ".asc")),
    ],
)
def test_what_cannot_be_written_into_a_log_is_refused(column, signal, file, names, dbc, run, tmp_path):
    pytest.importorskip("can")
    with refused(YawbenchError, names=names):
        write_log(run, dbc, {f"sensor.{column}": signal}, tmp_path / file)
    assert not (tmp_path / file).exists()


def test_resolution_range_cycle_and_frame_of_a_signal(dbc):
    signals = read_dbc(dbc)
    channels = {"yaw_rate": "Inertial.YawRate", "brake_pressure": "Pressures.FrontLeft"}
    channels["acceleration_x"] = "Inertial.Biased"
    assert sensor_parameters(signals, channels, bit_rate=500e3) == pytest.approx({
        "yaw_rate_quantum": math.radians(0.005),
        "yaw_rate_range": math.radians(160),
        "yaw_rate_sample_time": 0.01,
        "yaw_rate_latency": 135 / 500e3,  # the longest frame with an 11-bit identifier
        "brake_pressure_quantum": 1e4,
        "brake_pressure_offset": 2047e4,  # the middle of its 12 bits
        "brake_pressure_range": 2047e4,
        "brake_pressure_latency": 100 / 500e3,  # two bytes, 29-bit identifier
        "acceleration_x_quantum": 0.01,
        "acceleration_x_offset": -0.01,
        "acceleration_x_range": 327.67,
        "acceleration_x_sample_time": 0.01,
        "acceleration_x_latency": 135 / 500e3,
    })  # fmt: skip


@pytest.mark.parametrize(
    ("channel", "signal", "names"),
    [
        ("yaw_rat", "Inertial.YawRate", ("'yaw_rat'", "'yaw_rate'")),
        ("yaw_rate", "Inertial.YawRat", ("'Inertial.YawRat'", "'Inertial.YawRate'")),
        ("yaw_rate", "Inertial.LateralAcceleration", ("'g'", "rad/s")),
        ("wheel_speed", "Wheels.FrontLeft", ("'km/h'", "rad/s", "radius")),
        ("brake_pressure", "Pressures.Valid", ("brake_pressure=Pressures.Valid", "two numbers")),
    ],
)
def test_a_signal_that_does_not_fit_is_refused(dbc, channel, signal, names):
    with refused(ScenarioError, names=names):
        sensor_parameters(read_dbc(dbc), {channel: signal})


def test_a_file_that_is_no_dbc_is_refused(tmp_path):
    path = tmp_path / "x.dbc"
    with refused(ScenarioError, names=(path, "no such file")):
        read_dbc(path)
    path.write_text("root:x:0", encoding="utf-8")
    with refused(ScenarioError, names=(path, "DBC")):
        read_dbc(path)


def test_the_command_lists_signals_and_prints_parameters_of_a_sensor(dbc, yawbench):
    for arguments, names in (
        ((), ("Inertial.YawRate", "deg/s", "0.005", "10")),
        (("yaw_rate=Inertial.YawRate", "--bit-rate", "500000"), ("yaw_rate_latency:", "0.00027")),
    ):
        status, said, _ = yawbench("dbc", dbc, *arguments)
        assert status == 0 and mentions(said, *names)
