"""Results as a log of CAN frames, BLF or ASC: messages of a DBC file, each sent once a cycle.

A frame has the values of the last row before it; signals without a column are zero, or as near to it as they
can be. A number beyond the limits of its signal is sent as the nearest that can be.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from yawbench.foundation.errors import ResultsError, ScenarioError
from yawbench.foundation.messages import hint, listed
from yawbench.foundation.safe_files import write_whole
from yawbench.orchestrator.recordings.can_logs import LOGS
from yawbench.orchestrator.recordings.units_of_loggers import factors
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.scenario.quantities import parse_unit

from .can_signals import WHEELS, CanSignal, open_dbc, signals_of

SLACK = 1e-9
"""Time [s] by which a row may be later than its frame; chosen: far below a step, far above rounding."""


def write_log(
    results: Results, dbc: Path, columns: Mapping[str, str], path: Path, *, wheel_radius: float | None = None
) -> int:
    """Write columns of results as CAN frames, and return their number.

    Args:
        results: of a run.
        dbc: the file that describes the messages.
        columns: column -> signal, `Message.Signal`.
        path: of the log, `.blf` or `.asc`.
        wheel_radius: [m], for wheel speeds that are sent as speeds of rolling wheels.

    Raises:
        ScenarioError: the DBC file cannot be read, has no such signal, or the signal has another unit.
        ResultsError: there is no such column, or the log cannot be written.
    """
    if path.suffix.lower() not in LOGS:
        raise ResultsError(f"{path}: a log of CAN frames is {listed(LOGS, last='or')}", code="option-invalid")
    database = open_dbc(dbc)
    try:
        import can
    except ImportError:
        sentence = f"{path}: python-can is not installed: pip install 'yawbench[can]'"
        raise ResultsError(sentence, code="package-missing") from None
    known = signals_of(database)
    physical: dict[str, dict[str, np.ndarray]] = {}
    for column, name in columns.items():
        if name not in known:
            raise ScenarioError(
                f"{column}={name}: no signal {name!r}{hint(name, known, lead='there are')}",
                code="signal-unfit",
            )
        values = _in_unit(results, results.column(column), known[name], wheel_radius)
        physical.setdefault(known[name].message, {})[known[name].name] = values
    frames = []
    for name, sent in physical.items():
        message = database.get_message_by_name(name)
        cycle = (message.cycle_time or 0) / 1000
        if not cycle:
            raise ScenarioError(
                f"{dbc}: the message {name} has no cycle (GenMsgCycleTime)", code="signal-unfit"
            )
        begin = float(results.time[0])
        count = int((results.time[-1] - begin) / cycle + SLACK) + 1
        times = begin + cycle * np.arange(count)
        rows = np.searchsorted(results.time, times + SLACK, side="right") - 1
        rest = {
            s.name: min(max(0.0, known[f"{name}.{s.name}"].least), known[f"{name}.{s.name}"].largest)
            for s in message.signals
        }
        for time, row in zip(times.tolist(), rows.tolist(), strict=True):
            data = message.encode({**rest, **{of: float(v[row]) for of, v in sent.items()}}, strict=False)
            frames.append((time, message.frame_id, message.is_extended_frame, data))
    frames.sort(key=lambda frame: frame[:2])
    with tempfile.TemporaryDirectory(prefix="yawbench-") as folder:
        draft = Path(folder, f"log{path.suffix.lower()}")
        with can.Logger(draft) as log:
            for time, identifier, extended, data in frames:
                log(
                    can.Message(
                        timestamp=time,
                        arbitration_id=identifier,
                        is_extended_id=extended,
                        data=data,
                        is_rx=True,
                        channel=0,
                    )
                )
        try:
            write_whole(path, draft.read_bytes(), named=True)
        except OSError as error:
            sentence = f"{path}: cannot write this log: {error.strerror or error}"
            raise ResultsError(sentence, code="results-unwritable") from None
    return len(frames)


def _in_unit(results: Results, column: str, signal: CanSignal, wheel_radius: float | None) -> np.ndarray:
    """Return a column in the unit of a signal, within its limits."""
    unit = results.record.units.get(column) or "1"
    rolling = wheel_radius is not None and WHEELS in column
    wanted = "m/s" if rolling else unit
    try:
        gain, offset = factors(signal.unit or "1", parse_unit(wanted), wanted, f"signal {signal}")
    except ValueError as error:
        raise ScenarioError(f"{column}={signal}: {error}", code="signal-unfit") from None
    values = results[column] * (wheel_radius if rolling else 1.0)
    if not np.isfinite(values).all():
        raise ResultsError(
            f"{column}: has values that are no numbers, which a frame cannot carry", code="signal-unfit"
        )
    clipped: np.ndarray = np.clip((values - offset) / gain, signal.least, signal.largest)
    return clipped
