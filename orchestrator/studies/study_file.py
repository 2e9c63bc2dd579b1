"""Reading a study file: `for` expanded, every name resolved, every problem reported in one go."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from ..errors import ScenarioError
from ..files import reads
from ..plan import Change
from ..scenario import overrides, yaml_lines
from ..scenario.strict import validate
from ..scenario.yaml_lines import Document, Key
from ..wording import hint, listed, short
from .grids import cells
from .jobs import Job
from .study_schema import OPERATORS, Claim, Reference, RunSpec, StudySpec

FIGURES = "figures"
"""Folder of the figures, beside those of the runs."""
MOST = 10_000
"""Runs of a study. Chosen: a hundred times the largest of ours; all stand in one report."""
LONGEST = 100
"""Characters of a run's folder. Chosen: more do not fit into file names where a letter takes two bytes."""
_FOLDER = re.compile(rf"[\w.+-]{{1,{LONGEST}}}")


@dataclass(frozen=True)
class StudyRun:
    """One run of a study."""

    name: str
    label: str
    row: str
    scenario: Path
    changes: tuple[Change, ...]

    def job(self, out: Path, fmus: Path | None) -> Job:
        """Return the job that makes this run with its results below `out`."""
        return Job(self.name, self.scenario, out / self.name, self.changes, fmus)


@dataclass(frozen=True)
class Study:
    """A study file that is right in itself."""

    path: Path
    spec: StudySpec
    runs: dict[str, StudyRun]

    def matching(self, patterns: Sequence[str]) -> list[StudyRun]:
        """Return the runs that any of the patterns names, in the order of the patterns."""
        names = [name for pattern in patterns for name in self.runs if fnmatchcase(name, pattern)]
        return [self.runs[name] for name in dict.fromkeys(names)]


@reads("study file", ScenarioError)
def load_study(path: Path | str) -> Study:
    """Read a study file.

    Raises:
        ScenarioError: with everything that is wrong with it.
    """
    document = yaml_lines.read(Path(path), what="study file")
    spec = validate(StudySpec, document)
    if spec is None or document.problems:
        raise ScenarioError(document.sentences())
    runs: dict[str, StudyRun] = {}
    for i, entry in enumerate(spec.runs):
        for run in _expanded(document, ("runs", i), entry):
            if len(runs) == MOST:
                document.report(("runs",), f"more than {MOST} runs; no more are taken")
                raise ScenarioError(document.sentences())
            if run.name in runs:
                document.report(("runs", i, "name"), f"there is already a run {run.name!r}")
            runs[run.name] = run
    study = Study(Path(path), spec, runs)
    if not document.problems:
        _check_names(study, document)
    if document.problems:
        raise ScenarioError(document.sentences())
    return study


def _expanded(document: Document, key: Key, entry: RunSpec) -> Iterator[StudyRun]:
    """Return the runs that an entry stands for, none if it is wrong."""
    known = len(document.problems)
    number = math.prod(map(len, entry.for_each.values()))
    if number > MOST:
        document.report((*key, "for"), f"stands for {number} runs; at most {MOST} are taken")
        return
    for combination in itertools.product(*(choices.items() for choices in entry.for_each.values())):
        values = dict(zip(entry.for_each, (value for value, _ in combination), strict=True))
        wording = dict(zip(entry.for_each, (said for _, said in combination), strict=True))

        def fill(text: str, *where: str, use: dict[str, str] = values) -> str:
            for word in re.findall(r"\{([^{}]*)\}", text):
                if word not in use:
                    sentence = f"{{{word}}} stands for nothing" + hint(word, use, lead="'for' has")
                    document.report((*key, *where), sentence)
            return re.sub(r"\{(\w+)\}", lambda match: use.get(match[1], match[0]), text)

        name = fill(entry.name, "name")
        parts = name.split("/")
        if not all(_FOLDER.fullmatch(part) and part.strip(".") for part in parts) or parts[0] == FIGURES:
            sentence = f"{short(name)} cannot name a run: use letters, digits, . _ + - and / between folders"
            if any(len(part) > LONGEST for part in parts):
                sentence = f"{short(name)} is too long: at most {LONGEST} characters between two /"
            document.report((*key, "name"), sentence)
        folder = document.path.parent
        swaps = {unit: fill(fmu, "swap", unit) for unit, fmu in entry.swap.items()}
        settings = {
            place: yaml_lines.scalar(fill(value, "set", place)) if isinstance(value, str) else value
            for place, value in entry.set.items()
        }
        changes = overrides.changes_of_run(entry, "study")
        changes += overrides.changes_of(swaps, settings, folder, "study")
        label = fill(entry.label, "label", use=wording) or name
        row = fill(entry.row, "row", use=wording) or label
        scenario = folder / fill(entry.scenario, "scenario")
        if len(document.problems) > known:
            return
        yield StudyRun(name, label, row, scenario, tuple(changes))


