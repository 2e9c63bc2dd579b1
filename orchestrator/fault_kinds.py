"""Faults: their kinds, with the effect of each on a signal, and faults as data.

`KINDS` is all that the program knows of them: files and options are checked against it, help texts and
documents list it, and the master takes the disturbances from it.

Random numbers are counter-based: that of message n depends on the fault's stream and n alone, so neither the
step size nor the process nor another fault changes any of them.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

if TYPE_CHECKING:
    import numpy as np

WORDS = ("share", "every", "seed", "from", "until")
"""Options of a fault that are written as a keyword and a value."""
NO_FAULTS = "none"
"""The text for no faults."""
EVERY = 0.01
"""Default time between two messages [s]. Chosen: typical of vehicle buses."""
BLOCK = 1024
"""Random numbers generated at a time; chosen: ten seconds of messages."""
LATE = 1e-9
"""Fraction of a message's period by which a time may fall short of its beginning."""


class FaultLocation(NamedTuple):
    """Location of a fault: a variable of an instance, or the wires from there to another instance."""

    instance: str
    variable: str
    target: str = ""
    input: str = "*"

    def __str__(self) -> str:
        to = f".{self.input}" if self.input != "*" else ""
        return f"{self.instance}.{self.variable}" + (f" -> {self.target}{to}" if self.target else "")


@dataclass(frozen=True)
class Fault:
    """A disturbance at a location for some time, as stated in a scenario, an experiment or an option."""

    on: FaultLocation
    kind: str  # of `KINDS`
    value: float | str | None = None  # in the signal's unit or in that of the kind, or text with a unit
    share: float | None = None  # of the messages
    every: float | None = None  # time from one message to the next [s]; None: `EVERY`
    seed: int | None = None  # of random numbers; None: 0
    begin: float = -math.inf  # [s]
    end: float = math.inf  # [s], no longer faulty then

    @property
    def item(self) -> dict[str, float | str]:
        """The fault as in a file, without its location and default values."""
        times = {"from": self.begin, "until": self.end}
        options = {"kind": self.kind, "value": self.value, "share": self.share, "every": self.every}
        options |= {"seed": self.seed} | {name: t if math.isfinite(t) else None for name, t in times.items()}
        return {name: value for name, value in options.items() if value is not None}

    def __str__(self) -> str:
        """The fault in one line, as `--fault` takes it after the location."""
        item = self.item
        named = [f"{name} {_text(item[name], name)}" for name in WORDS if name in item]
        return " ".join([self.kind, *([_text(item["value"])] if "value" in item else []), *named])


def _text(value: float | str, name: str = "") -> str:
    if isinstance(value, (str, int)):
        return str(value)
    return f"{value:.10g}" + (" s" if name in ("every", "from", "until") else "")


class FaultList(tuple[Fault, ...]):
    """The faults of one location in the order in which they act."""

    __slots__ = ()

    def __str__(self) -> str:
        """The faults in one line, as `--fault` takes them after the location."""
        return "; ".join(map(str, self)) or NO_FAULTS


@dataclass(frozen=True)
class FaultySignal:
    """A signal with a fault: an output for everything that it feeds, or a single input."""

    fault: Fault
    instance: str
    variable: str
    of_output: bool
    value: float | None = None  # of the fault, in the variable's unit or in that of the kind
    stream: int = 0  # seed of its random numbers, below 2**64


Disturbance = Callable[[float, float], float]
"""Called with time [s] and value of every sample, in order; returns the disturbed value."""


@dataclass(frozen=True)
class LinearDisturbance:
    """A disturbance x * gain + offset while begin <= t < end; the compiled loop makes it by itself, too.

    The offset of a mere gain is -0.0, which preserves every number, even the sign of zero.
    """

    begin: float  # [s]
    end: float  # [s]
    gain: float
    offset: float

    def __call__(self, t: float, x: float) -> float:
        return x * self.gain + self.offset if self.begin <= t < self.end else x


@dataclass(frozen=True)
class FaultKind:
    """A kind of fault: its effect on a signal x, and its options."""

    does: str
    disturbance: Callable[[FaultySignal, bool], Disturbance]
    """Called with the signal and whether it holds its value between samples, so that delays do not
    interpolate. The disturbance acts while begin <= t < end."""
    unit: str | None = None  # of its value: "{x}" that of the signal; None: it takes no value
    default: float | None = None  # of the value
    needs: bool = True  # whether a value is required
    least: float | None = None  # minimum of the value
    most: float | None = None  # maximum of the value
    drawn: bool = False  # random: takes seed and every
    shared: bool = False  # takes share
    adds: bool = False  # its value is a difference: an offset of a unit does not apply to it


def _value(signal: FaultySignal) -> float:
    assert signal.value is not None  # required by the kind
    return signal.value


def _linear(
    parts: Callable[[float], tuple[float, float]],
) -> Callable[[FaultySignal, bool], Disturbance]:
    """Return the disturbance of a linear kind; `parts` returns gain and offset for the fault's value."""
    return lambda signal, held: LinearDisturbance(
        signal.fault.begin, signal.fault.end, *parts(_value(signal))
    )


def _changing(change: Callable[[float, float], float]) -> Callable[[FaultySignal, bool], Disturbance]:
    """Return the disturbance of a kind without memory, called with x and the fault's value."""

    def made(signal: FaultySignal, held: bool) -> Disturbance:
        begin, end, value = signal.fault.begin, signal.fault.end, _value(signal)
        return lambda t, x: change(x, value) if begin <= t < end else x

    return made


