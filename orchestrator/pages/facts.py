"""What report and comparison pages share: figures, animations, FMUs and settings as facts for templates."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from itertools import compress

from markupsafe import Markup

from ..errors import ResultsError
from ..experiments.tables import Table
from ..figures.display import Run
from ..plan import Plan
from ..results.read import Results
from ..results.run_record import versions
from ..wording import listed
from .animation import MOST, fragment
from .animation_frames import frames_of
from .panel_images import LegendEntry, PanelImage, panel_images


@dataclass(frozen=True)
class Figure:
    """A figure as a page shows it, panel by panel."""

    id: str
    title: str
    panels: list[PanelImage]
    legend: list[LegendEntry]
    files: tuple[str, ...] = ()


def figure_of(
    wanted: tuple[str, str, Sequence[Run], Sequence[str], tuple[str, ...]], *, whole: bool = False
) -> Figure | None:
    """Return a figure of (id, title, runs, panels, files); None if the runs recorded nothing of it.

    `whole`: no run leaves the axes, however far it goes.
    """
    name, title, runs, panels, files = wanted
    images, legend = panel_images(runs, panels, whole=whole)
    return Figure(name, title, images, legend, files) if images else None


@dataclass(frozen=True)
class Animation:
    """Runs seen from above, and which runs of the figure are not among them."""

    title: str
    drawing: Markup
    left_out: str


def animation_of(runs: Sequence[Run], title: str) -> Animation | None:
    """Return the animation of as many runs as have colours; None if none recorded its position."""
    placed = [_is_placed(run) for run in runs]
    able = list(compress(runs, placed))
    if not able:
        return None
    unable = [run.label for run, known in zip(runs, placed, strict=True) if not known]
    shown, others = able[:MOST], [run.label for run in able[MOST:]]
    reasons = [f"{listed(unable)}: no position recorded"] if unable else []
    reasons += [f"{listed(others)}: an animation shows up to {MOST} runs"] if others else []
    return Animation(title, fragment(shown, title=listed(run.label for run in shown)), "; ".join(reasons))


def fmus_of(runs: Iterable[Results | Plan]) -> Table:
    """Return every FMU that took part in the runs, as their records or plans say."""
    found: dict[tuple[str, str], dict[str, None]] = {}
    for one in runs:
        for unit, name, sha256 in _fmus_in(one):
            found.setdefault((name, sha256), {})[unit] = None
    ordered = sorted(found.items(), key=lambda one: (min(one[1]), one[0][0]))
    rows = [(name, ", ".join(units), sha256) for (name, sha256), units in ordered]
    return Table("", ["FMU", "as", "SHA-256"], [*rows])


def _is_placed(run: Run) -> bool:
    """Return whether a run recorded where its car is."""
    try:
        frames_of(run.results)
    except ResultsError:
        return False
    return True


def _fmus_in(one: Results | Plan) -> Iterator[tuple[str, str, str]]:
    """Yield unit, FMU and its hash."""
    if isinstance(one, Plan):
        yield from ((unit.name, unit.fmu.name, unit.fmu.sha256) for unit in one.units)
    else:
        for unit, fmu in one.record.fmus.items():
            yield unit, fmu.name or unit, fmu.sha256


def programs_of(runs: Iterable[Results | Plan]) -> dict[str, str]:
    """Return the versions of the programs that made the runs, as their records say.

    Of a run without a record, known by its key in the journal, they are those of today: the key tells them.
    """
    found: dict[str, dict[str, None]] = {}
    for one in runs:
        known = versions() if isinstance(one, Plan) else one.record.versions
        for name, version in known.items():
            found.setdefault(name, {})[str(version)] = None
    return {name: " and ".join(several) for name, several in found.items()}


def made_by() -> dict[str, object]:
    """Return what the foot of every page says."""
    return {
        "versions": versions(),
        "made": f"{datetime.now(timezone.utc):%Y-%m-%d %H:%M} UTC",
    }


def anchor(text: str) -> str:
    """Return a text as the name of a place in a page."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")
