"""Files in the forms of loggers are read without editing, or refused with what to do; numbers are made up."""

from __future__ import annotations

import numpy as np
import pytest

from tests.orchestrator.measured_files import (
    GRAVITY,
    SIDE,
    SPEED,
    TIMES,
    YAW,
    described,
    read,
    refusal,
    rows,
    segment,
)
from yawbench.foundation.errors import ScenarioError
from yawbench.measurements.measurement import load_measurement
from yawbench.measurements.segment import Segment

AIM = (
    '"Format","AiM CSV File"\r\n"Session","Airfield"\r\n"Vehicle","Car 7"\r\n"Racer","Nobody"\r\n'
    '"Championship",""\r\n"Comment",""\r\n"Date","Sunday, May 17, 2026"\r\n"Time","12:00 PM"\r\n'
    '"Sample Rate","10"\r\n"Duration","70.000"\r\n"Segment","Session"\r\n"Beacon Markers","30.1","65.2"\r\n'
    '"Segment Times","0:30.100","0:35.100"\r\n\r\n"Time","GPS Speed","GPS Gyro","GPS LatAcc"\r\n'
    '"s","km/h","deg/s","g"\r\n\r\n'
) + rows(lambda k: f'"{TIMES[k]:.3f}","{3.6 * SPEED[k]:.4f}","{YAW[k]:.5f}","{SIDE[k]:.5f}"', "\r\n")
RACECHRONO = (
    "This file is created using RaceChrono v9.1.3 ( http://racechrono.com/ ).\nFormat,3\n"
    'Session title,"Airfield"\nSession type,Lap timing\nTrack name,"Airfield"\nDriver name,Nobody\n'
    "Created,17/05/2026,12:00\nNote,\n\n"
    "timestamp,fragment_id,lap_number,elapsed_time,speed,lateral_acc,speed,z_rate_of_rotation\n"
    "unix time,,,s,m/s,G,m/s,deg/s\n,,,,100: gps,calc,calc,102: gyro\n"
) + rows(
    lambda k: (
        f"{1779019200 + TIMES[k]:.3f},0,{'' if k < 50 else k // 300},{TIMES[k]:.3f},"
        f"{'' if k % 10 else f'{SPEED[k]:.4f}'},{SIDE[k]:.5f},{SPEED[k] + 1.0:.4f},{YAW[k]:.5f}"
    )
)


def packed(second: float) -> str:
    """Return a time of day [s] as hhmmss.ss."""
    hours, rest = divmod(second % 86400.0, 3600.0)
    return f"{int(hours):02d}{int(rest // 60.0):02d}{rest % 60.0:05.2f}"


