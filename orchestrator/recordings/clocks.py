"""Clocks of recordings, converted to seconds.

Numbers have a unit of time. Stamps with a date and times of day, be they text or a type of the file, packed
clock times (`hhmmss.ss`, unit `hhmmss`) and the unit `unix time` count from the first row that has a time.
Times of day go on after midnight.
"""

from __future__ import annotations

import re

import numpy as np

from ..scenario.quantities import parse_unit
from .units_of_loggers import factors

PACKED = "hhmmss"
"""Unit of clock times written as one number: 120059.90 is 12:00:59.90."""
UNIX = ("unix time", "unix")
"""Units of seconds since 1970."""
MILLISECONDS = 1e11
"""Unix times from here on are in ms. Chosen: 1e11 s is the year 5138, 1e11 ms is 1973."""
SECOND = parse_unit("s")
DAY, HOUR = 86_400.0, 3600.0
_TIME_OF_DAY = re.compile(r"(\d{1,2}):(\d\d):(\d\d(?:[.,:]\d+)?)")
_MINUTES = re.compile(r"(\d+):(\d\d[.,]\d+)")


def seconds_of(times: np.ndarray, unit: str | None, what: str) -> np.ndarray:
    """Convert a column of times to seconds; NaN where a row has none.

    Args:
        times: numbers, text, or datetime64 and timedelta64 of NumPy.
        unit: of numbers; of text and dates it may be None or s.
        what: name of the column for messages.

    Raises:
        ValueError: it has no times that can be converted.
    """
    if holds_times(times) and unit not in (None, "s", "sec", PACKED, *UNIX):
        shown = next((str(cell) for cell in times if cell is not None), "")
        raise ValueError(f"{what} has times of its own ({shown!r}): leave out its unit {unit!r}")
    if times.dtype.kind == "m":
        return _in_seconds(times)
    if times.dtype.kind == "M":
        return _differences(times, _first(~np.isnat(times), what))
    if times.dtype.kind == "O":
        try:
            times = np.array([np.nan if cell is None else float(cell) for cell in times])
        except ValueError:
            return _of_text(times, what)
    numbers = times.astype(float)
    refuse_infinite(numbers, what)
    if unit in UNIX:
        seconds: np.ndarray = numbers - numbers[_first(~np.isnan(numbers), what)]
        return seconds / 1000.0 if np.nanmax(np.abs(numbers)) > MILLISECONDS else seconds
    if unit == PACKED:
        return _unpacked(numbers, what)
    gain, offset = factors(unit or "s", SECOND, "s", what)
    seconds = numbers if (gain, offset) == (1.0, 0.0) else gain * numbers + offset
    if gain == 1.0:
        _refuse_packed(seconds, what)
    return seconds


def holds_times(times: np.ndarray) -> bool:
    """Return whether a column has times of its own: times of NumPy, or text with a colon."""
    if times.dtype.kind == "O":
        return any(":" in str(cell) for cell in times if cell is not None)
    return times.dtype.kind in "mM"


def _first(there: np.ndarray, what: str) -> int:
    rows = np.flatnonzero(there)
    if not rows.size:
        raise ValueError(f"{what} has no times")
    return int(rows[0])


def refuse_infinite(numbers: np.ndarray, what: str) -> None:
    """Raise ValueError if a number of a column is infinite."""
    bad = np.flatnonzero(np.isinf(numbers))
    if bad.size:
        raise ValueError(f"{what}: value {bad[0] + 1} is not finite ({numbers[bad[0]]:g})")


def _differences(stamps: np.ndarray, first: int) -> np.ndarray:
    """Return the seconds since a stamp, exact to the nanosecond; NaN where there is no stamp."""
    return _in_seconds(stamps - stamps[first])


def _in_seconds(times: np.ndarray) -> np.ndarray:
    seconds = times.astype("timedelta64[ns]").astype(np.int64) / 1e9
    return np.asarray(np.where(np.isnat(times), np.nan, seconds))


