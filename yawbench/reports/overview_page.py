"""The overview of several experiments: papers by verdicts on one screen, below it each claim in words.

A click on a claim loads its runs from a side file.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup

from yawbench.foundation.messages import counted
from yawbench.metrics.verdict import Status, VerdictText

from .page_parts import SIGNS, Page, render
from .study_page import VIEW, StudyPage, in_sentence
from .viewer import DATA, assets, embedded, tidy_sides, write_side

OVERVIEW = "Yaw-stability control: what papers say, and what comes out"
"""Title of the overview."""


@dataclass(frozen=True, kw_only=True)
class OverviewPage(Page):
    """The page on several experiments."""

    template = "overview.html.j2"
    chapters: Sequence[tuple[StudyPage, str]]  # the experiments, each with the address of its page
    verdicts: Sequence[VerdictText]  # of claims, good ones first: a column of the table each
    checks: Sequence[str]  # how many of each experiment's checks hold
    answer: str  # how many claims hold, in a sentence
    ranking: str  # address of the ranking's page; "": there is none
    folder: str  # of the side files
    first: str  # key of the side file that is shown first
    frame: Markup  # the viewer for their runs


def _answer_of_all(chapters: Sequence[StudyPage]) -> str:
    """Return in a sentence how many claims of all studies hold; "" without claims."""
    counts: Counter[str] = Counter()
    for study in chapters:
        counts.update(study.counts)
    if not counts:
        return ""
    with_claims = [study for study in chapters if study.counts]
    alone = sum(not study.region for study in with_claims)
    where = f", {'all' if alone == len(with_claims) else f'{alone} of the studies'} at the chosen point only"
    return (
        f"Of {sum(counts.values())} claims in {counted(len(with_claims), 'study', 'studies')}, "
        f"{in_sentence(counts)}{where if alone else ''}."
    )


def _verdicts_of_all(chapters: Sequence[StudyPage]) -> list[VerdictText]:
    """Return the verdicts of claims of all studies, each once, in the order of their signs."""
    found = dict.fromkeys(row.verdict for study in chapters for row in study.claims)
    return sorted(found, key=lambda words: [*SIGNS].index(words.status))


def held(verdicts: Iterable[VerdictText]) -> str:
    """Return how many checks hold of those that are judged, and how many are not; "" without checks."""
    counts = Counter(words.status for words in verdicts)
    missing = counts.pop(Status.NOT_JUDGED, 0)
    parts = [f"{counts[Status.PASSED]} of {counts.total()}"] if counts else []
    return ", ".join([*parts, *([f"{missing} not judged"] if missing else [])])


def overview_page(
    chapters: Sequence[StudyPage], pages: Sequence[str], folder: Path, ranking: str = ""
) -> str:
    """Return the page on several experiments; write side files with their runs.

    Args:
        chapters: the experiments.
        pages: their addresses.
        folder: of the overview.
        ranking: address of the ranking's page; "": there is none.
    """
    shown = {study.id: study.content for study in chapters if study.content}
    for key, content in shown.items():
        write_side(folder, key, content)
    tidy_sides(folder, shown.keys())
    view = OverviewPage(
        title=OVERVIEW, chapters=[*zip(chapters, pages, strict=True)], ranking=ranking,
        verdicts=_verdicts_of_all(chapters), answer=_answer_of_all(chapters),
        checks=[held(row.verdict for row in study.checks) for study in chapters],
        folder=DATA, first=next(iter(shown), ""), frame=embedded(None, VIEW),
        assets=assets("chooser.js"),
    )  # fmt: skip
    return render(view)