VBOX = (
    "File created on 17/05/2026 at 23:59:30\r\n\r\n"
    "[header]\r\nsatellites\r\ntime\r\nlatitude\r\nlongitude\r\n"
    "velocity kmh\r\nheading\r\nheight\r\nYaw_Rate\r\nLat_Acc\r\n\r\n[channel units]\r\n°/s\r\ng\r\n\r\n"
    "[comments]\r\nmade up\r\n\r\n[column names]\r\n"
    "sats time lat long velocity heading height Yaw_Rate Lat_Acc\r\n\r\n[data]\r\n"
) + rows(
    lambda k: (
        f"008 {packed(86370.0 + TIMES[k])} +03119.09973 -00058.49277 {3.6 * SPEED[k]:08.4f} 012.00 +00115.40 "
        f"{YAW[k]:+.6E} {SIDE[k]:+.5f}"
    ),
    "\r\n",
)
VBOX_CSV = "UTC time,Velocity (km/h),Yaw rate (deg/s),Lat acc (g)\n" + rows(
    lambda k: f"{packed(43170.0 + TIMES[k])},{3.6 * SPEED[k]:.4f},{YAW[k]:.5f},{SIDE[k]:.5f}"
)
MOTEC = (
    '"Format","MoTeC CSV File",,,"Workbook",""\n"Venue","Airfield",,,"Worksheet",""\n'
    '"Vehicle","Car 7",,,"Vehicle Desc",""\n"Driver","",,,"Engine ID",""\n"Device","ADL"\n'
    '"Comment","",,,"Session",""\n"Log Date","17/05/2026",,,"Origin Time","0.000","s"\n'
    '"Log Time","12:00:00",,,"Start Time","0.000","s"\n"Sample Rate","10.000","Hz",,"End Time","70.0","s"\n'
    '"Duration","70.0","s",,"Start Distance","0","m"\n"Range","outing",,,"End Distance","1200","m"\n'
    '"Beacon Markers","30.1 65.2"\n\n\n'
    '"Time","Ground Speed","Gyro Yaw Velocity","G Force Lat","Steered Angle","Lap Distance","Gear"\n'
    '"s","km/h","deg/s","G","deg","m",""\n\n\n'
) + rows(
    lambda k: (
        f'"{TIMES[k]:.3f}","{3.6 * SPEED[k]:.4f}","{YAW[k]:.5f}","{SIDE[k]:.5f}",'
        f'"1.0","{20 * TIMES[k]:.1f}","3"'
    )
)
ECUMASTER = "TIME;RPM;Vehicle Speed;Gyro Z;Acc Y;\n" + rows(
    lambda k: f"{TIMES[k]:.3f};3000;{3.6 * SPEED[k]:.4f};{YAW[k]:.5f};{SIDE[k]:.5f};".replace(".", ",")
)
TORQUE = (
    "GPS Time,Device Time,Longitude,Latitude,GPS Speed (Meters/second),Speed (OBD)(km/h),G(y)(G),Yaw(°/s)\n"
) + rows(
    lambda k: (
        f"Sun May 17 12:00:00 GMT+02:00 2026,17-May-2026 12:{int(TIMES[k] // 60):02d}:{TIMES[k] % 60:06.3f},"
        f"-74.0,40.7,{SPEED[k]:.4f},{'-' if k % 7 else f'{3.6 * SPEED[k]:.4f}'},{SIDE[k]:.5f},{YAW[k]:.5f}"
    )
)
ASAMMDF_CSV = '"timestamps","VehicleSpeed","YawRate","AccY"\n"","km/h","deg/s","g"\n' + rows(
    lambda k: (
        f"2026-05-17 12:{int(TIMES[k] // 60):02d}:{TIMES[k] % 60:09.6f}+02:00,"
        f"{3.6 * SPEED[k]:.4f},{YAW[k]:.5f},{SIDE[k]:.5f}"
    )
)
TRACKADDICT = "# Vehicle: Car 7\n# Mode: 1\n# User Settings: SC0 U0 AS1\n" + (
    '"Time","UTC Time","Lap","Accel Y","Speed (MPH)","Yaw Rate (deg/s)"\n'
) + rows(
    lambda k: f"{TIMES[k]:.3f},{1e9 + TIMES[k]:.3f},0,{SIDE[k]:.5f},{SPEED[k] / 0.44704:.5f},{YAW[k]:.5f}"
) + "# End\n"  # fmt: skip
FORMS = {
    "AiM": (AIM, "run.csv", "Time", "GPS Speed", "GPS Gyro", "GPS LatAcc"),
    "RaceChrono": (RACECHRONO, "run.csv", "timestamp", "speed#gps", "z_rate_of_rotation", "lateral_acc"),
    "VBOX": (VBOX, "run.vbo", "time", "velocity", "Yaw_Rate", "Lat_Acc"),
    "VBOX, exported": (
        VBOX_CSV, "run.csv", "{column: UTC time, unit: hhmmss}", "Velocity", "Yaw rate", "Lat acc"
    ),
    "MoTeC": (MOTEC, "run.csv", "Time", "Ground Speed", "Gyro Yaw Velocity", "G Force Lat"),
    "ECUMaster": (
        ECUMASTER, "run.csv", "{column: TIME, unit: s}", "{column: Vehicle Speed, unit: km/h}",
        "{column: Gyro Z, unit: deg/s}", "{column: Acc Y, unit: G}",
    ),
    "Torque": (TORQUE, "run.csv", "Device Time", "GPS Speed", "Yaw", "G(y)"),
    "Torque, speed of the car": (TORQUE, "run.csv", "Device Time", "Speed (OBD)", "Yaw", "G(y)"),
    "asammdf, as CSV": (ASAMMDF_CSV, "run.csv", "timestamps", "VehicleSpeed", "YawRate", "AccY"),
    "TrackAddict": (
        TRACKADDICT, "run.csv", "{column: Time, unit: s}", "Speed", "Yaw Rate", "{column: Accel Y, unit: G}"
    ),
}  # fmt: skip


