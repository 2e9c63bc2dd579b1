"""Logs of CAN frames, BLF of Vector and ASC, decoded by a DBC file that is beside them."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from yawbench.foundation.messages import listed
from yawbench.foundation.safe_files import TEXT, read_bytes, reason

LOGS = (".blf", ".asc")


class LoggedSignal(NamedTuple):
    """A signal of a log, with a value for each of its messages."""

    name: str
    message: str
    unit: str | None
    times: np.ndarray  # shape (n,) [s], since the first frame of the log
    values: np.ndarray  # shape (n,), in the unit of the DBC file


def database_beside(path: Path) -> Path:
    """Return the DBC file of a log: that of its name, else the only one in its folder.

    Raises:
        ValueError: there is none, or there are several.
    """
    there = sorted(file for file in path.parent.iterdir() if file.suffix.lower() == ".dbc")
    same = [file for file in there if file.stem == path.stem]
    found = same or there
    if len(found) != 1:
        has = f"there are {listed(file.name for file in there)}" if there else "there is none"
        raise ValueError(
            f"holds raw CAN frames, which need a DBC file beside them, {path.stem}.dbc or the only one: {has}"
        )
    return found[0]


def load_database(path: Path) -> tuple[Any, bytes]:
    """Return a DBC file as cantools has it, and its content.

    Raises:
        ImportError: cantools is not installed.
        OSError: the file cannot be read.
        ValueError: it is too large, or not understood.
    """
    import cantools

    content = read_bytes(path, largest=TEXT)
    text = content.decode("cp1252", errors="replace")  # as the format's maker writes it
    try:
        return cantools.database.load_string(text, database_format="dbc"), content
    except Exception as error:  # cantools raises whatever its parsing meets
        raise ValueError(f"not understood as DBC: {' '.join(str(error).split())}") from None


def read_log(path: Path, raw: bytes) -> tuple[list[LoggedSignal], bytes]:
    """Return those signals of a log with the content `raw` that its DBC file knows, and that file's content.

    Raises:
        ValueError: a package or the DBC file is missing, or one of the files is not understood.
    """
    beside = database_beside(path)
    try:
        import can

        database, content = load_database(beside)
    except ImportError:
        raise ValueError("CAN logs need python-can and cantools: pip install 'yawbench[can]'") from None
    except (OSError, ValueError) as error:
        raise ValueError(f"{beside.name}: {reason(error)}") from None
    known = {(message.frame_id, message.is_extended_frame): message for message in database.messages}
    values: dict[tuple[str, str], list[tuple[float, float]]] = {}
    begin: float | None = None
    try:
        for frame in _frames(can, path.suffix.lower(), raw):
            begin = frame.timestamp if begin is None else begin
            message = known.get((frame.arbitration_id, frame.is_extended_id))
            if message is None or frame.is_error_frame or frame.is_remote_frame:
                continue
            decoded = message.decode(bytes(frame.data), decode_choices=False)
            for name, value in decoded.items():
                values.setdefault((message.name, name), []).append((frame.timestamp - begin, float(value)))
    except Exception as error:  # python-can and cantools raise whatever their parsing meets
        raise ValueError(f"is not a CAN log, or damaged: {' '.join(str(error).split())}") from None
    if not values:
        raise ValueError(f"has no frame that {beside.name} knows")
    signals = []
    for (of, name), rows in values.items():
        unit = database.get_message_by_name(of).get_signal_by_name(name).unit
        times, numbers = np.array(rows).T
        signals.append(LoggedSignal(name, of, unit, times, numbers))
    return signals, content


def _frames(can: Any, ending: str, raw: bytes) -> Iterator[Any]:
    if ending == ".blf":
        yield from can.BLFReader(io.BytesIO(raw))
    else:
        yield from can.ASCReader(io.StringIO(raw.decode("cp1252")), relative_timestamp=True)