def _of_text(cells: np.ndarray, what: str) -> np.ndarray:
    """Convert texts: times of day, minutes and seconds, or dates with a time."""
    there = np.array([cell is not None for cell in cells])
    first = _first(there, what)
    texts = [str(cell).strip() for cell in cells[there]]
    seconds = np.full(cells.size, np.nan)
    if all(map(_TIME_OF_DAY.fullmatch, texts)):
        seconds[there] = _past_midnight(_whole(texts))
    elif all(map(_MINUTES.fullmatch, texts)):
        seconds[there] = _past_midnight(_whole([f"0:{text}" for text in texts]), HOUR)
    elif all(re.search(r"\d:\d\d", text) for text in texts):
        return _of_dates(cells, there, what)
    else:
        row, cell = next(
            (row, text)
            for row, text in zip(np.flatnonzero(there), texts, strict=True)
            if not re.search(r"\d:\d\d", text)
        )
        raise ValueError(f"{what}: value {row + 1} is not a time ({cell!r})")
    return np.asarray(np.round(seconds - seconds[first], 9))


def _whole(texts: list[str]) -> np.ndarray:
    """Return seconds of texts `h:m:s`, whose fraction may follow a comma or a colon."""
    parts = (re.split(r":", text.replace(",", "."), maxsplit=2) for text in texts)
    return np.array([3600.0 * int(h) + 60.0 * int(m) + float(s.replace(":", ".")) for h, m, s in parts])


def _past_midnight(seconds: np.ndarray, period: float = DAY) -> np.ndarray:
    """Return times of day, or of an hour, that go on where it ends."""
    steps = np.diff(seconds, prepend=seconds[:1])
    return np.asarray(seconds + period * np.cumsum(steps < -0.9 * period))


def _of_dates(cells: np.ndarray, there: np.ndarray, what: str) -> np.ndarray:
    """Convert texts with a date; of two readings of the date, day or month first, the shorter recording."""
    import warnings

    import pandas as pd

    texts = pd.Series(cells[there]).str.strip().str.replace(r"(:\d\d:\d\d)[,:](\d)", r"\1.\2", regex=True)
    readings = []
    for options in ({"format": "ISO8601"}, {"dayfirst": True}, {"dayfirst": False}, {"format": "mixed"}):
        try:
            with warnings.catch_warnings():  # pandas doubts its guess of a form
                warnings.simplefilter("ignore")
                stamps = pd.to_datetime(texts, utc=True, **options)
        except (ValueError, OverflowError):
            continue
        readings.append(stamps.dt.tz_localize(None).to_numpy())
        if "format" in options:
            break
    if not readings:
        raise ValueError(
            f"{what}: its times are not understood ({texts.iloc[0]!r}); 2026-05-17T12:00:00.00 would be"
        )
    stamps = min(readings, key=np.ptp)
    times = np.full(cells.size, np.datetime64("NaT"), dtype="datetime64[ns]")
    times[there] = stamps
    return _differences(times, _first(there, what))


def _unpacked(numbers: np.ndarray, what: str) -> np.ndarray:
    """Convert packed clock times."""
    first = _first(~np.isnan(numbers), what)
    minutes, seconds = np.floor(numbers / 100.0), np.mod(numbers, 100.0)
    wrong = (seconds >= 60.0) | (np.mod(minutes, 100.0) >= 60.0) | (numbers < 0.0) | (numbers >= 240_000.0)
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0])
        raise ValueError(f"{what}: value {row + 1} is not a clock time {PACKED} ({numbers[row]:.10g})")
    of_day = 3600.0 * np.floor(minutes / 100.0) + 60.0 * np.mod(minutes, 100.0) + seconds
    there = ~np.isnan(of_day)
    of_day[there] = _past_midnight(of_day[there])
    return np.asarray(np.round(of_day - of_day[first], 6))


def _refuse_packed(seconds: np.ndarray, what: str) -> None:
    """Raise ValueError for numbers of seconds that are clock times: they jump by 40 s at every minute."""
    times = seconds[~np.isnan(seconds)]
    if times.size < 3 or times.min() < 0.0 or times.max() >= 240_000.0:
        return
    if (np.mod(times, 100.0) >= 60.0).any() or (np.mod(np.floor(times / 100.0), 100.0) >= 60.0).any():
        return
    steps = np.diff(times)
    usual = float(np.median(steps))
    jumps = np.flatnonzero(np.floor(times[1:] / 100.0) > np.floor(times[:-1] / 100.0))
    late = [row for row in jumps if abs(float(steps[row]) % 4000.0 - 40.0) <= 2.0 * max(usual, 1e-3)]
    if 0.0 < usual < 10.0 and late:
        at = int(late[0])
        raise ValueError(
            f"{what} goes from {times[at]:.10g} to {times[at + 1]:.10g}: its numbers are clock times, "
            f"not seconds: write 'time: {{column: ..., unit: {PACKED}}}'"
        )
