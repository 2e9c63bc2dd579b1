"""How the cells of a recording become numbers and times, and what of it is refused."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.orchestrator.measured_files import GRAVITY, SIDE, SPEED, TIMES, YAW, read, refusal, rows, segment
from tests.refusals import mentions, refused
from yawbench.foundation.errors import InvalidValueError, ScenarioError
from yawbench.measurements.segment import even_grid
from yawbench.orchestrator.recordings.clocks import seconds_of
from yawbench.orchestrator.recordings.units_of_loggers import unit_in_file
from yawbench.orchestrator.scenario.quantities import parse_unit

SPEED_ALONE = {"velocity_x": "v"}
SECONDS = "{column: time, unit: s}"
ALL = {"velocity_x": "v", "yaw_rate": "r", "acceleration_y": "a"}
NAMES = "time [s];v [km/h];r [deg/s];a [g]"
LINES = [f"{TIMES[k]:.2f};{3.6 * SPEED[k]:.4f};{YAW[k]:.5f};{SIDE[k]:.5f}" for k in range(TIMES.size)]
TABLE = "\n".join([NAMES, *LINES]) + "\n"


def is_the_table(made) -> None:
    """Assert that a segment has the numbers of `TABLE`, to the last bit of what Python reads in its text."""
    table = np.array([[float(cell) for cell in line.split(";")] for line in LINES])
    assert np.array_equal(made.time, table[:, 0])
    assert made.signals["velocity_x"] == pytest.approx(table[:, 1] / 3.6, rel=1e-15)
    assert made.signals["yaw_rate"] == pytest.approx(np.radians(table[:, 2]), rel=1e-15)
    assert np.array_equal(made.signals["acceleration_y"], table[:, 3] * GRAVITY)


# Tables


def quoted(line: str) -> str:
    """Return a line with commas between cells in quotes."""
    return ",".join(f'"{cell}"' for cell in line.split(";"))


FORMS = {
    "as it is": TABLE,
    "Windows": TABLE.replace("\n", "\r\n").encode("utf-8-sig"),
    "old Mac": TABLE.replace("\n", "\r"),
    "UTF-16": TABLE.encode("utf-16"),
    "UTF-16 without a mark": TABLE.encode("utf-16-le"),
    "decimal commas": TABLE.replace(".", ","),
    "quoted decimal commas": "\n".join(map(quoted, TABLE.replace(".", ",").splitlines())) + "\n",
    "a space before quotes": "\n".join(map(quoted, TABLE.splitlines())).replace(',"', ', "') + "\n",
    "a named separator": "sep=;\n" + TABLE,
    "trailing separators": TABLE.replace("\n", ";\n"),
    "trailing separators of rows": NAMES + "\n" + TABLE.partition("\n")[2].replace("\n", ";\n"),
    "a head": "Device;Logger 7\nCar;Saloon\nSample Rate;100\n\n" + TABLE,
    "a head filled up": "Device;Logger 7;;\nSample Rate;100;;\n;;;\n" + TABLE,
    "a head without a gap": "Device;Logger 7;;\nSample Rate;100;;\n" + TABLE,
    "comments": "# logger 7\n% 100 Hz\n// made up\n" + TABLE,
    "comments between": "\n".join([NAMES, *LINES[:5], "# pause", *LINES[5:]]) + "\n",
    "names in a comment": "# made up\n# " + TABLE,
    "units below": "time;v;r;a\ns;km/h;deg/s;g\n" + TABLE.partition("\n")[2],
    "units in brackets below": "time;v;r;a\n[s];[km/h];[°/s];[g]\n" + TABLE.partition("\n")[2],
    "units and sources below": "time;v;r;a\ns;km/h;deg/s;g\n;gps;imu;imu\n" + TABLE.partition("\n")[2],
    "units and a gap below": "time;v;r;a\ns;km/h;deg/s;g\n\n;;;\n" + TABLE.partition("\n")[2],
    "units in parentheses": TABLE.replace("[", "(").replace("]", ")"),
    "units in braces": TABLE.replace("[", "{").replace("]", "}"),
    "units in quotes": TABLE.replace("[", "'").replace("]", "'"),
    "a row of numbers in the head": "7;100;1;2\n" + TABLE,
    "a footer": TABLE + "\nMax;120;30;0.5\nEnd of data\n",
    "blank rows": "\n".join([NAMES, *LINES[:5], ";;;", "", *LINES[5:]]) + "\n",
    "names twice": "\n".join([NAMES, *LINES[:5], NAMES, *LINES[5:]]) + "\n",
}


@pytest.mark.parametrize("content", FORMS.values(), ids=FORMS)
def test_the_table_is_found_in_every_form_and_gives_the_same_bits(content, tmp_path):
    is_the_table(segment(tmp_path, content, ALL))


def test_a_last_line_that_was_cut_off_is_left_out_and_told(tmp_path, yawbench):
    made = read(tmp_path, TABLE[:-20], ALL)
    assert made.segments[0].time.size == TIMES.size - 1
    (note,) = [one for one in made.notes if one.code == "recording-rows"]
    assert mentions(note.message, f"line {TIMES.size + 1}", "cut off")
    assert "cut off" in yawbench("measured", "show", tmp_path / "measured.yaml")[2]


def test_a_row_with_more_or_fewer_cells_is_refused_with_its_line(tmp_path):
    for row in ("0.35;1;2", "0.35;1;2;3;4"):
        text = "\n".join([NAMES, *LINES[:4], row, *LINES[4:]]) + "\n"
        assert f"row 6 has {row.count(';') + 1} values for 4 columns" in refusal(tmp_path, text, ALL)


def test_the_line_of_names_can_be_given(tmp_path):
    text = "time;v;r;a\n" + TABLE
    is_the_table(segment(tmp_path, text, ALL, more="header: 2\n"))
    assert "header" in refusal(tmp_path, TABLE, ALL, more="header: 900\n")
    far = "Lap;Time\n" * 500 + TABLE
    assert "header" in refusal(tmp_path, far, ALL)
    is_the_table(segment(tmp_path, far, ALL, more="header: 501\n"))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no rows"),
        ("time;v\n", "no rows"),
        ("\n".join(LINES), "no names of columns"),
        ("these are\nonly some\nwords\n", "no table"),
        (b"\x00\x01\x02" * 40, "not text"),
        ("time [s];v\n0;1\n1;x\n2;3\n", "value 2 is not a number"),
        ("time [s];v [m/s]\n0;1\n1;inf\n2;3\n", "value 2 is not finite"),
    ],
)
def test_what_is_no_table_of_numbers_is_refused(text, says, tmp_path):
    assert says in refusal(tmp_path, text, {"velocity_x": "{column: v, unit: m/s}"})


# Decimal marks


def numbers(folder: Path, cells: list[str], more: str = "", separator: str = ";") -> list[float]:
    """Return a column of torques of a file whose other numbers are whole."""
    text = separator.join(["time [s]", "torque [N.m]"]) + "\n"
    text += "".join(separator.join([str(k), cell]) + "\n" for k, cell in enumerate(cells))
    return list(segment(folder, text, {"wheel_torque_fl": "torque"}, more=more).signals["wheel_torque_fl"])


@pytest.mark.parametrize(
    ("cells", "means"),
    [
        (["1,250", "25.5"], [1250.0, 25.5]),
        (["1.250", "25,5"], [1250.0, 25.5]),
        (["1,250.5", "3,000"], [1250.5, 3000.0]),
        (["1.250,5", "3.000"], [1250.5, 3000.0]),
        (["1,250,000", "3,000"], [1250000.0, 3000.0]),
        (["0,250", "1,250"], [0.25, 1.25]),
        (["-1,250", "-0.5"], [-1250.0, -0.5]),
        (["1.250", "2.125"], [1.25, 2.125]),
        (["1'250.5", "1 250.5"], [1250.5, 1250.5]),
        (["1\u00a0250,5", "0,5"], [1250.5, 0.5]),
        (["1,5e2", "+0,5"], [150.0, 0.5]),
    ],
)
def test_the_decimal_mark_belongs_to_the_file(cells, means, tmp_path):
    assert numbers(tmp_path, cells) == means
    assert numbers(tmp_path, [f'"{cell}"' for cell in cells], separator=",") == means


def test_a_file_that_does_not_show_its_decimal_mark_is_refused_unless_it_is_given(tmp_path):
    for cells in (["1,250", "1,500"], ["1,250", "1.500"], ["2.5", "2,5"]):
        text = "time [s];torque [N.m]\n" + "".join(f"{k};{cell}\n" for k, cell in enumerate(cells))
        assert mentions(refusal(tmp_path, text, {"wheel_torque_fl": "torque"}), "decimal: ", cells[0])
    assert numbers(tmp_path, ["1,250", "1,500"], "decimal: ','\n") == [1.25, 1.5]
    assert numbers(tmp_path, ["1,250", "1,500"], "decimal: '.'\n") == [1250.0, 1500.0]


# Cells without a value, and rates


@pytest.mark.parametrize("blank", ["", "NaN", "-", "null", " ", "N/A", "#N/A", "1.#QNAN"])
def test_a_cell_without_a_value_is_a_sample_that_was_not_taken(blank, tmp_path):
    made = segment(tmp_path, f"time [s],v [m/s]\n0,20\n1,{blank}\n2,22\n", SPEED_ALONE)
    assert made.time.tolist() == [0.0, 2.0]
    assert made.signals["velocity_x"].tolist() == [20.0, 22.0]


def test_values_do_not_depend_on_the_order_of_signals(tmp_path):
    """Speed at 1 Hz, yaw rate at 10 Hz, lateral acceleration at 2 Hz, in one table."""

    def row(k):
        return f"{TIMES[k]};{'' if k % 10 else 3.6 * SPEED[k]};{YAW[k]};{'' if k % 5 else SIDE[k]}"

    first, *others = (
        segment(tmp_path, NAMES + "\n" + rows(row), dict(order)) for order in permutations(ALL.items())
    )
    assert np.array_equal(first.time, TIMES[TIMES <= 69.0])
    assert first.signals["velocity_x"] == pytest.approx(SPEED[TIMES <= 69.0], abs=1e-9)
    assert first.signals["yaw_rate"] == pytest.approx(np.radians(YAW[TIMES <= 69.0]), rel=1e-15)
    for other in others:
        assert np.array_equal(other.time, first.time)
        assert all(np.array_equal(other.signals[name], first.signals[name]) for name in ALL)


def test_a_column_without_samples_or_with_one_is_refused_by_name(tmp_path, recwarn):
    text = "time [s],v [m/s],r [rad/s]\n0,1,\n1,2,{}\n2,3,\n"
    signals = {"velocity_x": "v", "yaw_rate": "r"}
    assert "'r' has no values" in refusal(tmp_path, text.format(""), signals)
    assert "yaw_rate" in refusal(tmp_path, text.format("1"), signals)
    assert not recwarn.list


def test_rows_without_a_time_are_left_out_and_told(tmp_path):
    made = read(tmp_path, "time [s],v [m/s]\n0,1\n,2\n2,3\n", SPEED_ALONE)
    assert made.segments[0].signals["velocity_x"].tolist() == [1.0, 3.0]
    assert any("no time" in note.message for note in made.notes)


def test_signals_that_share_no_time_are_named(tmp_path):
    text = "time [s],v [m/s],r [rad/s]\n0,1,\n1,2,\n2,,1\n3,,1\n"
    said = refusal(tmp_path, text, {"velocity_x": "v", "yaw_rate": "r"})
    assert "velocity_x" in said and "yaw_rate" in said


# Clocks


def clock(cells: list[str], folder: Path, time: str = "time", header: str = "time") -> list[float]:
    """Return the times that a column of a CSV file gives."""
    text = f"{header};v [m/s]\n" + "".join(f"{cell};20\n" for cell in cells)
    return list(segment(folder, text, SPEED_ALONE, time).time)


@pytest.mark.parametrize(
    "cells",
    [
        ["12:00:00.00", "12:00:00.50", "12:00:01.25"],
        ["12:00:00,00", "12:00:00,50", "12:00:01,25"],
        ["12:00:00:000", "12:00:00:500", "12:00:01:250"],
        ["23:59:59.50", "0:00:00.00", "0:00:00.75"],
        ["0:59.5", "1:00.0", "1:00.75"],
        ["59:59.5", "00:00.0", "00:00.75"],
        ["2026-05-17T12:00:00.00Z", "2026-05-17T12:00:00.50Z", "2026-05-17T12:00:01.25Z"],
        ["2026-05-17T12:00:00Z", "2026-05-17T12:00:00.5Z", "2026-05-17T12:00:01.25Z"],
        ["2026-05-17 12:00:00,000", "2026-05-17 12:00:00,500", "2026-05-17 12:00:01,250"],
        ["2026-05-17T23:59:59.5+02:00", "2026-05-18T00:00:00.0+02:00", "2026-05-18T00:00:00.75+02:00"],
        ["17-May-2026 12:00:00.000", "17-May-2026 12:00:00.500", "17-May-2026 12:00:01.250"],
        ["11.05.2026 23:59:59.50", "12.05.2026 00:00:00.00", "12.05.2026 00:00:00.75"],
        ["05/11/2026 11:59:59.50 PM", "05/12/2026 12:00:00.00 AM", "05/12/2026 12:00:00.75 AM"],
    ],
)
def test_stamps_and_times_of_day_count_from_the_first_row(cells, tmp_path):
    assert clock(cells, tmp_path) == pytest.approx([0.0, 0.5, 1.75 if len(cells) == 4 else 1.25], abs=1e-9)
    assert clock(cells, tmp_path, "{column: time, unit: s}") == clock(cells, tmp_path)


def test_a_clock_with_empty_cells_is_read(tmp_path):
    assert clock(["12:00:00.00", "", "12:00:01.00", "-", "12:00:02.00"], tmp_path) == [0.0, 1.0, 2.0]


def test_a_clock_of_text_with_another_unit_is_refused(tmp_path):
    text = "time;v [m/s]\n12:00:00.0;20\n12:00:01.0;20\n"
    assert "'ms'" in refusal(tmp_path, text, SPEED_ALONE, "{column: time, unit: ms}")
    wrong = text.replace("12:00:01.0", "noon") + "12:00:02.0;20\n"
    assert "value 2 is not a time" in refusal(tmp_path, wrong, SPEED_ALONE)


def test_packed_clock_times_are_read_by_their_key_and_refused_as_seconds(tmp_path):
    cells, packed = ["235958.50", "235959.00", "000000.00", "000100.25"], "{column: time, unit: hhmmss}"
    assert clock(cells, tmp_path, packed) == [0.0, 0.5, 1.5, 61.75]
    assert clock(cells, tmp_path, header="time [hhmmss]") == [0.0, 0.5, 1.5, 61.75]
    text = "time;v [m/s]\n" + "".join(f"{cell};20\n" for cell in ("115958", "115959", "120000", "120001"))
    assert mentions(refusal(tmp_path, text, SPEED_ALONE, SECONDS), "unit: hhmmss", "115959")
    assert "119960" in refusal(tmp_path, text.replace("120000", "119960"), SPEED_ALONE, packed)


def test_seconds_that_pass_a_hundred_are_no_clock_times():
    for times in (np.arange(0.0, 300.0, 0.1), np.arange(0.0, 5000.0, 20.0), np.array([0.0, 50.0, 150.0])):
        assert seconds_of(times, "s", "time") is not None


def test_unix_times_count_from_the_first_row_in_s_and_ms(tmp_path):
    begin = 1779019200
    for factor in (1, 1000):
        cells = [f"{factor * (begin + t):.1f}" for t in (0.0, 0.5, 1.5)]
        assert clock(cells, tmp_path, "{column: time, unit: unix time}") == [0.0, 0.5, 1.5]
    cells = [f"{1000 * (begin + t):.0f}" for t in (0.0, 0.5, 1.5)]
    assert clock(cells, tmp_path, "{column: time, unit: ms}") == [begin, begin + 0.5, begin + 1.5]


STAMPS = np.datetime64("2026-05-17T12:00:00") + (10 * np.arange(801)).astype("timedelta64[ms]")
OF_DAY = [f"12:00:{second:05.2f}" for second in 0.01 * np.arange(801)]
TYPES = {
    "timestamp": pa.array(STAMPS.astype("datetime64[ns]")),
    "timestamp in ms": pa.array(STAMPS, pa.timestamp("ms")),
    "timestamp with a zone": pa.array(STAMPS, pa.timestamp("us", "Europe/Berlin")),
    "duration": pa.array((STAMPS - STAMPS[0]).astype("timedelta64[us]")),
    "time of day": pa.array(STAMPS.astype("datetime64[us]").astype(object)).cast(pa.time64("us")),
    "text": pa.array([str(stamp) for stamp in STAMPS]),
    "text in a dictionary": pa.array(OF_DAY).dictionary_encode(),
    "text of numbers": pa.array([f"{0.01 * k:.2f}" for k in range(801)]),
    "decimal": pa.array([f"{0.01 * k:.2f}" for k in range(801)]).cast(pa.decimal128(6, 2)),
}


def parquet(folder, **columns):
    """Return the bytes of a Parquet file."""
    pq.write_table(pa.table(columns), folder / "run.parquet")
    return (folder / "run.parquet").read_bytes()


OF_PARQUET = {"file": "run.parquet"}


@pytest.mark.parametrize("times", TYPES.values(), ids=TYPES)
def test_types_of_parquet_columns_are_respected(times, tmp_path):
    raw = parquet(tmp_path, time=times, v=25.0 + 0.01 * np.arange(801))
    made = segment(tmp_path, raw, {"velocity_x": "{column: v, unit: m/s}"}, SECONDS, **OF_PARQUET)
    assert made.time == pytest.approx(0.01 * np.arange(801), abs=1e-12) and made.rate == pytest.approx(100.0)


@pytest.mark.parametrize(
    ("column", "says"),
    [(STAMPS[:3], "times, not numbers"), ([[1.0], [2.0], [3.0]], "lists"), (["a", "b", "c"], "not a number")],
)
def test_parquet_columns_that_are_no_numbers_are_refused(column, says, tmp_path):
    raw, signals = parquet(tmp_path, time=np.arange(3.0), v=column), {"velocity_x": "{column: v, unit: m/s}"}
    assert says in refusal(tmp_path, raw, signals, SECONDS, **OF_PARQUET)


def test_null_in_parquet_is_a_sample_that_was_not_taken(tmp_path):
    raw = parquet(tmp_path, time=[0.0, 1.0, None, 3.0], v=pa.array([20, None, 22, 23]))
    made = segment(tmp_path, raw, {"velocity_x": "{column: v, unit: m/s}"}, SECONDS, **OF_PARQUET)
    assert made.time.tolist() == [0.0, 3.0]


# A clock that jumps, and the low pass


def test_a_clock_that_is_set_while_recording_is_named_with_its_jump(tmp_path):
    late = [*TIMES[:3], *(1.7e9 + TIMES[3:])]
    said = refusal(tmp_path, "time [s],v [m/s]\n" + "".join(f"{t:.2f},20\n" for t in late), SPEED_ALONE)
    assert mentions(said, "from 0.2 to 1700000000.3 s", "value 4")
    with pytest.raises(InvalidValueError, match="1700000000"):
        even_grid(np.array(late))
    with pytest.raises(InvalidValueError, match="jumps"):
        even_grid(TIMES, 1e-9)


def test_times_that_go_back_or_occur_twice_are_told_apart(tmp_path):
    text = "time [s],v [m/s]\n1779019200.5,20\n1779019200.25,20\n1779019201,20\n"
    said = refusal(tmp_path, text, SPEED_ALONE)
    assert "1779019200.5" in said and "1779019200.25" in said
    assert "1779019200.5 s occurs twice" in refusal(tmp_path, text.replace(".25", ".5"), SPEED_ALONE)


@pytest.mark.parametrize("low_pass", ["5 Hz", "300 Hz"])
def test_a_low_pass_at_half_of_the_rate_or_above_is_refused_with_file_and_rate(low_pass, tmp_path):
    with refused(ScenarioError, names=("filter.low_pass", "run.csv", "10 Hz", low_pass)) as caught:
        read(tmp_path, TABLE, ALL, more=f"filter: {{low_pass: {low_pass}}}\n")
    assert [one.location.line for one in caught.value.diagnostics] == [4]


# Units, and names that occur twice


@pytest.mark.parametrize(
    ("text", "unit", "factor"),
    [
        ("mph", "m/s", 0.44704), ("KPH", "km/h", 1.0), ("km/hr", "km/h", 1.0), ("kmh", "km/h", 1.0),
        ("Km/H", "km/h", 1.0), ("Meters/second", "m/s", 1.0),
        ("knots", "m/s", 1852.0 / 3600.0), ("deg/sec", "deg/s", 1.0), ("°/s", "deg/s", 1.0),
        ("dps", "deg/s", 1.0), ("rad/sec", "rad/s", 1.0), ("G", "m/s2", GRAVITY), ("g", "m/s2", GRAVITY),
        ("mG", "m/s2", 0.001 * GRAVITY), ("m/s/s", "m/s2", 1.0), ("M/S^2", "m/s2", 1.0),
        ("m/s²", "m/s2", 1.0),
        ("psi", "Pa", 6894.757293168361), ("BAR", "Pa", 1e5), ("kPa", "Pa", 1e3), ("RPM", "rpm", 1.0),
        ("sec", "s", 1.0), ("msec", "ms", 1.0),
        ("°", "deg", 1.0), ("degrees", "deg", 1.0), ("ft", "m", 0.3048), ("ft-lb", "N.m", 1.3558179483314),
        ("NM", "N.m", 1.0), ("lbs", "kg", 0.45359237), ("%", "%", 1.0),
    ],
)  # fmt: skip
def test_units_of_loggers_are_known(text, unit, factor, tmp_path):
    wanted = parse_unit(unit)
    known = unit_in_file(text, wanted)
    assert known is not None and known.powers == wanted.powers
    ratio = float(known.factor / wanted.factor) * np.pi ** (known.pi - wanted.pi)
    assert ratio == pytest.approx(factor, rel=1e-12)


def test_units_of_loggers_are_read_from_headers_and_descriptions(tmp_path):
    text = "time [sec],v [mph],w,a [G]\n0,100,10,1\n1,100,10,1\n"
    for speed, value in (("v", 44.704), ("{column: w, unit: kph}", 10 / 3.6)):
        made = segment(tmp_path, text, {"velocity_x": speed, "acceleration_y": "a"})
        assert made.signals["velocity_x"] == pytest.approx([value] * 2, rel=1e-12)
        assert made.signals["acceleration_y"] == pytest.approx([GRAVITY] * 2, rel=1e-12)


def test_a_unit_that_is_not_known_is_no_unit_of_another_kind(tmp_path):
    text = "time [s],v [{}]\n0,1\n1,2\n"
    said = refusal(tmp_path, text.format("furlong/h"), SPEED_ALONE)
    assert mentions(said, "unknown unit", "'furlong/h'", "m/s") and "fit" not in said
    assert "does not fit" in refusal(tmp_path, text.format("kg"), SPEED_ALONE)
    stated = refusal(tmp_path, text.format("m/s"), {"velocity_x": "{column: v, unit: furlong/h}"})
    assert mentions(stated, "furlong/h", "gain")


def test_one_of_several_columns_of_a_name_is_chosen_by_number_or_header(tmp_path):
    text = "time [s],v [m/s],v [km/h],v [m/s]\n0,20,75.6,22\n1,20,75.6,22\n"
    for column, speed in (("v#1", 20.0), ("v#2", 21.0), ("v#3", 22.0), ("'v [km/h]'", 21.0)):
        made = segment(tmp_path, text, {"velocity_x": column})
        assert made.signals["velocity_x"][0] == pytest.approx(speed)
    for column, names in (
        ("v", ("3 columns", "'v'", "'v#2' (km/h)")),
        ("v#4", ("v#3",)),
        ("'v [m/s]'", ("'v [m/s]'",)),
        ("w#1", ("no column", "'w#1'")),
    ):
        assert mentions(refusal(tmp_path, text, {"velocity_x": column}), *names)
