"""Reading an experiment file: runs and axes expanded into cases, every problem reported in one go."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path

from ..errors import ScenarioError
from ..files import reads
from ..plan import Change
from ..scenario import overrides, yaml_lines
from ..scenario.strict import validate
from .changes import changes_at, changes_of_file
from .design import Point, points
from .expansion import MOST, NamedRun, expanded, named_runs
from .names_check import check_axes, check_names
from .schema import ExperimentSpec

RUNS = "runs"
"""Folder of what runs along axes keep, beside those of named runs."""
FEW = 3
"""Repeats in haste. Chosen: fewer say nothing of chance."""


@dataclass(frozen=True)
class Case:
    """A named run at a point of the axes."""

    number: int  # from 0, in the order of the design
    run: NamedRun
    point: Point
    changes: tuple[Change, ...]

    @property
    def label(self) -> str:
        """What messages call it."""
        return ", ".join([*filter(None, [self.run.name]), *(level.words for level in self.point)])


@dataclass(frozen=True)
class Experiment:
    """An experiment that is right in itself."""

    path: Path
    spec: ExperimentSpec
    runs: dict[str, NamedRun]
    for_all: tuple[Change, ...] = ()  # by the file's own `swap`, `set`, ...
    by_options: tuple[Change, ...] = ()  # in all runs against the file

    @property
    def changed(self) -> tuple[Change, ...]:
        """What is changed in all runs."""
        return (*self.for_all, *self.by_options)

    @property
    def identity(self) -> str:
        """What tells experiments apart: the name of the file and of its folder."""
        return f"{self.path.absolute().parent.name}/{self.path.name}"

    @cached_property
    def points(self) -> list[Point]:
        """All points of the axes; without axes one, of no levels."""
        return points(self.spec)

    @cached_property
    def cases(self) -> list[Case]:
        """All runs at all points, one run after the other."""
        pairs = itertools.product(self.runs.values(), self.points)
        return [
            Case(number, run, point, (*self.for_all, *run.changes, *self.by_options, *self._at(point, run)))
            for number, (run, point) in enumerate(pairs)
        ]

    def setting(self, point: Point) -> Point:
        """Return a point without the axes that make repeats of one and the same."""
        pairs = zip(self.spec.axes.values(), point, strict=True)
        return tuple(level for axis, level in pairs if not axis.repeats)

    @cached_property
    def settings(self) -> list[Point]:
        """All points without the axes that make repeats of one and the same, each once."""
        return list(dict.fromkeys(map(self.setting, self.points)))

    @property
    def short(self) -> Experiment:
        """The same with the first few of its repeats."""
        axes = {
            name: axis.model_copy(update={"values": dict(itertools.islice((axis.values or {}).items(), FEW))})
            if axis.repeats
            else axis
            for name, axis in self.spec.axes.items()
        }
        return replace(self, spec=self.spec.model_copy(update={"axes": axes}))

    @cached_property
    def first_cases(self) -> list[Case]:
        """All runs at all settings: of repeats the first."""
        found: dict[tuple[str, Point], Case] = {}
        for case in self.cases:
            found.setdefault((case.run.name, self.setting(case.point)), case)
        return list(found.values())

    def matching(self, patterns: Sequence[str]) -> list[NamedRun]:
        """Return the runs that any of the patterns names, in the order of the patterns."""
        names = [name for pattern in patterns for name in self.runs if fnmatchcase(name, pattern)]
        return [self.runs[name] for name in dict.fromkeys(names)]

    def axis_of(self, place: str) -> tuple[str, str] | None:
        """Return the axis and its place that a problem is about, by the change that it names; None: none."""
        changes = itertools.chain.from_iterable(map(self._at, self.points))
        change = next((one for one in changes if str(one) == place), None)
        axes = self.spec.axes.items()
        return next(((n, change.place) for n, axis in axes if change and change.place in axis.places), None)

    def _at(self, point: Point, run: NamedRun | None = None) -> list[Change]:
        """Return what a point changes, in a run if one is given."""
        pairs = [
            (axis, level)
            for axis, level in zip(self.spec.axes.values(), point, strict=True)
            if run is None or any(fnmatchcase(run.name, pattern) for pattern in axis.runs)
        ]
        return [change for axis, level in pairs for change in changes_at(axis, level, self.path.parent)]


@reads("experiment file", ScenarioError)
def load_experiment(path: Path | str, *, changes: Sequence[Change] = ()) -> Experiment:
    """Read a study or a sweep.

    Args:
        path: of the file.
        changes: for all runs; the path of an FMU is relative to the working directory.

    Raises:
        ScenarioError: with everything that is wrong with it.
    """
    path = Path(path)
    document = yaml_lines.read(path, what="experiment file")
    overrides.apply_to_all_runs(document, changes)
    spec = validate(ExperimentSpec, document)
    if spec is None or document.problems:
        raise ScenarioError(document.sentences())
    spec = expanded(spec, document)
    runs = {"": NamedRun("", "", "", path.parent / spec.scenario, ())} if spec.scenario else {}
    for i, entry in enumerate(spec.runs):
        for run in named_runs(document, i, entry):
            if len(runs) == MOST:
                document.report(("runs",), f"more than {MOST} runs; no more are taken")
                raise ScenarioError(document.sentences())
            if run.name in runs:
                document.report(("runs", i, "name"), f"there is already a run {run.name!r}")
            runs[run.name] = run
    given = {change.place: change for change in changes}
    own = changes_of_file(spec, path.parent, "sweep" if spec.axes else "study")
    for_all = tuple(one for one in own if one.place not in given)
    experiment = Experiment(path, spec, runs, for_all, tuple(given.values()))
    if not document.problems:
        check_axes(spec, document)
        check_names(experiment, document)
    if document.problems:
        raise ScenarioError(document.sentences())
    return experiment
