"""Labels of runs in figures, tables and lists: the title with the overrides in words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from .plan import Override, Plan


def changed(changes: Iterable[Override]) -> str:
    """Return overrides in words, `controller_off for controller, inputs.friction* = 0.3`; "" for none."""
    return ", ".join(map(in_words, changes))


def in_words(change: Override) -> str:
    """Return an override in words."""
    value, target = change.value, change.target
    if change.faulty:
        return f"{change.faulty}: {value}"
    if change.swaps:
        return f"{fmu_of(change)} for {target}"
    if target.kind == "vehicle_file":
        return f"vehicle file {Path(str(value)).name}"
    if target.names_file:
        return f"{target} = {Path(str(value)).name}"
    text = str(value).lower() if isinstance(value, bool) else str(value)
    if isinstance(value, float):
        text = f"{value:.10g}"
    seconds = " s" if target.is_time and not isinstance(value, str) else ""
    return f"{target} = {text}{seconds}"


def faults_of(plan: Plan) -> str:
    """Return the faults of a plan in words."""
    return "; ".join(dict.fromkeys(f"{signal.fault.on}: {signal.fault}" for signal in plan.faults))


def with_changes(title: str, changes: Iterable[Override]) -> str:
    """Return a title in one line, followed by the overrides."""
    words = changed(changes)
    return f"{title} (changed: {words})" if words and title else f"changed: {words}" if words else title


def changes_of_all(every: Sequence[Sequence[Override]]) -> tuple[Override, ...]:
    """Return the overrides that all runs have in common."""
    first, *others = every or [()]
    return tuple(change for change in first if all(_among(change, changes) for changes in others))


def changed_each(labelled: Sequence[tuple[str, Sequence[Override]]]) -> str:
    """Return the overrides of several runs (label, overrides) in words: common ones first, then by label.

    A swap is left out where the label of the run names the FMU already.
    """
    common = changes_of_all([changes for _, changes in labelled])
    parts = [changed(common)]
    for label, changes in labelled:
        own = [change for change in changes if not _among(change, common) and not _in_label(change, label)]
        parts += [f"{label}: {changed(own)}"] if own else []
    return "; ".join(filter(None, parts))


def _in_label(change: Override, label: str) -> bool:
    return change.swaps and fmu_of(change) == label.rpartition("/")[2]


def fmu_of(swap: Override) -> str:
    """Return the name of the FMU that a swap inserts."""
    name = str(swap.value)
    return Path(name).stem if name.lower().endswith(".fmu") else name


def _among(change: Override, changes: Iterable[Override]) -> bool:
    return any((other.target, other.value) == (change.target, change.value) for other in changes)
