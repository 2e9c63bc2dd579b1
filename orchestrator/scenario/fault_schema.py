"""The schema of faults, in files and in one line."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import ConfigDict, Field, PlainSerializer, PlainValidator, WithJsonSchema, model_validator

from yawbench.fmus.fmu import Value
from yawbench.foundation.errors import Location, ScenarioError
from yawbench.foundation.messages import listed, short

from ..fault_kinds import KINDS, NO_FAULTS, WORDS, Fault, FaultKind, FaultList, FaultLocation
from . import quantities, yaml_lines
from .schema_validation import Instant, OneOf, StrictModel, Time, in_unit, validate

_PLACE = re.compile(r"\s*(\w+)\.([^\s>]+?)\s*(?:->\s*(\w+)(?:\.(\S+))?\s*)?")


def location_of(value: object) -> FaultLocation:
    """Parse the location of a fault.

    Raises:
        ValueError: not a location.
    """
    parts = _PLACE.fullmatch(value) if isinstance(value, str) else None
    if parts is None or any((part or "").count("*") > 1 for part in parts.groups()):
        raise ValueError(
            "must be instance.output, instance.input or instance.output -> instance, with at most one * "
            f"(got {short(value)})"
        )
    return FaultLocation(parts[1], parts[2], parts[3] or "", parts[4] or "*")


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
        for name, option in zip(rest[::2], rest[1::2], strict=True):
            if name in item:
                raise ValueError(f"has {name} twice")
            item[name] = yaml_lines.scalar(option.strip())
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
        raise ScenarioError([replace(error, location=Location(target=where)) for error in document.errors])
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


FaultLocationText = Annotated[
    FaultLocation,
    PlainValidator(location_of),
    PlainSerializer(str),
    WithJsonSchema({"type": "string", "pattern": r"^\s*\w+\.[^\s>]+?\s*(->\s*\w+(\.\S+)?\s*)?$"}),
]
KindName = Annotated[str, OneOf(KINDS)]
FaultValue = Annotated[
    float | str,
    PlainValidator(_value),
    WithJsonSchema({"type": ["number", "string"], "minLength": 1}),
]
Share = Annotated[float, PlainValidator(_share), WithJsonSchema(in_unit("%", exclusiveMinimum=0, maximum=1))]


def _options_of(kind: FaultKind) -> tuple[list[str], list[str]]:
    """Return the keys that a kind of fault does not take, and those that it needs."""
    takes = {"value": kind.unit is not None, "share": kind.shared, "seed": kind.drawn, "every": kind.drawn}
    needs = {"share": kind.shared, "value": takes["value"] and kind.needs and kind.default is None}
    return [name for name, taken in takes.items() if not taken], [name for name, due in needs.items() if due]


def _rules_of_kinds() -> dict[str, Any]:
    """Return the JSON Schema of the keys that each kind of fault takes."""
    rules = []
    for name, kind in KINDS.items():
        barred, needed = _options_of(kind)
        then = {"properties": dict.fromkeys(barred, False), "required": needed}
        rules.append({"if": {"properties": {"kind": {"const": name}}}, "then": then})
    return {"allOf": rules}


class FaultSpec(StrictModel):
    """A disturbance of a signal for some time."""

    model_config = ConfigDict(json_schema_extra=_rules_of_kinds())

    on: FaultLocationText = Field(
        description="instance.output, instance.input or instance.output -> instance"
    )
    kind: KindName = Field(description=f"What becomes of the signal: {listed(KINDS, last='or')}")
    value: FaultValue | None = Field(None, description="In the unit of the kind, or with a unit")
    share: Share | None = Field(None, description="Of the messages, of dropout and outlier")
    every: Time | None = Field(None, description="Time between messages of random faults; default: 10 ms")
    seed: int | None = Field(None, ge=0, description="Of random numbers; default: 0")
    begin: Instant | None = Field(None, alias="from", description="s; default: the start of the run")
    end: Instant | None = Field(None, alias="until", description="s; default: the end of the run")

    @model_validator(mode="after")
    def _consistent(self) -> FaultSpec:
        kind = KINDS[self.kind]
        barred, needed = _options_of(kind)
        for name in barred:
            if getattr(self, name) is not None:
                why = ": nothing of it is random" if name in ("seed", "every") else ""
                raise ValueError(f"{self.kind} takes no {name}{why}")
        for name in needed:
            if getattr(self, name) is None:
                raise ValueError(f"{self.kind} needs a {name}: {kind.does}")
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
    lists: dict[str, FaultList] = {}
    for fault in faults:
        lists[str(fault.on)] = FaultList((*lists.get(str(fault.on), ()), fault))
    return lists
