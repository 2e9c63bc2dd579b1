"""Pages with numbers of studies, most on papers: templates in `pages/`, numbers in `docs/papers.json`.

A template is the page in Markdown, with each number as an expression (Jinja): `A["25mps/fnn"].error` is a
metric of a run, `A.derived.grip_15` a number derived from several, `A.claim("on its path.")` a claim with its
verdict. Filters say how a number is shown. So the words of a page are written freely, and none of its numbers
is typed in.

`tests/scenarios/test_verdicts.py` makes all runs and compares; with `YAWBENCH_RECORD=1` in the environment it
writes the numbers anew, and `python -m docs.generate` the pages.
"""

from __future__ import annotations

import fnmatch
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

from yawbench.components.cars.published_cars import PaperA
from yawbench.metrics.verdict import Status, worded
from yawbench.studies.axes import VariantSpec, levels_of
from yawbench.studies.confidence import TAIL, Bounds
from yawbench.studies.experiment import LoadedExperiment
from yawbench.studies.load_experiment import load_experiment
from yawbench.studies.open_value_schema import OpenValueSpec
from yawbench.studies.result_files import RECORD, VERDICTS
from yawbench.studies.result_tables import NO_FLIP, flip_words, share, share_words
from yawbench.vocabulary.gravity import G

from .esc_times import times_of
from .published import replaced, rows_in
from .ranking_pages import tuned_laws
from .templates import DOCS, reflowed, rendered, row, rule

SCENARIOS = DOCS.parent / "scenarios"
FILE = DOCS / "papers.json"
STUDIES = {
    "A": "fnn_sideslip/study",
    "B": "fuzzy_sliding_mode/study",
    "table_3": "fuzzy_sliding_mode/distribution",
    "C": "fuzzy_pid/study",
    "D": "fuzzy_feedback/study",
}
"""Name in templates -> study with a region, in the order of the report."""
OTHERS = {
    "laws": "fnn_sideslip/laws",
    "esc": "proving_ground/esc",
    **{
        name: f"{name}/study"
        for name in (
            "feedforward_pi", "super_twisting", "integral_sliding_mode", "internal_model", "lqg",
            "phase_plane", "steering_and_braking", "gain_scheduled", "envelope_mpc", "weighted_least_squares",
        )
    },
}  # fmt: skip
"""Studies without a region, likewise."""
DIGITS = 6
"""Significant digits of recorded numbers; chosen: pages show three."""
SEEDS = SCENARIOS / "fnn_sideslip" / "tuning_seeds.csv"
"""Least objective of paper A's four laws that searches with several seeds have found."""
MEASURED: Mapping[str, Callable[[Path], Mapping[str, Mapping[str, float]]]] = {"esc": times_of}
"""Study -> what is measured in the results of its runs, beside its metrics."""
KINDS = tuple(
    worded(status, "claims") for status in (Status.PASSED, Status.FAILED, Status.SENSITIVE, Status.UNDECIDED)
)
"""Verdicts in the order in which claims are listed."""


class Claim(NamedTuple):
    """A claim of a paper with its verdict, as it is recorded."""

    says: str
    verdict: str
    margin: float
    flips: int
    points: int
    low: float
    high: float
    without_result: int
    flips_by: str
    flips_at: str
    chosen: str

    @property
    def cells(self) -> tuple[str, str, str, str, str]:
        """The claim as a row of a table: claim, verdict, margin, region, nearest flip."""
        return self.says, self.verdict, share(self.margin), self.region, self.flip

    @property
    def region(self) -> str:
        """At how many points of the region the verdict flips: `4 of 112 flip, 1.1 to 9.7 %`."""
        return share_words(self.flips, self.points, Bounds(self.low, self.high), self.without_result)

    @property
    def flip(self) -> str:
        """The nearest flip."""
        return flip_words(self.flips_by, self.flips_at, self.chosen) if self.flips_by else NO_FLIP


@dataclass(frozen=True)
class Numbers:
    """What is recorded of a study.

    Attributes:
        runs: run -> metric -> value [SI].
        derived: numbers derived from several runs [SI].
        claims: of the paper, in the study's order.
        verdicts: of a study without a region: what a claim says -> its verdicts, one for each set of runs.
    """

    runs: Mapping[str, Mapping[str, float]]
    derived: Mapping[str, float]
    claims: tuple[Claim, ...]
    verdicts: Mapping[str, list[str]]

    def __getitem__(self, run: str) -> Mapping[str, float]:
        """Return the metrics of a run."""
        return self.runs[run]

    def claim(self, words: str) -> Claim:
        """Return the claim that has these words; it must be one."""
        (one,) = (claim for claim in self.claims if words in claim.says)
        return one

    def judged(self, words: str) -> list[str]:
        """Return the verdicts of the claim that has these words, in a study without a region."""
        (one,) = (verdicts for says, verdicts in self.verdicts.items() if words in says)
        return one

    def at_speed(self, words: str, speed: int) -> Claim:
        """Return the claim that begins with words and is about a speed [m/s]."""
        (one,) = (
            claim
            for claim in self.claims
            if claim.says.startswith(words) and claim.says.endswith(f"at {speed} m/s.")
        )
        return one

    def over(self, runs: str, metric: str) -> list[float]:
        """Return a metric of all runs of a pattern, in order."""
        return [self.runs[run][metric] for run in fnmatch.filter(self.runs, runs)]

    def having(self, verdict: str) -> list[Claim]:
        """Return the claims with a verdict."""
        return [claim for claim in self.claims if claim.verdict == verdict]

    def counts(self) -> list[int]:
        """Return how many claims have each of `KINDS`."""
        return [len(self.having(kind)) for kind in KINDS]


