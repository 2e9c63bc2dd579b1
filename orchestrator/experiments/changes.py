"""What parts of an experiment's file change in the runs' scenarios."""

from __future__ import annotations

from pathlib import Path

from ..plan import FAULTS, Change, Value
from ..scenario import overrides, yaml_lines
from ..scenario.fault_schema import by_place
from .axis_schema import AxisSpec, Changes
from .design import Level
from .numbers import text_of


def changes_at(axis: AxisSpec, level: Level, folder: Path, origin: str = "sweep") -> list[Change]:
    """Return what a level of an axis changes, of a file in a folder."""
    if axis.kind == "file":
        return [Change(axis.vary[0], str(folder / str(level.value)), origin)]
    if axis.kind == "variant":
        return changes_of_file(axis.variants[str(level.value)], folder, origin)
    if axis.kind == "fmu":
        return overrides.changes_of({axis.vary[0]: str(level.value)}, {}, folder, origin)
    return [overrides.setting(place, _given(axis, level), origin) for place in axis.vary]


def _given(axis: AxisSpec, level: Level) -> Value:
    """Return a level with the unit that the axis counts in."""
    if axis.unit:
        return f"{text_of(level.value)} {axis.unit}"
    return yaml_lines.scalar(level.value) if isinstance(level.value, str) else level.value


def changes_of_file(given: Changes, folder: Path, origin: str) -> list[Change]:
    """Return the changes that a part of a file in a folder gives."""
    vehicle = [Change("vehicle", str(folder / given.vehicle), origin)] if given.vehicle else []
    of_run = overrides.changes_of_run(given, origin)
    faults = [Change(f"{FAULTS}.{place}", ones, origin) for place, ones in by_place(given.faults).items()]
    return vehicle + of_run + overrides.changes_of(given.swap, given.set, folder, origin) + faults