def _freeze(signal: FaultySignal, held: bool) -> Disturbance:
    begin, end = signal.fault.begin, signal.fault.end
    since, kept = math.nan, math.nan

    def disturb(t: float, x: float) -> float:
        nonlocal since, kept
        if not begin <= t < end:
            return x
        if math.isnan(since) or t == since:
            since, kept = t, x
        return kept

    return disturb


def _constant(x: float, value: float) -> float:
    return value


def _stuck(signal: FaultySignal, held: bool) -> Disturbance:
    return (_freeze if signal.value is None else _changing(_constant))(signal, held)


def _drift(signal: FaultySignal, held: bool) -> Disturbance:
    begin, end, rate = signal.fault.begin, signal.fault.end, _value(signal)
    since = begin if math.isfinite(begin) else math.nan

    def disturb(t: float, x: float) -> float:
        nonlocal since
        if math.isnan(since):
            since = t
        return x + rate * (t - since) if begin <= t < end else x

    return disturb


def _delay(signal: FaultySignal, held: bool) -> Disturbance:
    begin, end, delay = signal.fault.begin, signal.fault.end, _value(signal)
    samples: deque[tuple[float, float]] = deque()

    def disturb(t: float, x: float) -> float:
        if samples and samples[-1][0] == t:
            samples.pop()
        samples.append((t, x))
        past = t - delay
        while len(samples) > 1 and samples[1][0] <= past + LATE * abs(delay):
            samples.popleft()
        if not begin <= t < end:
            return x
        (before, first), (after, second) = samples[0], samples[min(1, len(samples) - 1)]
        if held or after == before or past <= before:
            return first
        return first + (second - first) * (past - before) / (after - before)

    return disturb


def _dropout(signal: FaultySignal, held: bool) -> Disturbance:
    chances = CountedNoise(signal, lambda generator: generator.random(BLOCK))
    begin, end, share = signal.fault.begin, signal.fault.end, signal.fault.share or 0.0
    first, kept = math.nan, math.nan

    def disturb(t: float, x: float) -> float:
        nonlocal first, kept
        if math.isnan(first):
            first = t
        if begin <= t < end and t > first and chances.at(t) < share:
            return kept
        kept = x
        return x

    return disturb


def _noise(signal: FaultySignal, held: bool) -> Disturbance:
    numbers = CountedNoise(signal, lambda generator: generator.standard_normal(BLOCK))
    begin, end, value = signal.fault.begin, signal.fault.end, _value(signal)
    return lambda t, x: x + value * numbers.at(t) if begin <= t < end else x


def _outlier(signal: FaultySignal, held: bool) -> Disturbance:
    chances = CountedNoise(signal, lambda generator: generator.random(BLOCK))
    begin, end, value = signal.fault.begin, signal.fault.end, _value(signal)
    share = signal.fault.share or 0.0

    def sign(chance: float) -> float:
        return 0.0 if chance >= share else 1.0 if chance < share / 2 else -1.0

    return lambda t, x: x + value * sign(chances.at(t)) if begin <= t < end else x


class CountedNoise:
    """Counter-based random numbers, one per message of a fault, whose messages are equally spaced in time.

    Args:
        signal: defines the random stream and the time between messages.
        draw: returns the next `BLOCK` numbers of a generator.
    """

    def __init__(self, signal: FaultySignal, draw: Callable[[np.random.Generator], np.ndarray]) -> None:
        self._stream = signal.stream
        self._every = signal.fault.every or EVERY
        self._draw = draw
        self._block: int | None = None
        self._numbers: list[float] = []

    def at(self, t: float) -> float:
        """Return the random number of the message in force at a time [s]."""
        block, place = divmod(math.floor(t / self._every + LATE), BLOCK)
        if block != self._block:
            import numpy as np

            key = np.array([self._stream, block % 2**64], np.uint64)
            self._block = block
            self._numbers = self._draw(np.random.Generator(np.random.Philox(key=key))).tolist()
        return self._numbers[place]


FaultName = Literal[
    "bias", "gain", "drift", "noise", "freeze", "value",
    "dropout", "outlier", "delay", "saturation", "loss", "stuck",
]  # fmt: skip
"""Names of the kinds, for type checkers and editors."""

KINDS: dict[str, FaultKind] = {
    "bias": FaultKind("x + value", _linear(lambda value: (1.0, value)), "{x}", adds=True),
    "gain": FaultKind("x * value", _linear(lambda value: (value, -0.0)), "1"),
    "drift": FaultKind("x + value * (time since the fault began)", _drift, "{x}/s"),
    "noise": FaultKind(
        "x + value * normally distributed numbers, a new one every message",
        _noise, "{x}", least=0, drawn=True, adds=True,
    ),
    "freeze": FaultKind("the x at which the fault began", _freeze),
    "value": FaultKind("value", _changing(_constant), "{x}"),
    "dropout": FaultKind(
        "a share of the messages is lost, the last x before holds", _dropout, drawn=True, shared=True
    ),
    "outlier": FaultKind(
        "a share of the messages is x + value or x - value",
        _outlier, "{x}", drawn=True, shared=True, adds=True,
    ),
    "delay": FaultKind("the x of so long ago", _delay, "s", least=0),
    "saturation": FaultKind(
        "x, but at most value and at least -value",
        _changing(lambda x, value: min(max(x, -value), value)), "{x}", least=0,
    ),
    "loss": FaultKind(
        "of an actuator: x without this part of it, by default nothing is left",
        _linear(lambda value: (1.0 - value, -0.0)), "1", 1.0, least=0, most=1,
    ),
    "stuck": FaultKind(
        "of an actuator: value, by default the x at which the fault began", _stuck, "{x}", needs=False
    ),
}  # fmt: skip
"""Name -> kind. To add a kind, add it here and to `FaultName`."""