def recorded() -> dict[str, Numbers]:
    """Return name of a study -> its recorded numbers."""
    found = json.loads(FILE.read_text(encoding="utf-8"))
    return {
        name: Numbers(
            one["runs"],
            one["derived"],
            tuple(Claim(**claim) for claim in one["claims"]),
            one.get("verdicts", {}),
        )
        for name, one in found.items()
    }


def numbers_of(folder: Path, name: str = "") -> Numbers:
    """Return the numbers of a study from the results that it has left in a folder.

    Runs that were not made are left out.

    Args:
        folder: the results.
        name: of the study in templates, for what is measured beside its metrics.
    """
    found = json.loads((folder / RECORD).read_text(encoding="utf-8"))
    claims = list[Claim]()
    if (folder / VERDICTS).is_file():
        rows = rows_in(folder / VERDICTS)
        claims = [_claim(row) for row in rows if row["group"] == "claims" and row["points"]]
    runs = {
        run: {key: _rounded(one["value"]) for key, one in of["metrics"].items() if one["value"] is not None}
        for run, of in found["runs"].items()
        if of["metrics"]
    }
    for run, measured in MEASURED[name](folder).items() if name in MEASURED else ():
        runs[run] |= {key: _rounded(value) for key, value in measured.items()}
    verdicts: dict[str, list[str]] = {}
    for one in found["claims"] if not claims else ():
        verdicts.setdefault(one["says"], []).append(one["verdict"])
    derived = {
        key: _rounded(one["value"]) for key, one in found["derived"].items() if one["value"] is not None
    }
    return Numbers(runs, derived, tuple(claims), verdicts)


def _claim(row: Mapping[str, str]) -> Claim:
    margin, low, high = (
        _rounded(float(row[column])) for column in ("margin [1]", "share from [1]", "share to [1]")
    )
    return Claim(
        row["says"], row["verdict"], margin, int(row["flips"]), int(row["points"]), low, high,
        int(row["without result"]), row["flips by"], row["flips at"], row["chosen"],
    )  # fmt: skip


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def record(name: str, numbers: Numbers) -> None:
    """Write the numbers of a study into the record, the others as they are."""
    found = json.loads(FILE.read_text(encoding="utf-8")) if FILE.is_file() else {}
    claims = [claim._asdict() for claim in numbers.claims]
    found[name] = {
        "runs": numbers.runs, "derived": numbers.derived, "claims": claims, "verdicts": numbers.verdicts
    }  # fmt: skip
    parts = []
    for study in (*STUDIES, *OTHERS):
        if study not in found:
            continue
        one = found[study]
        runs = ",\n".join(f"   {json.dumps(run)}: {json.dumps(of)}" for run, of in one["runs"].items())
        told = ",\n".join(f"   {json.dumps(claim, ensure_ascii=False)}" for claim in one["claims"])
        verdicts = json.dumps(one.get("verdicts", {}), ensure_ascii=False)
        parts.append(
            f' {json.dumps(study)}: {{\n  "runs": {{\n{runs}\n  }},\n'
            f'  "derived": {json.dumps(one["derived"])},\n  "claims": [\n{told}\n  ],\n'
            f'  "verdicts": {verdicts}\n }}'
        )
    FILE.write_text("{\n" + ",\n".join(parts) + "\n}\n", encoding="utf-8")


def found_by_seeds() -> dict[str, dict[str, list[float]]]:
    """Return tuning -> law -> least objective of each seed of the search."""
    found: dict[str, dict[str, list[float]]] = {}
    for seed in rows_in(SEEDS):
        found.setdefault(seed["tuning"], {}).setdefault(seed["law"], []).append(float(seed["objective"]))
    return found


def first_of(laws: Mapping[str, list[float]], law: str) -> int:
    """Return for how many seeds a law has the least objective."""
    return sum(min(found) == found[[*laws].index(law)] for found in zip(*laws.values(), strict=True))


@cache
def study_of(name: str) -> LoadedExperiment:
    """Return a study of the papers by its name in templates."""
    return load_experiment(SCENARIOS / f"{(STUDIES | OTHERS)[name]}.yaml")


