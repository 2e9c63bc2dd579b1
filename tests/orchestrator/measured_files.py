"""Recordings made up in the forms of loggers, and how they are described."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from yawbench.foundation.errors import ScenarioError
from yawbench.measurements.measurement import Measurement, load_measurement
from yawbench.measurements.segment import Segment

TIMES = np.round(0.1 * np.arange(700), 1)
"""s: 70 s at 10 Hz, past the end of a minute."""
SPEED, YAW, SIDE = 20.0 + 0.05 * TIMES, 5.0 * np.sin(TIMES), 0.3 * np.sin(TIMES)
"""m/s, deg/s, g"""
GRAVITY = 9.80665


def rows(cells: Callable[[int], str], end: str = "\n") -> str:
    """Return the lines of all samples."""
    return "".join(cells(k) + end for k in range(TIMES.size))


def described(
    folder: Path, file: str, signals: Mapping[str, str], time: str = "time", more: str = ""
) -> Path:
    """Write the description of a file and return its path."""
    path = folder / "measured.yaml"
    columns = ", ".join(f"{name}: {column}" for name, column in signals.items())
    path.write_text(f"files: [{file}]\ntime: {time}\nsignals: {{{columns}}}\n{more}", encoding="utf-8")
    return path


def read(
    folder: Path,
    content: str | bytes,
    signals: Mapping[str, str],
    time: str = "time",
    more: str = "",
    file: str = "run.csv",
) -> Measurement:
    """Write a recording and its description, and read them."""
    (folder / file).write_bytes(content.encode() if isinstance(content, str) else content)
    return load_measurement(described(folder, file, signals, time, more))


def segment(
    folder: Path, content: str | bytes, signals: Mapping[str, str], *more: str, **named: str
) -> Segment:
    """Read a recording with a single segment."""
    (only,) = read(folder, content, signals, *more, **named).segments
    return only


def refusal(folder: Path, content: str | bytes, signals: Mapping[str, str], *more: str, **named: str) -> str:
    """Return the only sentence with which a recording is refused."""
    with pytest.raises(ScenarioError) as refused:
        read(folder, content, signals, *more, **named)
    (only,) = {one.message for one in refused.value.diagnostics}
    assert "Error" not in only and "Traceback" not in only
    return only
