"""Reach of the verdicts on the papers, as docs/verdicts.md states it.

The page is the record: a test makes all runs and compares; with `YAWBENCH_RECORD=1` in the environment it
writes the page anew. What the README tells of verdicts is held against the page, which takes no runs.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

from tests.checkout import ROOT
from yawbench.foundation.messages import listed
from yawbench.metrics.verdict import Status, worded
from yawbench.studies.axes import OpenValueSpec, OpenVariantSpec, levels_of
from yawbench.studies.confidence import TAIL, Bounds
from yawbench.studies.experiment import LoadedExperiment
from yawbench.studies.load_experiment import found_studies, load_experiment
from yawbench.studies.result_tables import (
    NO_FLIP,
    flip_words,
    share,
    share_words,
)

FILE = ROOT / "docs" / "verdicts.md"
HEAD = """# Every verdict, and how far it carries

All claims of the four papers, judged over the values that each of them leaves open. "Holds" and "does not
reproduce" are robust: with 95 % confidence less than 10 % of the region flips the verdict. If a claim
"depends on open values", more than 10 % does; if it is "undecided", 128 points do not tell. The confidence
is that of each claim, not of all together: {decided} of {all} are decided, and of so many decisions at most
{wrong} are expected to be wrong, as each errs to its side with a probability of {tail}.

The margin is how far a number is from the paper's bound at the values that we chose, in per cent of the
bound: positive where the claim is true there, "by far" beyond 100 %. Where two runs are compared, a
difference of less than 1 % counts as none, and the margin is what lies beyond. The region gives the number
of points that flip the verdict, and the 95 % interval of the share; the nearest flip is the one open value
that changes the verdict first, all others as chosen; a flip between two of the levels that were tried stays
unseen. [How far a verdict carries](regions.md) explains the
runs; the ranges of the open values, and the reason for each, are in the study files and in
`results/report.html`.

*A test makes all these runs and checks this page.*
"""
KINDS = tuple(
    worded(status, "claims") for status in (Status.PASSED, Status.FAILED, Status.SENSITIVE, Status.UNDECIDED)
)


class Row(NamedTuple):
    """A claim as a reader finds it."""

    says: str
    verdict: str
    margin: str
    region: str
    flip: str


@cache
def studies() -> dict[str, LoadedExperiment]:
    """Return all studies with a region, by title, in the order of the report."""
    found = map(load_experiment, found_studies(ROOT / "scenarios"))
    return {study.spec.title: study for study in found if study.spec.region}


def rows_of(file: Path) -> list[Row]:
    """Return the claims of a study from the `verdicts.csv` that it has left."""
    with file.open(encoding="utf-8") as text:
        return [_row(one) for one in csv.DictReader(text) if one["group"] == "claims"]


def _row(one: Mapping[str, str]) -> Row:
    return Row(
        one["says"],
        one["verdict"],
        share(float(one["margin [1]"])),
        share_words(
            int(one["flips"]),
            int(one["points"]),
            Bounds(float(one["share from [1]"]), float(one["share to [1]"])),
            int(one["without result"]),
        ),
        flip_words(one["flips by"], one["flips at"], one["chosen"]) if one["flips by"] else NO_FLIP,
    )


def table_in(text: str) -> list[list[str]]:
    """Return the cells of all rows of the Markdown tables in a text, without the rules below headings."""
    lines = [line.strip("|").split("|") for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line] for line in lines if not set(line[0].strip()) <= {"-", ":"}]


def recorded() -> dict[str, list[Row]]:
    """Return title of a study -> its claims, as the page tells them."""
    parts = re.split(r"^## ", FILE.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    return {part.partition("\n")[0]: [Row(*cells) for cells in table_in(part)[1:]] for part in parts}


def page(found: Mapping[str, list[Row]]) -> str:
    """Return the page."""
    rows_of_all = [row for rows in found.values() for row in rows]
    decided = sum(row.verdict in KINDS[:3] for row in rows_of_all)
    head = HEAD.format(
        decided=decided, all=len(rows_of_all), wrong=f"{decided * TAIL:.1f}", tail=f"{100 * TAIL:g} %"
    )
    parts = [head, _lines(("study", "claims", *KINDS), summary(found))]
    for title, rows in found.items():
        study = studies()[title]
        region, where = study.spec.region, study.path.relative_to(ROOT)
        assert region
        parts.append(
            f"## {title}\n\n`yawbench study {where}`; {region.points} to {region.most} points over "
            f"{listed(region.open_values, last='and')}; each alone at "
            f"{_levels(region.open_values.values())}.\n"
        )
        parts.append(_lines(("the paper says", "verdict", "margin", "region", "nearest flip"), rows))
    return "\n".join(parts)


def _levels(open_values: Iterable[OpenValueSpec | OpenVariantSpec]) -> str:
    """Return at how many levels open values are tried one at a time: `2 to 5 levels`."""
    numbers = sorted({len(levels_of(one.stepped)) for one in open_values})
    return f"{numbers[0]} to {numbers[-1]} levels" if len(numbers) > 1 else f"{numbers[0]} levels"


def summary(found: Mapping[str, list[Row]]) -> list[tuple[str, ...]]:
    """Return how many claims of each study have which verdict."""
    return [
        (
            title, str(len(rows)),
            *(str(sum(row.verdict == kind for row in rows)) for kind in KINDS),
        )
        for title, rows in found.items()
    ]  # fmt: skip


def _lines(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    head = [*head]
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