def levels_words(name: str) -> str:
    """Return at how many levels open values are tried one at a time: `2 to 5 levels`."""
    region = study_of(name).spec.region
    assert region
    values: Iterable[OpenValueSpec | VariantSpec] = region.open_values.values()
    numbers = sorted({len(levels_of(one.stepped)) for one in values})
    return f"{numbers[0]} to {numbers[-1]} levels" if len(numbers) > 1 else f"{numbers[0]} levels"


def pages_with_numbers() -> dict[Path, str]:
    """Return the pages that have a template, and the sentences in others, written anew."""
    found = recorded()
    names = {
        **found, "studies": {name: found[name] for name in STUDIES}, "study_of": study_of, "kinds": KINDS,
        "levels_words": levels_words, "paths": STUDIES, "totals": totals(found), "tuned": tuned_laws(),
        "seeds": found_by_seeds(), "first_of": first_of, "tail": TAIL,
        "braking_distance": lambda speed, friction: speed**2 / (2.0 * friction * G),
        "lifts": G * PaperA.track_width / (2.0 * PaperA.cg_height),
    }  # fmt: skip
    pages = rendered("*.md.jinja", names)
    parts = [
        (DOCS / "theory" / page.name, "studies", text)
        for page, text in rendered("theory/*.md.jinja", names).items()
    ]
    for page, name, text in [*sentences(found), *parts]:
        pages[page] = replaced(
            pages.get(page) or page.read_text(encoding="utf-8"), name, reflowed(text).strip()
        )
    return pages


class Totals(NamedTuple):
    """How many claims of all papers have which verdict."""

    claims: int
    holds: int
    fails: int
    depends: int
    undecided: int

    @property
    def decided(self) -> int:
        """How many are not undecided."""
        return self.claims - self.undecided

    @property
    def wrong(self) -> float:
        """The expected number of wrong decisions, at most: each claim may be decided wrongly on one side."""
        return self.claims * TAIL


def totals(found: Mapping[str, Numbers]) -> Totals:
    """Return how many claims of all papers have which verdict."""
    counts = [sum(of) for of in zip(*(found[name].counts() for name in STUDIES), strict=True)]
    return Totals(sum(counts), *counts)


def verdicts_words(of: Totals, leave: str) -> str:
    """Return in words how many claims have which verdict."""
    return (
        f"{of.holds} {_verb(of.holds, 'holds', 'hold')} and {of.fails} "
        f"{_verb(of.fails, 'does not reproduce', 'do not reproduce')} over more than nine tenths of what the "
        f"{leave} open, {of.depends} {_verb(of.depends, 'depends', 'depend')} on it, {of.undecided} "
        f"{_verb(of.undecided, 'is', 'are')} undecided"
    )


def _verb(number: int, one: str, many: str) -> str:
    return one if number == 1 else many


PAPERS = {
    "a": (("A",), "sideslip, by a fuzzy neural network that learns online"),
    "b": (
        ("B", "table_3"),
        "yaw rate and sideslip, by fuzzy sliding mode; how the moment is shared among wheels",
    ),
    "c": (("C",), "yaw rate and sideslip, by PID and fuzzy PID, braking one wheel"),
    "d": (("D",), "yaw rate and sideslip, by two fuzzy systems"),
}
"""Letter of a paper -> its studies, what it controls and how."""


def sentences(found: Mapping[str, Numbers]) -> list[tuple[Path, str, str]]:
    """Return page, name and text of what pages without a template tell of verdicts."""
    every = totals(found)
    counted = {
        paper: [sum(of) for of in zip(*(found[name].counts() for name in names), strict=True)]
        for paper, (names, _) in PAPERS.items()
    }
    told = f"{every.claims} claims of four papers, {verdicts_words(every, 'papers leave')}"
    lines = [
        row(("paper", "controlled variable and method", "claims", *KINDS)),
        rule(3 + len(KINDS), 1 + len(KINDS)),
        *(
            row((f"[{paper.upper()}](theory/paper_{paper}.md)", PAPERS[paper][1], sum(counts), *counts))
            for paper, counts in counted.items()
        ),
    ]
    return [
        (
            DOCS.parent / "README.md",
            "verdicts",
            f"  Of {told}: [verdicts](docs/verdicts.md), [papers](docs/papers.md).",
        ),
        (
            DOCS / "index.md",
            "verdicts",
            "\n".join(lines) + f"\n\nOf {told}: [verdicts](verdicts.md), [papers](papers.md).",
        ),
        *(
            (
                DOCS / "theory" / f"paper_{paper}.md",
                "verdicts",
                f"**Result**: of {sum(counts)} claims {verdicts_words(Totals(0, *counts), 'paper leaves')} "
                "([verdicts](../verdicts.md), [in detail](../papers.md)).",
            )
            for paper, counts in counted.items()
        ),
    ]
