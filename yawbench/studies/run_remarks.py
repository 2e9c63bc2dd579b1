"""Remarks on runs in tables: marks of plausibility warnings, and below why cars were lost."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from yawbench.events.kinds import events_in
from yawbench.events.why import lost_among
from yawbench.foundation.errors import text_of
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import EventRecord

from .tables import MARK


def marked(label: str, results: Results) -> str:
    """Return the label of a run, with a mark if it has plausibility warnings."""
    return f"{label} {MARK}" if _remarkable(results) else label


def remarks(runs: Iterable[tuple[str, Results]]) -> list[str]:
    """Return a note for each marked run of (label, results), and why a car was lost."""
    shown = [*runs]
    notes = [f"{MARK} {label}: {says}" for label, results in shown if (says := _remarkable(results))]
    return [*notes, *lost_notes([(label, events_in(results)) for label, results in shown])]


def lost_notes(
    runs: Sequence[tuple[str, Sequence[EventRecord]]], most: int | None = None, *, comparable: bool = True
) -> list[str]:
    """Return why cars were lost, of runs as (label, events); `comparable`: see `lost_among`.

    Of more than `most`, the first have notes, and a last note says how many more there are.
    """
    found = lost_among([events for _, events in runs], comparable=comparable)
    notes = [
        f"{runs[number][0]}: lost because {'; '.join(map(str, reasons))}" for number, reasons, _ in found
    ]
    if most is None or len(notes) <= most:
        return notes
    return [*notes[:most], f"{len(notes) - most} more runs were lost; the page says why"]


def _remarkable(results: Results) -> str:
    return text_of(results.record.course_warnings)
