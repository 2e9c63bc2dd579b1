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

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from pydantic import Field, PlainSerializer, PlainValidator, model_validator

from ..errors import Location, ScenarioError
from ..fault_kinds import KINDS, NO_FAULTS, WORDS, Fault, FaultList, FaultLocation
from ..messages import listed, short
from ..plan import Value
from . import quantities, yaml_lines
from .validation import Instant, StrictModel, Time, one_of, validate

_PLACE = re.compile(r"\s*(\w+)\.([^\s>]+?)\s*(?:->\s*(\w+)(?:\.(\S+))?\s*)?")


def location_of(value: object) -> FaultLocation:
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


def read_line(line: str) -> list[dict[str, Value]]:
    """Split the faults in one line, as written after a location, into their options as in a file.

    Raises:
        ValueError: an option is given twice.
    """
    items: list[dict[str, Value]] = []
    for text in () if line.strip() == NO_FAULTS else line.split(";"):
        head, *rest = re.split(rf"(?:^|\s+)({'|'.join(WORDS)})\s+", text.strip())
        kind, _, value = head.strip().partition(" ")
        item: dict[str, Value] = {"kind": kind}
        if value:
            item["value"] = yaml_lines.scalar(value.strip())
        for name, given in zip(rest[::2], rest[1::2], strict=True):
            if name in item:
                raise ValueError(f"has {name} twice")
            item[name] = yaml_lines.scalar(given.strip())
        items.append(item)
    return items


def parse_faults(location: FaultLocation, items: Sequence[Mapping[str, Value]], where: str) -> FaultList:
    """Return the faults of a location, each given by its options as in a file.

    Raises:
        ScenarioError: with all that is wrong with them; `where`: what messages name as their place.
    """
    document = yaml_lines.Document(Path(where))
    specs = []
    for item in items:
        document.data = {"on": str(location), **item}
        specs.append(validate(FaultSpec, document))
    if document.errors:
        raise ScenarioError([replace(one, location=Location(target=where)) for one in document.errors])
    return FaultList(spec.fault for spec in specs if spec is not None)


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


FaultLocationText = Annotated[FaultLocation, PlainValidator(location_of), PlainSerializer(str)]
KindName = Annotated[str, one_of(KINDS)]
FaultValue = Annotated[float | str, PlainValidator(_value)]
Share = Annotated[float, PlainValidator(_share)]


class FaultSpec(StrictModel):
    """A disturbance of a signal for some time."""

    on: FaultLocationText = Field(description="unit.output, unit.input or unit.output -> unit")
    kind: KindName = Field(description=f"What becomes of the signal: {listed(KINDS, last='or')}")
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
    def fault(self) -> Fault:
        """The fault, with all times in seconds."""
        return Fault(
            self.on, self.kind, self.value, self.share,
            every=None if self.every is None else float(self.every),
            seed=self.seed,
            begin=-math.inf if self.begin is None else float(self.begin),
            end=math.inf if self.end is None else float(self.end),
        )  # fmt: skip


def by_location(faults: Iterable[Fault]) -> dict[str, FaultList]:
    """Group faults by location."""
    found: dict[str, FaultList] = {}
    for fault in faults:
        found[str(fault.on)] = FaultList((*found.get(str(fault.on), ()), fault))
    return found
