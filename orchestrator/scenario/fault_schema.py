"""Faults in scenario files: location, kind, beginning and end.

    faults:
      - {on: sensor.yaw_rate, kind: freeze, from: 1.5, until: 3.0}
      - {on: plant.yaw_rate -> sensor, kind: bias, value: 0.5 deg/s}

A location is `unit.output`, which affects everything that the output feeds and the results;
`unit.output -> unit` or `-> unit.input`, a wire to one target; or `unit.input`. A `*` matches several
variables, such as those of four wheels. In one line, as for `--fault` and in experiments, the location is
followed by `KIND VALUE share N every T seed N from T until T`, of which only the kind is required; several
faults at one location are separated by `;` and act in this order.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from typing import Annotated, Any, Literal, NamedTuple, get_args

from pydantic import Field, PlainSerializer, PlainValidator, model_validator

from ..messages import short
from ..plan import FAULT_WORDS, NO_FAULTS, FaultList, Value, fault_line
from . import quantities, yaml_lines
from .validation import Instant, StrictModel, Time

EVERY = Fraction(1, 100)
"""Default time between two messages [s]. Chosen: typical of vehicle buses."""

KindName = Literal[
    "bias", "gain", "drift", "noise", "freeze", "value", "dropout", "outlier", "delay", "saturation",
    "loss", "stuck",
]  # fmt: skip


@dataclass(frozen=True)
class FaultKind:
    """A kind of fault: its effect on a signal x, and its options."""

    does: str
    unit: str | None = None  # of its value: "{x}" that of the signal; None: it takes no value
    default: float | None = None  # of the value
    needs: bool = True  # whether a value is required
    least: float | None = None  # minimum of the value
    most: float | None = None  # maximum of the value
    drawn: bool = False  # random: takes seed and every
    shared: bool = False  # takes share


KINDS: dict[str, FaultKind] = {
    "bias": FaultKind("x + value", "{x}"),
    "gain": FaultKind("x * value", "1"),
    "drift": FaultKind("x + value * (time since the fault began)", "{x}/s"),
    "noise": FaultKind(
        "x + value * normally distributed numbers, a new one every message", "{x}", least=0, drawn=True
    ),
    "freeze": FaultKind("the x at which the fault began"),
    "value": FaultKind("value", "{x}"),
    "dropout": FaultKind("a share of the messages is lost, the last x before holds", drawn=True, shared=True),
    "outlier": FaultKind("a share of the messages is x + value or x - value", "{x}", drawn=True, shared=True),
    "delay": FaultKind("the x of so long ago", "s", least=0),
    "saturation": FaultKind("x, but at most value and at least -value", "{x}", least=0),
    "loss": FaultKind(
        "of an actuator: x without this part of it, by default nothing is left", "1", 1.0, least=0, most=1
    ),
    "stuck": FaultKind(
        "of an actuator: value, by default the x at which the fault began", "{x}", needs=False
    ),
}
"""All kinds of faults. To add a kind, add a row here, its name above, and it to `master.fault_injection`."""
assert tuple(KINDS) == get_args(KindName)


class FaultLocation(NamedTuple):
    """Location of a fault: a variable of an instance, or the wires from there to another instance."""

    instance: str
    variable: str
    target: str = ""
    input: str = "*"

    def __str__(self) -> str:
        to = f".{self.input}" if self.input != "*" else ""
        return f"{self.instance}.{self.variable}" + (f" -> {self.target}{to}" if self.target else "")


_PLACE = re.compile(r"\s*(\w+)\.([^\s>]+?)\s*(?:->\s*(\w+)(?:\.(\S+))?\s*)?")


def place_of(value: object) -> FaultLocation:
    """Parse the location of a fault.

    Raises:
        ValueError: not a location.
    """
    found = _PLACE.fullmatch(value) if isinstance(value, str) else None
    if found is None or any((part or "").count("*") > 1 for part in found.groups()):
        raise ValueError(
            f"must be unit.output, unit.input or unit.output -> unit, with at most one * (got {short(value)})"
        )
    return FaultLocation(found[1], found[2], found[3] or "", found[4] or "*")


def read_line(line: str) -> FaultList:
    """Parse the faults in one line, as written after a location.

    Raises:
        ValueError: an option is given twice.
    """
    if line.strip() == NO_FAULTS:
        return FaultList()
    items = []
    for text in line.split(";"):
        head, *rest = re.split(rf"(?:^|\s+)({'|'.join(FAULT_WORDS)})\s+", text.strip())
        kind, _, value = head.strip().partition(" ")
        item: dict[str, Any] = {"kind": kind} | ({"value": yaml_lines.scalar(value.strip())} if value else {})
        for name, given in zip(rest[::2], rest[1::2], strict=True):
            if name in item:
                raise ValueError(f"has {name} twice")
            item[name] = yaml_lines.scalar(given.strip())
        items.append(item)
    return FaultList(items)


def _value(value: object) -> float | str | None:
    if isinstance(value, bool) or not (isinstance(value, (int, float, str)) and value != ""):
        raise ValueError(f"must be a number, or a number with its unit (got {short(value)})")
    return value if isinstance(value, str) else float(value)


def _share(value: object) -> float:
    if isinstance(value, str) and value.endswith("%"):
        value = float(quantities.convert(value, "1"))
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value <= 1:
        raise ValueError(f"a share must be above 0 and at most 1 (got {short(value)})")
    return float(value)


FaultLocationText = Annotated[FaultLocation, PlainValidator(place_of), PlainSerializer(str)]
FaultValue = Annotated[float | str, PlainValidator(_value)]
Share = Annotated[float, PlainValidator(_share)]


class FaultSpec(StrictModel):
    """A disturbance of a signal for some time.

    Kinds are bias, gain, drift, noise, freeze, value, dropout, outlier, delay and saturation, and for
    actuators loss and stuck.
    """

    on: FaultLocationText = Field(description="unit.output, unit.input or unit.output -> unit")
    kind: KindName = Field(description="What becomes of the signal")
    value: FaultValue | None = Field(None, description="As the kind has it, with its unit or in the signal's")
    share: Share | None = Field(None, description="Of the messages, of dropout and outlier")
    every: Time | None = Field(
        None, description="Time from one message to the next, of what is random; default: 10 ms"
    )
    seed: int | None = Field(None, ge=0, description="Of random numbers; default: 0")
    begin: Instant | None = Field(None, alias="from", description="s; left out: the start of the run")
    end: Instant | None = Field(None, alias="until", description="s; left out: the end of the run")

    @model_validator(mode="after")
    def _consistent(self) -> FaultSpec:
        kind = KINDS[self.kind]
        if kind.unit is None and self.value is not None:
            raise ValueError(f"{self.kind} takes no value")
        if kind.unit is not None and kind.needs and kind.default is None and self.value is None:
            raise ValueError(f"{self.kind} needs a value: {kind.does}")
        if kind.shared != (self.share is not None):
            needs = "needs a share of the messages" if kind.shared else "takes no share"
            raise ValueError(f"{self.kind} {needs}")
        for name in () if kind.drawn else ("seed", "every"):
            if getattr(self, name) is not None:
                raise ValueError(f"{self.kind} takes no {name}: nothing of it is random")
        if self.begin is not None and self.end is not None and not self.begin < self.end:
            raise ValueError(f"until must be after from, {float(self.begin):g} s (got {float(self.end):g} s)")
        return self

    @property
    def item(self) -> dict[str, Value]:
        """The fault as in a file, without its location."""
        times = {"every": self.every, "from": self.begin, "until": self.end}
        fields = {"kind": self.kind, "value": self.value, "share": self.share, "seed": self.seed}
        fields |= {name: None if time is None else float(time) for name, time in times.items()}
        return {name: value for name, value in fields.items() if value is not None}

    def __str__(self) -> str:
        """The fault in one line, without its location."""
        return fault_line(self.item)


def by_place(faults: Iterable[FaultSpec]) -> dict[str, FaultList]:
    """Group faults by location."""
    found: dict[str, FaultList] = {}
    for fault in faults:
        place = str(fault.on)
        found[place] = FaultList((*found.get(place, ()), fault.item))
    return found
