"""What a run is called wherever it is drawn, printed or listed: its title with all that was changed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from .plan import Override, Plan

OF_TIME = ("start_time", "stop_time", "step_size")
"""Changes of the run that are times."""


def changed(changes: Iterable[Override]) -> str:
    """Return changes in words, `controller_off for controller, inputs.friction* = 0.3`; "" for none."""
    return ", ".join(map(in_words, changes))


def in_words(change: Override) -> str:
    """Return a change in words."""
    value = change.value
    if change.faulty:
        return f"{change.faulty}: {value}"
    if change.swaps:
        return f"{fmu_of(change)} for {change.place}"
    if change.place == "vehicle":
        return f"vehicle file {Path(str(value)).name}"
    if change.names_file:
        return f"{change.place} = {Path(str(value)).name}"
    text = str(value).lower() if isinstance(value, bool) else str(value)
    if isinstance(value, float):
        text = f"{value:.10g}"
    is_time = change.place in OF_TIME or change.place.endswith(".step_size")
    seconds = " s" if is_time and not isinstance(value, str) else ""
    return f"{change.place} = {text}{seconds}"


def faults_of(plan: Plan) -> str:
    """Return the faults of a plan in words."""
    return "; ".join(dict.fromkeys(f"{one.place}: {one.says}" for one in plan.faults))


def with_changes(title: str, changes: Iterable[Override]) -> str:
    """Return a title in one line with what was changed behind it."""
    words = changed(changes)
    return f"{title} (changed: {words})" if words and title else f"changed: {words}" if words else title


def changes_in(run: Mapping[str, Any]) -> tuple[Override, ...]:
    """Return what was changed for a run, by its record."""
    given = run.get("changes")
    return tuple(
        Override(str(one["place"]), one.get("value", ""), str(one.get("origin", "")))
        for one in (given if isinstance(given, list) else ())
        if isinstance(one, dict) and "place" in one
    )


def changes_of_all(every: Sequence[Sequence[Override]]) -> tuple[Override, ...]:
    """Return what was changed alike for all runs."""
    first, *others = every or [()]
    return tuple(one for one in first if all(_among(one, changes) for changes in others))


def changed_each(labelled: Sequence[tuple[str, Sequence[Override]]]) -> str:
    """Return what was changed for several runs (label, changes): for all, then for each by its label.

    A swap is not said again of a run that is called by its FMU.
    """
    common = changes_of_all([changes for _, changes in labelled])
    parts = [changed(common)]
    for label, changes in labelled:
        own = [one for one in changes if not _among(one, common) and not _is_said(one, label)]
        parts += [f"{label}: {changed(own)}"] if own else []
    return "; ".join(filter(None, parts))


def _is_said(change: Override, label: str) -> bool:
    return change.swaps and fmu_of(change) == label.rpartition("/")[2]


def fmu_of(swap: Override) -> str:
    """Return the name of the FMU that a swap puts in."""
    name = str(swap.value)
    return Path(name).stem if name.lower().endswith(".fmu") else name


def _among(change: Override, changes: Iterable[Override]) -> bool:
    return any((one.place, one.value) == (change.place, change.value) for one in changes)
