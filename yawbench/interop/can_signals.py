"""Sensors whose messages carry the numbers of a CAN network, as its DBC file describes them.

A signal in a frame is a whole number, physical value = scale n + offset, sent every cycle. So it is a channel
of a sensor (`components.sensing.channel`) with this scale as its quantum, the number in the middle as its
offset, the numbers on either side as its range, the cycle as its time between messages, and the time that the
frame takes on the bus as its latency:

    C = (55 + 10 s) / bit rate        s bytes of data, 11-bit identifier                       (1)
    C = (80 + 10 s) / bit rate        29-bit identifier                                        (2)

with all bits stuffed that may be. Waiting for other frames (arbitration), load and errors are not modelled.

Source: R. I. Davis, A. Burns, R. J. Bril, J. J. Lukkien, Controller Area Network (CAN) schedulability
analysis: refuted, revisited and revised, Real-Time Systems 35(3), 2007.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from yawbench.components.sensing.cluster_parameters import CHANNELS
from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import hint
from yawbench.foundation.safe_files import reason
from yawbench.orchestrator.recordings.can_logs import load_database
from yawbench.orchestrator.recordings.units_of_loggers import factors, stated_unit
from yawbench.orchestrator.scenario.quantities import parse_unit

WHEELS = "wheel_speed"
"""Channel that is an angular speed, and in many networks the speed of the rolling wheel."""
BITS = {False: 55, True: 80}
"""Whether the identifier has 29 bits -> bits of a frame without data, stuffed: equations (1), (2)."""


class CanSignal(NamedTuple):
    """A signal of a DBC file."""

    message: str
    name: str
    unit: str
    scale: float  # [unit]
    offset: float  # [unit]
    least: float  # [unit]
    largest: float  # [unit]
    whole: bool  # a whole number in the frame, not floating-point
    cycle: float  # [s], 0 if the file does not give it
    size: int  # of the message's data [bytes]
    extended: bool  # 29-bit identifier

    def __str__(self) -> str:
        return f"{self.message}.{self.name}"


def read_dbc(path: Path) -> dict[str, CanSignal]:
    """Return the signals of a DBC file by their names, `Message.Signal`.

    Raises:
        ScenarioError: cantools is missing, or the file cannot be read.
    """
    return signals_of(open_dbc(path))


def open_dbc(path: Path) -> Any:
    """Return a DBC file as cantools has it; errors as for `read_dbc`."""
    try:
        return load_database(path)[0]
    except ImportError:
        sentence = f"{path}: cantools is not installed: pip install 'yawbench[can]'"
        raise ScenarioError(sentence, code="package-missing") from None
    except FileNotFoundError:
        raise ScenarioError(f"{path}: no such file", code="file-missing") from None
    except (OSError, ValueError) as error:
        raise ScenarioError(f"{path}: {reason(error)}", code="file-unreadable") from None


def signals_of(database: Any) -> dict[str, CanSignal]:
    """Return the signals of an open DBC file by their names."""
    signals = (_signal(message, signal) for message in database.messages for signal in message.signals)
    return {str(signal): signal for signal in signals}


def _signal(message: Any, signal: Any) -> CanSignal:
    scale, offset = float(signal.scale), float(signal.offset)
    bits = (-(2 ** (signal.length - 1)), 2 ** (signal.length - 1) - 1)
    if not signal.is_signed:
        bits = (0, 2**signal.length - 1)
    held = sorted(scale * n + offset for n in bits)
    stated = (signal.minimum, signal.maximum)
    least, largest = (
        float(b if a is None or signal.is_float else a) for a, b in zip(stated, held, strict=True)
    )
    if not signal.is_float:
        least, largest = max(least, held[0]), min(largest, held[1])
    return CanSignal(
        message.name, signal.name, stated_unit(signal.unit) or "", abs(scale), offset, least, largest,
        not signal.is_float, (message.cycle_time or 0) / 1000, message.length, message.is_extended_frame,
    )  # fmt: skip


def sensor_parameters(
    signals: Mapping[str, CanSignal],
    channels: Mapping[str, str],
    *,
    bit_rate: float | None = None,
    wheel_radius: float | None = None,
) -> dict[str, float]:
    """Return the parameters of a sensor whose channels are signals of a CAN network.

    Args:
        signals: those of the network, by name.
        channels: channel of the sensor -> name of its signal.
        bit_rate: of the bus [bit/s]; None: frames take no time.
        wheel_radius: [m], to take wheel speeds in km/h for angular speeds; None: they are angular speeds.

    Returns:
        parameter -> value in SI units.

    Raises:
        ScenarioError: there is no such channel or signal, or the channel cannot have the signal's numbers.
    """
    parameters: dict[str, float] = {}
    for channel, name in channels.items():
        if channel not in CHANNELS:
            raise _wrong(
                f"{channel}={name}", f"no channel {channel!r}{hint(channel, CHANNELS, lead='sensors have')}"
            )
        if name not in signals:
            raise _wrong(f"{channel}={name}", f"no signal {name!r}{hint(name, signals, lead='there are')}")
        signal, unit = signals[name], CHANNELS[channel].unit
        rolling = channel == WHEELS and wheel_radius is not None
        wanted = "m/s" if rolling else unit
        try:
            gain, shift = factors(signal.unit or "1", parse_unit(wanted), wanted, f"signal {name}")
        except ValueError as error:
            more = "; for the speed of rolling wheels give their radius" if channel == WHEELS else ""
            raise _wrong(f"{channel}={name}", f"{error}{more}") from None
        if rolling:
            gain /= wheel_radius  # type: ignore[operator]
        if signal.whole:
            first, last = (round((x - signal.offset) / signal.scale) for x in (signal.least, signal.largest))
            if last - first < 2:  # a range of 0 stands for none
                raise _wrong(f"{channel}={name}", "a signal of at most two numbers is none of a sensor")
            middle = int((first + last) / 2)  # of two the one nearer to zero, which then is in reach
            parameters[f"{channel}_quantum"] = signal.scale * gain
            if offset := (signal.scale * middle + signal.offset) * gain + shift:
                parameters[f"{channel}_offset"] = offset
            parameters[f"{channel}_range"] = min(middle - first, last - middle) * signal.scale * gain
        if signal.cycle:
            parameters[f"{channel}_sample_time"] = signal.cycle
        if bit_rate is not None:
            parameters[f"{channel}_latency"] = (BITS[signal.extended] + 10 * signal.size) / bit_rate
    return parameters


def _wrong(where: str, sentence: str) -> ScenarioError:
    return ScenarioError(f"{where}: {sentence}", code="signal-unfit")