def is_the_drive(made: Segment) -> None:
    """Assert that a segment is the drive of `measured_files`, cut at most where a signal is not sampled."""
    at = np.searchsorted(TIMES, made.time - 1e-6)
    assert made.time.size >= 680 and made.time == pytest.approx(TIMES[at], abs=1e-6)
    assert made.signals["velocity_x"] == pytest.approx(SPEED[at], abs=1e-3)
    assert made.signals["yaw_rate"] == pytest.approx(np.radians(YAW[at]), abs=1e-6)
    assert made.signals["acceleration_y"] == pytest.approx(GRAVITY * SIDE[at], abs=1e-4)


@pytest.mark.parametrize(("text", "file", "time", "speed", "yaw", "side"), FORMS.values(), ids=FORMS)
def test_files_of_loggers_are_read_without_editing(text, file, time, speed, yaw, side, tmp_path):
    signals = {"velocity_x": speed, "yaw_rate": yaw, "acceleration_y": side}
    content = text.encode("cp1252" if file == "run.vbo" else "utf-8")
    is_the_drive(segment(tmp_path, content, signals, time, file=file))


def test_channels_of_an_mdf_keep_their_clocks_and_groups(tmp_path):
    """As asammdf writes decoded CAN: a group per message, each with its clock, names that occur twice."""
    asammdf = pytest.importorskip("asammdf")
    late = TIMES[:-1] + 0.03
    with asammdf.MDF(version="4.10") as mdf:
        for group, offset in (("Wheels", 1.0), ("GPS", 0.0)):
            speed = asammdf.Signal(3.6 * (SPEED + offset), TIMES, name="speed", unit="km/h")
            mdf.append([speed], acq_name=group)
        of_gyro = [
            asammdf.Signal(x, late, name=name, unit=unit)
            for name, x, unit in (
                ("gyro", 5.0 * np.sin(late), "deg/s"),
                ("side", 0.3 * np.sin(late), "G"),
                ("bits", late, ""),
            )
        ]
        mdf.append(of_gyro, acq_name="IMU")
        laps = np.array([0.0, 30.0, 60.0])
        mdf.append([asammdf.Signal(np.array([1, 2, 3]), laps, name="Lap")], acq_name="Laps")
        mdf.save(tmp_path / "run.mf4")
    signals = {"velocity_x": "speed#GPS", "yaw_rate": "gyro", "acceleration_y": "side"}
    taken = [
        load_measurement(described(tmp_path, "run.mf4", dict(order))).segments[0]
        for order in (signals.items(), [*signals.items()][::-1])
    ]
    assert taken[0].time == pytest.approx(late, abs=1e-9)  # most samples where all signals have some
    assert taken[0].signals["velocity_x"] == pytest.approx(20.0 + 0.05 * late, abs=1e-9)
    assert taken[0].signals["acceleration_y"] == pytest.approx(GRAVITY * 0.3 * np.sin(late), abs=1e-9)
    for name in signals:
        assert np.array_equal(taken[0].signals[name], taken[1].signals[name])
    second = load_measurement(described(tmp_path, "run.mf4", signals | {"velocity_x": "speed#2"})).segments
    assert np.array_equal(second[0].signals["velocity_x"], taken[0].signals["velocity_x"])
    laps_of = load_measurement(described(tmp_path, "run.mf4", signals, more="segments: {by: Lap}\n")).segments
    assert [one.name for one in laps_of] == ["run.mf4 1", "run.mf4 2", "run.mf4 3"]
    assert [one.time[0] for one in laps_of] == pytest.approx([0.03, 30.03, 60.03], abs=1e-9)
    with pytest.raises(ScenarioError, match="speed#2"):
        load_measurement(described(tmp_path, "run.mf4", signals | {"velocity_x": "speed"}))


