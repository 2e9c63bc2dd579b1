"""When runs were faulty, as spans behind the lines of panels over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from .display import Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FAULTY = "#F7DDC8"
"""The colour of a span; pale enough for all lines and the grid."""
SPAN: dict[str, Any] = {"color": FAULTY, "linewidth": 8.0, "linestyle": "-", "solid_capstyle": "butt"}
"""How a legend shows it."""
NAMED = 4
"""Faults that a legend names; of more it says how many there are. Chosen: a legend is no table."""


class Span(NamedTuple):
    """A fault of a run: from when until when [s], and what it is."""

    begin: float
    end: float
    says: str


def spans_of(runs: Sequence[Run]) -> list[Span]:
    """Return the faults of runs, each once; that not all have is said with the label."""
    found: dict[Span, list[str]] = {}
    for label, results in runs:
        for fault in results.record.faults if results.time.size else ():
            begin, end = fault.begin, fault.until
            first, last = results.time[0], results.time[-1]
            span = Span(
                float(first if begin is None else max(begin, first)),
                float(last if end is None else min(end, last)),
                fault.words,
            )
            if span.begin < span.end:
                found.setdefault(span, []).append(label)
    return [
        span if len(labels) == len(runs) else span._replace(says=f"{', '.join(labels)}: {span.says}")
        for span, labels in found.items()
    ]


def mark(axes: Axes, spans: Sequence[Span]) -> None:
    """Draw spans behind all lines of axes over time; the limits stay."""
    limits = axes.get_xlim()
    for begin, end in dict.fromkeys((span.begin, span.end) for span in spans):
        axes.axvspan(begin, end, facecolor=FAULTY, edgecolor="none", zorder=0)
    axes.set_xlim(limits)


def in_legend(spans: Sequence[Span]) -> list[str]:
    """Return what a legend says of spans, none if there are none."""
    if len(spans) > NAMED:
        return [f"{len(spans)} faults"]
    return [span.says for span in spans]
