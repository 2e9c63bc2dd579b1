"""Recorded signals in a page: every sample, within the stated error, in few bytes."""

from __future__ import annotations

import base64
import gzip
from dataclasses import replace

import numpy as np
import pytest

from tests.orchestrator.recorded import results
from tests.reports.made_up import whole_car
from yawbench.orchestrator.results.reader import Results
from yawbench.reports.viewer_samples import CLOSE, COARSE, EXACT, FINE, PackedRun, pack

RNG = np.random.default_rng(11)


def unpacked(packed: PackedRun, name: str) -> np.ndarray:
    """Return a column as the browser decodes it, written independently of the script."""
    raw = gzip.decompress(base64.b64decode(packed.block))
    offset, base, step = packed.header["time"] if name == "time" else packed.header["columns"][name]
    n = packed.rows
    planes = np.frombuffer(raw[offset : offset + 4 * n], np.uint8).reshape(4, n).astype(np.int64)
    words = sum(planes[k] << (8 * k) for k in range(4))
    codes = np.cumsum(np.cumsum((words >> 1) ^ -(words & 1))).astype("<i4")
    values = base + codes * step
    for code, value in ((-1, np.nan), (-2, -np.inf), (-3, np.inf)):
        values[codes == code] = value
    return values


def made(*, rows: int = 500, **columns: np.ndarray) -> Results:
    return results({f"plant.{name}": values for name, values in columns.items()}, np.linspace(0, 5, rows))


def test_every_sample_is_within_half_a_step_of_the_recorded_one():
    runs = [whole_car(), whole_car(2.0)]
    for run, packed in zip(runs, pack(runs), strict=True):
        assert set(packed.columns) == set(run.columns)
        for name, values in run.columns.items():
            ends = [(one.columns[name].min(), one.columns[name].max()) for one in runs]
            span = max(high for _, high in ends) - min(low for low, _ in ends)
            error = np.max(np.abs(unpacked(packed, name) - values))
            assert error <= 0.5 * span / COARSE * (1 + 1e-9), name


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e7])
def test_any_shape_of_signal_survives(scale):
    shapes = {
        "noise": RNG.normal(size=500),
        "walk": np.cumsum(RNG.normal(size=500)),
        "jumps": RNG.integers(-1, 2, 500).astype(float),
        "ramp": np.linspace(-3.0, 9.0, 500),
        "far": 1e6 + RNG.normal(size=500),
        "flag": RNG.integers(0, 2, 500).astype(bool),
        "count": RNG.integers(0, 9, 500),
        "often nothing": np.where(np.arange(500) % 3 == 0, 0.0, RNG.normal(size=500)),
    }
    run = made(
        **{name: values * scale if values.dtype.kind == "f" else values for name, values in shapes.items()}
    )
    (packed,) = pack([run])
    for name, values in run.columns.items():
        values = np.asarray(values, float)
        error = np.max(np.abs(unpacked(packed, name) - values))
        assert error <= 0.5 * np.ptp(values) / COARSE * (1 + 1e-6) + 1e-15 * np.max(np.abs(values)), name
    assert np.all(unpacked(packed, "plant.often nothing")[::3] == 0.0)


def test_a_difference_of_close_runs_is_no_rounding():
    one = np.sin(np.linspace(0, 6, 500))
    apart = 1e-4 * np.cos(np.linspace(0, 9, 500))
    assert np.max(np.abs(apart)) < CLOSE * np.ptp(one)
    runs = pack([made(x=one), made(x=one + apart), made(x=5.0 * one)])
    steps = np.array([run.columns["plant.x"].step for run in runs])
    np.testing.assert_allclose(steps, 10.0 * np.max(one) / np.array([FINE, FINE, COARSE]), rtol=1e-4)
    difference = unpacked(runs[1], "plant.x") - unpacked(runs[0], "plant.x")
    np.testing.assert_allclose(difference, apart, atol=2e-3 * 1e-4 + 10 / FINE)


@pytest.mark.parametrize("exact", [False, True])
def test_values_beside_others_that_are_not_finite_have_the_finest_steps(exact):
    values = RNG.normal(size=500)
    values[7:10] = np.nan, -np.inf, np.inf
    smooth = RNG.normal(size=500)
    (packed,) = pack([made(x=values, y=smooth, still=np.ones(500), none=np.full(500, np.nan))], exact=exact)
    finite = np.isfinite(values)
    half = 0.51 * np.ptp(values[finite]) / EXACT
    np.testing.assert_array_equal(unpacked(packed, "plant.x")[~finite], values[~finite])
    np.testing.assert_allclose(unpacked(packed, "plant.x")[finite], values[finite], rtol=0.0, atol=half)
    assert np.isnan(unpacked(packed, "plant.none")).all()
    assert packed.columns["plant.still"].step == 0.0
    half = 0.51 * np.ptp(smooth) / (EXACT if exact else COARSE)
    np.testing.assert_allclose(unpacked(packed, "plant.y"), smooth, rtol=0.0, atol=half)


@pytest.mark.parametrize("ends", [(-8e307, 8e307), (5.0, np.nextafter(5.0, 6.0)), (0.0, 5e-324)])
def test_any_range_survives(ends):
    values = np.array([*ends, ends[0]])
    (packed,) = pack([results({"plant.x": values}, np.arange(3.0))], exact=True)
    np.testing.assert_allclose(unpacked(packed, "plant.x"), values, rtol=1e-9, atol=1e-300)


def test_constants_and_both_ends_of_a_wire_cost_nothing():
    noise = RNG.normal(size=500)
    (one,) = pack([made(a=noise)])
    (two,) = pack([made(a=noise, b=noise.copy(), still=np.full(500, 3.25))])
    assert len(two.data) == len(one.data) + 4 * 500  # the codes of constants, all 0
    assert len(two.block) < len(one.block) + 100
    np.testing.assert_array_equal(unpacked(two, "plant.still"), np.full(500, 3.25))
    np.testing.assert_array_equal(unpacked(two, "plant.b"), unpacked(two, "plant.a"))


def test_even_and_uneven_times():
    even = made(x=np.zeros(500))
    np.testing.assert_allclose(unpacked(pack([even])[0], "time"), even.time, rtol=1e-15)
    uneven = replace(even, time=np.sort(RNG.uniform(0, 5, 500)))
    (packed,) = pack([uneven])
    np.testing.assert_allclose(unpacked(packed, "time"), uneven.time, rtol=0.0, atol=5.0 / EXACT)


def test_a_part_of_the_columns_is_packed_without_packing_again_and_texts_are_left_out():
    run = whole_car()
    words = {"plant.mode": np.array(["on"] * run.time.size, dtype=object)}
    (whole,) = pack([replace(run, columns=run.columns | words)])
    assert whole.columns.keys() == run.columns.keys() and [whole] == pack([run])
    part = whole.only({"plant.sideslip", "plant.yaw_rate"})
    assert set(part.header["columns"]) == {"plant.sideslip", "plant.yaw_rate"}
    assert len(part.block) < len(whole.block) / 2
    np.testing.assert_array_equal(unpacked(part, "plant.yaw_rate"), unpacked(whole, "plant.yaw_rate"))