def test_mdf_samples_that_are_invalid_or_not_a_number_were_not_taken(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    bad = np.zeros(TIMES.size, bool)
    bad[100:103] = True
    with asammdf.MDF(version="4.10") as mdf:
        speed = asammdf.Signal(
            np.where(bad, 1e6, SPEED), TIMES, name="speed", unit="m/s", invalidation_bits=bad
        )
        gyro = asammdf.Signal(np.where(bad, np.nan, YAW), TIMES, name="gyro", unit="deg/s")
        mdf.append([speed, gyro])
        mdf.save(tmp_path / "run.mf4")
    for signals in ({"velocity_x": "speed"}, {"yaw_rate": "gyro"}):
        (only,) = load_measurement(described(tmp_path, "run.mf4", signals)).segments
        assert np.array_equal(only.time, TIMES[~bad])


@pytest.mark.parametrize(("kind", "code"), [(3, "clock in s"), (None, "no values")])
def test_mdf_channels_without_times_or_samples_are_refused(kind, code, tmp_path):
    asammdf = pytest.importorskip("asammdf")
    times = TIMES if kind else TIMES[:0]
    options = {"master_metadata": ("distance", kind)} if kind else {}
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append([asammdf.Signal(times + 20.0, times, name="speed", unit="m/s", **options)])
        mdf.save(tmp_path / "run.mf4")
    assert code in refusal(
        tmp_path, (tmp_path / "run.mf4").read_bytes(), {"velocity_x": "speed"}, file="run.mf4"
    )


def test_laps_of_racechrono_are_segments_and_a_cell_without_a_lap_is_in_the_one_before(tmp_path):
    signals = {"velocity_x": "speed#2"}
    made = read(tmp_path, RACECHRONO, signals, "elapsed_time", "segments: {by: lap_number}\n").segments
    assert [one.name for one in made] == ["run.csv -", "run.csv 0", "run.csv 1", "run.csv 2"]
    blank = "time [s],v [m/s],Lap\n" + "".join(
        f"{k},20,{1 + k // 5 if k % 5 == 0 else ''}\n" for k in range(10)
    )
    made = read(tmp_path, blank, {"velocity_x": "v"}, more="segments: {by: Lap}\n").segments
    assert [one.time.size for one in made] == [5, 5]


def test_vbo_files_with_other_columns_than_usual_have_only_the_units_that_are_certain(tmp_path):
    text = VBOX.replace("°/s\r\ng\r\n", "g\r\n").replace("[column names]\r\nsats", "[column names]\r\nfix")
    signals = {"velocity_x": "velocity", "acceleration_y": "Lat_Acc"}
    assert "no unit" in refusal(tmp_path, text.encode("cp1252"), signals, file="run.vbo")


def test_a_list_of_readings_is_refused_with_what_to_export(tmp_path):
    """As Car Scanner writes it: a row per reading."""
    text = '"SECONDS";"PID";"VALUE";"UNITS"\n' + rows(
        lambda k: (
            f'"{TIMES[k]:.3f}";"Vehicle speed";"{SPEED[k]:.1f}";"m/s"\n'
            f'"{TIMES[k] + 0.01:.3f}";"Gyro";"1";"deg/s"'
        )
    )
    said = refusal(tmp_path, text, {"velocity_x": "Vehicle speed"}, "{column: SECONDS, unit: s}")
    assert "list of readings" in said and "PID" in said


def test_a_restart_of_the_app_writes_its_header_again(tmp_path):
    lines = TORQUE.splitlines()
    text = "\n".join([*lines, lines[0], *lines[1:50]]) + "\n"
    signals = {"velocity_x": "GPS Speed"}
    assert "segments" in refusal(tmp_path, text, signals, "Device Time")
    made = read(tmp_path, text, signals, "Device Time", "segments: {by: time}\n").segments
    assert [one.time.size for one in made] == [700, 49]
