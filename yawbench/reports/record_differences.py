"""What differs between the records of two runs: scenario, instances, wires, versions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from yawbench.orchestrator.results.run_record import RunRecord
from yawbench.orchestrator.scenario.overrides import changed
from yawbench.studies.tables import Table

OF_RUN = ("status", "title", "algorithm", "step_size", "stop_time", "rows")
"""Entries of a record that have a row each."""


class RecordDifference(NamedTuple):
    """An entry that differs between two records; None where a record does not have it."""

    place: str
    first: Any
    second: Any


def differences(a: RunRecord, b: RunRecord) -> list[RecordDifference]:
    """Return the differences between the records of two runs: scenario, instances, wires, versions."""
    first, second = dict(_facts(a)), dict(_facts(b))
    exchanged = tuple(
        f"{instance}." for instance in _names(a) if _names(a)[instance] != _names(b).get(instance)
    )
    both = first.keys() & second.keys()
    return [
        RecordDifference(place, first.get(place), second.get(place))
        for place in dict.fromkeys([*first, *second])
        # different FMUs have different parameters: list only those that both have
        if first.get(place) != second.get(place) and (place in both or not place.startswith(exchanged))
    ]


def _names(record: RunRecord) -> dict[str, str]:
    return {instance: fmu.name for instance, fmu in record.fmus.items()}


def _facts(record: RunRecord) -> Iterator[tuple[str, Any]]:
    """Yield location and value of all entries of a record that are compared."""
    yield "scenario", record.scenario.get("file")
    yield "vehicle file", record.scenario.get("vehicle")
    yield "changed", changed(record.overrides) or None
    for key in OF_RUN:
        yield key, getattr(record, key) if key in record.model_fields_set else None
    for instance, fmu in record.fmus.items():
        yield instance, f"{fmu.name} ({fmu.sha256[:8]})"
        yield f"{instance}.step_size", fmu.step_size
        for values in (fmu.defaults, fmu.parameters, fmu.constants):
            for name, value in values.items():
                yield f"{instance}.{name}", value
    for wire in record.connections:
        yield f"{wire.source} -> {wire.target}", "connected"
    for fault in record.faults:
        yield f"fault of {fault.on}", fault.fault
    yield from record.versions.items()


def differences_table(changes: list[RecordDifference], first: str, second: str) -> Table:
    """Return the table of differences between two records; `first`, `second`: the names of the runs."""
    rows: list[Any] = [[place, _text(a), _text(b)] for place, a, b in changes]
    return Table("Inputs of the runs", ["", first, second], rows)


def _text(value: Any) -> str | None:
    if isinstance(value, bool) or not isinstance(value, float):
        return None if value is None else str(value)
    return f"{value:.10g}"
