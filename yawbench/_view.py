"""Interactive viewer of runs, in notebooks and as a page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from html import escape
from pathlib import Path

from yawbench.figures.display import LabelledRun
from yawbench.foundation.errors import ResultsError
from yawbench.foundation.messages import counted, listed
from yawbench.foundation.safe_files import reason, write_whole
from yawbench.orchestrator.scenario.overrides import changed
from yawbench.reports.viewer import Settings, check_panels, page
from yawbench.reports.viewer_views import views_of

from . import arguments
from ._run import Run

HEIGHT = 860
"""Default height of a viewer in a notebook [px]. Chosen: five panels with their table."""

LEAST, MOST = 100, 10_000
"""Limits of the height [px]. Chosen: a table of runs, and more than any screen."""


def view(
    runs: Run | Iterable[Run] | Mapping[str, Run],
    *panels: str,
    title: str = "",
    height: int = HEIGHT,
) -> View:
    """Return an interactive viewer of runs, shown by notebooks.

        >>> free = base.swap(controller="controller_off").run()
        >>> shown = yb.view({"no control": free, "network": base.run()})
        >>> shown
        <View of no control and network>
        >>> shown.save("compared.html").name
        'compared.html'

    Args:
        runs: a run, several, or a mapping of labels to runs; the first is the baseline.
        panels: signals shown at first, such as "yaw_rate" or "plant.sideslip - reference.sideslip_ref";
            default: those of the papers.
        title: title of the page; default: the labels.
        height: height in a notebook [px].

    Raises:
        ResultsError: there are no or too many runs.
        ScenarioError: no run has recorded a panel.
    """
    labelled = _labelled(runs)
    wanted = arguments.texts(panels, "panels")
    check_panels(labelled, wanted, option="panel ")
    settings = Settings([*views_of(wanted)])
    title = arguments.text(title, "title", empty=True)
    names = tuple(run.label for run in labelled)
    if (
        len(names) != 1 or names[0] != labelled[0].results.record.title
    ):  # a single run's own title is followed by its overrides
        title = title or listed(names, last="and")
    html = page(labelled, settings, title=title)
    return View(names, html, arguments.count(height, "height", least=LEAST, most=MOST))


def _labelled(runs: object) -> list[LabelledRun]:
    """Return runs with labels: those of a mapping, else their titles; of equal ones number and overrides."""
    if isinstance(runs, Run):
        runs = [runs]
    if isinstance(runs, Mapping):
        named = arguments.mapping(runs, "runs", "a mapping of labels to runs")
    else:
        several = arguments.items(runs, "runs", "a run, a list of runs, or a mapping of labels to runs")
        titles = [run.title if isinstance(run, Run) else "" for run in several]
        if len(set(titles)) < len(titles):
            changes = [run.changes if isinstance(run, Run) else () for run in several]
            shared = [change for change in changes[0] if all(change in made for made in changes)]
            own = [changed(change for change in made if change not in shared) for made in changes]
            titles = [f"{k + 1}: {own[k] or title}" for k, title in enumerate(titles)]
        elif len(titles) > 1:  # a page on one run tells below its title what was changed
            titles = [run._full_title if isinstance(run, Run) else "" for run in several]
        named = dict(zip(titles, several, strict=True))
    return [
        LabelledRun(label, arguments.instance(run, f"runs[{label!r}]", Run, "Scenario.run").results)
        for label, run in named.items()
    ]


@dataclass(frozen=True, repr=False)
class View:
    """Interactive viewer; created by `view`.

    >>> yb.view(run, "sideslip")
    <View of Sideslip tracking at 25 m/s, mu 0.65>

    Attributes:
        labels: labels of the runs.
        html: the complete page, which works offline.
        height: height in a notebook [px].
    """

    labels: tuple[str, ...]
    html: str
    height: int = HEIGHT

    def save(self, file: str | Path) -> Path:
        """Write the page and return its path.

        Raises:
            ResultsError: it cannot be written.
        """
        path = arguments.path(file, "file")
        try:
            write_whole(path, self.html, named=True)
        except OSError as error:
            raise ResultsError(f"{path}: cannot write the page: {reason(error)}") from None
        return path

    def __repr__(self) -> str:
        shown = listed(self.labels, last="and") if len(self.labels) <= 4 else counted(len(self.labels), "run")
        return f"<View of {shown}>"

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{escape(self.html)}" style="width: 100%; height: {self.height}px; border: 0" '
            f'title="Viewer of {escape(listed(self.labels, last="and"))}"></iframe>'
        )