def _check_names(study: Study, document: Document) -> None:
    """Report every name of a run or metric that does not exist, and every ambiguous condition."""
    spec = study.spec
    patterns = {"tables": [t.runs for t in spec.tables], "figures": [f.runs for f in spec.figures]}
    for group, lists in patterns.items():
        for i, several in enumerate(lists):
            for k, pattern in enumerate(several):
                if not study.matching([pattern]):
                    sentence = f"no run is named {pattern!r}" + hint(pattern, study.runs, lead="runs")
                    document.report((group, i, "runs", k), sentence)
    for i, table in enumerate(spec.tables):
        for k, name in enumerate(table.metrics):
            _check_metric(spec, document, ("tables", i, "metrics", k), name)
    for name, grid in spec.grids.items():
        _check_metric(spec, document, ("grids", name, "metric"), grid.metric)
        for run in dict.fromkeys(cell.run for cell in cells(grid) if cell.run not in study.runs):
            sentence = f"there is no run {run!r}" + hint(run, study.runs, lead="runs")
            document.report(("grids", name), sentence)
    _check_derived(study, document)
    figures = [figure.name for figure in spec.figures]
    for i, name in enumerate(figures):
        if name in figures[:i]:
            document.report(("figures", i, "name"), f"there is already a figure {name!r}")
    for group, claims in (("claims", spec.claims), ("checks", spec.checks)):
        for i, claim in enumerate(claims):
            _check_conditions(study, document, (group, i, "holds_if"), claim)


def _check_derived(study: Study, document: Document) -> None:
    spec = study.spec
    for name, number in spec.derived.items():
        for word, source in number.of.items():
            place: Key = ("derived", name, "of", word)
            if source.run not in study.runs:
                sentence = f"there is no run {source.run!r}" + hint(source.run, study.runs, lead="runs")
                document.report((*place, "run"), sentence)
            _check_metric(spec, document, (*place, "metric"), source.metric)
        grid = number.rank_correlation
        if grid is not None and grid not in spec.grids:
            sentence = f"there is no grid {grid!r}" + hint(grid, spec.grids, lead="grids")
            document.report(("derived", name, "rank_correlation"), sentence)
        elif grid is not None and all(cell.published is None for cell in cells(spec.grids[grid])):
            sentence = f"grid {grid!r} has no published numbers to compare with"
            document.report(("derived", name, "rank_correlation"), sentence)


def _check_metric(spec: StudySpec, document: Document, key: Key, name: str) -> None:
    if name not in spec.metrics:
        sentence = f"there is no metric {name!r}" + hint(name, spec.metrics, lead="metrics")
        document.report(key, sentence)


def _check_conditions(study: Study, document: Document, key: Key, claim: Claim) -> None:
    for i, condition in enumerate(claim.holds_if):
        given = [name for name in OPERATORS if getattr(condition, name) is not None]
        if len(given) != 1:
            document.report((*key, i), f"needs exactly one of {listed(OPERATORS, last='or')}")
            continue
        places = []
        if bool(condition.derived) == bool(condition.run or condition.metric):
            document.report((*key, i), "needs run and metric, or derived in place of both")
            continue
        if condition.derived and condition.derived not in study.spec.derived:
            sentence = f"there is no derived number {condition.derived!r}"
            guess = hint(condition.derived, study.spec.derived, lead="there are")
            document.report((*key, i, "derived"), sentence + guess)
        if not condition.derived:
            exists = bool(study.matching([condition.run]))
            places.append(((*key, i), condition.run, condition.metric, exists))
        if isinstance(condition.bound, Reference):
            bound = condition.bound
            places.append(((*key, i, given[0]), bound.run, bound.metric, bound.run in study.runs))
        for place, run, name, exists in places:
            if not exists:
                sentence = f"there is no run {run!r}" + hint(run, study.runs, lead="runs")
                document.report((*place, "run"), sentence)
            _check_metric(study.spec, document, (*place, "metric"), name)
