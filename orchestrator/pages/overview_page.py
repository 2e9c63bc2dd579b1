"""The overview page of several experiments: the verdicts of all, each with a link to its page.

A click on a claim loads its runs from a side file.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..messages import counted
from .page_parts import render
from .study_page import VIEW, in_sentence
from .viewer import DATA, assets, embedded, tidy_sides, write_side

TITLE = "Yaw-stability control: what papers say, and what comes out"


def _answer(chapters: Sequence[dict[str, Any]]) -> str:
    """Return in a sentence how many claims of all studies hold; "" without claims."""
    counts: Counter[str] = Counter()
    for facts in chapters:
        counts.update(facts["counts"])
    if not counts:
        return ""
    judged = [facts for facts in chapters if facts["counts"]]
    alone = sum(not facts["region"] for facts in judged)
    where = f", {'all' if alone == len(judged) else f'{alone} of the studies'} at the chosen point only"
    return (
        f"Of {sum(counts.values())} claims in {counted(len(judged), 'study', 'studies')}, "
        f"{in_sentence(counts)}{where if alone else ''}."
    )


def overview_page(
    chapters: Sequence[dict[str, Any]], pages: Sequence[str], folder: Path, ranking: str = ""
) -> str:
    """Return the page on several experiments; write side files with their runs.

    Args:
        chapters: of the experiments.
        pages: their addresses.
        folder: of the overview.
        ranking: address of the ranking's page; "": there is none.
    """
    shown = {facts["id"]: facts["content"] for facts in chapters if facts["content"]}
    for key, content in shown.items():
        write_side(folder, key, content)
    tidy_sides(folder, shown.keys())
    return render(
        "overview.html.j2", title=TITLE, chapters=[*zip(chapters, pages, strict=True)], ranking=ranking,
        answer=_answer(chapters), folder=DATA, first=next(iter(shown), ""), frame=embedded(None, VIEW),
        assets=assets("chooser.js"),
    )  # fmt: skip
