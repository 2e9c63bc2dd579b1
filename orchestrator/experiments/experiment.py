"""Reading an experiment file: runs and axes expanded into cases, every problem reported in one go."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from ..errors import ScenarioError
from ..files import reads
from ..plan import FAULTS, Change, Value
from ..scenario import overrides, yaml_lines
from ..scenario.fault_schema import by_place
from ..scenario.strict import validate
from ..scenario.yaml_lines import Document, Key
from ..wording import hint, short
from .axis_schema import AxisSpec, Changes
from .design import Level, Point, levels_of, points
from .grids import cells
from .judged_schema import Claim, Condition, DerivedSpec, Reference
from .numbers import text_of
from .schema import ExperimentSpec, FigureSpec, RunSpec

FIGURES, RUNS = "figures", "runs"
"""Folders of the figures and of what runs along axes keep, beside those of named runs."""
SENTENCES = ("says", "short", "source", "note")
"""Fields of claims and derived numbers that are for people."""
T = TypeVar("T")
Texts = TypeVar("Texts", Claim, DerivedSpec)
RUN = "run"
"""What figures and tables along axes call the axis of named runs."""
COLUMNS = (RUN, "status", "reason", "findings", "key")
"""Columns of the table beside the axes and the metrics."""
FEW = 3
"""Repeats in haste. Chosen: fewer say nothing of chance."""
MOST = 10_000
"""Runs that are named. Chosen: a hundred times the largest of ours; all stand in one report."""
LONGEST = 100
"""Characters of a run's folder. Chosen: more do not fit into file names where a letter takes two bytes."""
_FOLDER = re.compile(rf"[\w.+-]{{1,{LONGEST}}}")


@dataclass(frozen=True)
class NamedRun:
    """One run of an experiment, wherever it stands on the axes."""

    name: str  # "" if there is only one
    label: str
    row: str
    scenario: Path
    changes: tuple[Change, ...]


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


def changes_at(axis: AxisSpec, level: Level, folder: Path, origin: str = "sweep") -> list[Change]:
    """Return what a level of an axis changes, of a file in a folder."""
    if axis.kind == "file":
        return [Change(axis.vary[0], str(folder / str(level.value)), origin)]
    if axis.kind == "variant":
        return changes_of_file(axis.variants[str(level.value)], folder, origin)
    if axis.kind == "fmu":
        return overrides.changes_of({axis.vary[0]: str(level.value)}, {}, folder, origin)
    return [overrides.setting(place, _given(axis, level), origin) for place in axis.vary]


def _given(axis: AxisSpec, level: Level) -> Value:
    """Return a level with the unit that the axis counts in."""
    if axis.unit:
        return f"{text_of(level.value)} {axis.unit}"
    return yaml_lines.scalar(level.value) if isinstance(level.value, str) else level.value


def changes_of_file(given: Changes, folder: Path, origin: str) -> list[Change]:
    """Return the changes that a part of a file in a folder gives."""
    vehicle = [Change("vehicle", str(folder / given.vehicle), origin)] if given.vehicle else []
    of_run = overrides.changes_of_run(given, origin)
    faults = [Change(f"{FAULTS}.{place}", ones, origin) for place, ones in by_place(given.faults).items()]
    return vehicle + of_run + overrides.changes_of(given.swap, given.set, folder, origin) + faults


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
    spec = _every(spec, document)
    runs = {"": NamedRun("", "", "", path.parent / spec.scenario, ())} if spec.scenario else {}
    for i, entry in enumerate(spec.runs):
        for run in _expanded(document, ("runs", i), entry):
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
        _check_axes(spec, document)
        _check_names(experiment, document)
    if document.problems:
        raise ScenarioError(document.sentences())
    return experiment


def _filled(document: Document, key: Key, text: str, use: Mapping[str, str]) -> str:
    """Return a text with what its words in braces stand for."""
    for word in re.findall(r"\{([^{}]*)\}", text):
        if word not in use:
            sentence = f"{{{word}}} stands for nothing" + hint(word, use, lead="'for' has")
            document.report(key, sentence)
    return re.sub(r"\{(\w+)\}", lambda match: use.get(match[1], match[0]), text)


def _combinations(
    document: Document, key: Key, for_each: Mapping[str, Mapping[str, T]], what: str
) -> Iterator[dict[str, tuple[str, T]]]:
    """Yield name -> value and what belongs to it, for every combination of a `for`; none of too many."""
    number = math.prod(map(len, for_each.values()))
    if number > MOST:
        document.report((*key, "for"), f"stands for {number} {what}; at most {MOST} are taken")
        return
    for combination in itertools.product(*(choices.items() for choices in for_each.values())):
        yield dict(zip(for_each, combination, strict=True))


def _every(spec: ExperimentSpec, document: Document) -> ExperimentSpec:
    """Return the file with one claim, check or derived number for each that an entry stands for."""
    derived: dict[str, DerivedSpec] = {}
    for name, number in spec.derived.items():
        key: Key = ("derived", name)
        for one in _combinations(document, key, number.for_each, "numbers"):
            values, wording = _values_and_words(one)
            made = name
            if one:
                made = _filled(document, key, name, values)
                number = _with_texts(document, key, spec.derived[name], values, wording)
            if made in derived:
                document.report(key, f"there is already a derived number {made!r}")
            derived[made] = number
    said: dict[str, list[Claim]] = {"claims": [], "checks": []}
    for group, every in said.items():
        for i, claim in enumerate(getattr(spec, group)):
            for one in _combinations(document, (group, i), claim.for_each, group):
                filled = _with_texts(document, (group, i), claim, *_values_and_words(one)) if one else claim
                filled._number = i
                every.append(filled)
    return spec.model_copy(update={"derived": derived, **said})


def _values_and_words(one: Mapping[str, tuple[str, str]]) -> tuple[dict[str, str], dict[str, str]]:
    return {k: value for k, (value, _) in one.items()}, {k: words for k, (_, words) in one.items()}


def _with_texts(
    document: Document, key: Key, entry: Texts, values: Mapping[str, str], wording: Mapping[str, str]
) -> Texts:
    """Return an entry, one of those it stands for: names get values, sentences their words."""

    def fill(part: Any, name: str = "") -> Any:
        if isinstance(part, dict):
            return {k: fill(v, k) for k, v in part.items()}
        if isinstance(part, list):
            return [fill(v, name) for v in part]
        use = wording if name in SENTENCES else values
        return _filled(document, key, part, use) if isinstance(part, str) else part

    given = entry.model_dump(by_alias=True, exclude_defaults=True, exclude={"for_each"})
    return type(entry).model_validate(fill(given))


def _expanded(document: Document, key: Key, entry: RunSpec) -> Iterator[NamedRun]:
    """Return the runs that an entry stands for, none if it is wrong."""
    known = len(document.problems)
    for combination in _combinations(document, key, entry.for_each, "runs"):
        values = {name: value for name, (value, _) in combination.items()}
        wording = {name: chosen.says or value for name, (value, chosen) in combination.items()}
        entries = [entry, *(chosen for _, chosen in combination.values())]

        def fill(text: str, *where: str, use: dict[str, str] = values) -> str:
            return _filled(document, (*key, *where), text, use)

        name = fill(entry.name, "name")
        parts = name.split("/")
        if not all(_FOLDER.fullmatch(part) and part.strip(".") for part in parts) or parts[0] == FIGURES:
            sentence = f"{short(name)} cannot name a run: use letters, digits, . _ + - and / between folders"
            if any(len(part) > LONGEST for part in parts):
                sentence = f"{short(name)} is too long: at most {LONGEST} characters between two /"
            document.report((*key, "name"), sentence)
        folder = document.path.parent
        changes: dict[str, Change] = {}
        for one in entries:
            swaps = {unit: fill(fmu, "swap", unit) for unit, fmu in one.swap.items()}
            settings = {
                place: yaml_lines.scalar(fill(value, "set", place)) if isinstance(value, str) else value
                for place, value in one.set.items()
            }
            filled = one.model_copy(update={"swap": swaps, "set": settings})
            for change in changes_of_file(filled, folder, "study"):
                if change.place in changes:
                    document.report((*key, "for"), f"{change.place} is given twice")
                changes[change.place] = change
        label = fill(entry.label, "label", use=wording) or name
        row = fill(entry.row, "row", use=wording) or label
        scenario = folder / fill(entry.scenario, "scenario")
        if len(document.problems) > known:
            return
        yield NamedRun(name, label, row, scenario, tuple(changes.values()))


def _known(document: Document, key: Key, name: str, known: Iterable[str], what: str, many: str) -> None:
    if name not in (names := list(known)):
        document.report(key, f"there is no {what} {name!r}" + hint(name, names, lead=many))


def _check_axes(spec: ExperimentSpec, document: Document) -> None:
    """Report a place that two axes, or an axis and `set` or `swap`, would both give a value."""
    seen: dict[str, str] = dict.fromkeys(spec.places, "set and swap")
    for name, axis in spec.axes.items():
        for place in axis.places:
            if place in seen:
                also = f"axis {seen[place]!r}" if seen[place] in spec.axes else "set or swap"
                document.report(("axes", name), f"{place} is given by {also} already")
            seen[place] = name
        if name in COLUMNS or name in spec.metrics:
            document.report(("axes", name), f"{name!r} is the name of another column of the table")
    for name in spec.metrics:
        if name in COLUMNS:
            document.report(("metrics", name), f"{name!r} is the name of another column of the table")


def _check_names(experiment: Experiment, document: Document) -> None:
    """Report every name of a run, metric, axis or number that does not exist."""
    spec, runs = experiment.spec, experiment.runs

    def check_metric(key: Key, name: str) -> None:
        _known(document, key, name, spec.metrics, "metric", "metrics")

    def check_axis(key: Key, name: str) -> None:
        _known(document, key, name, spec.axes, "axis", "axes")

    def check_patterns(key: Key, patterns: Sequence[str]) -> None:
        for k, pattern in enumerate(patterns):
            if not experiment.matching([pattern]):
                sentence = f"no run is named {pattern!r}" + hint(pattern, runs, lead="runs")
                document.report((*key, "runs", k), sentence)

    for name, along in spec.axes.items():
        check_patterns(("axes", name), along.runs)
    for i, table in enumerate(spec.tables):
        check_patterns(("tables", i), table.runs)
        for k, name in enumerate(table.metrics):
            check_metric(("tables", i, "metrics", k), name)
    for name, grid in spec.grids.items():
        for cell in cells(grid):
            if grid.derived:
                _known(document, ("grids", name), cell.metric, spec.derived, "derived number", "there are")
            else:
                _known(document, ("grids", name), cell.run, runs, "run", "runs")
        if grid.metric:
            check_metric(("grids", name, "metric"), grid.metric)
    for name, number in spec.derived.items():
        for word, source in number.of.items():
            _known(document, ("derived", name, "of", word, "run"), source.run, runs, "run", "runs")
            check_metric(("derived", name, "of", word, "metric"), source.metric)
        if number.rank_correlation is not None:
            place: Key = ("derived", name, "rank_correlation")
            _known(document, place, number.rank_correlation, spec.grids, "grid", "grids")
            if grid_ := spec.grids.get(number.rank_correlation):
                axes_ = {**grid_.rows, **grid_.columns}
                for axis, counted in number.only.items():
                    which: Key = ("derived", name, "only", axis)
                    _known(document, which, axis, axes_, "axis", "the grid has")
                    for part in counted if axis in axes_ else ():
                        _known(document, which, part, axes_[axis], "value", f"{axis} has")
                if all(cell.published is None for cell in cells(grid_)):
                    sentence = f"grid {number.rank_correlation!r} has no published numbers to compare with"
                    document.report(place, sentence)
    open_values = spec.region.open_values if spec.region else {}
    for name, one in open_values.items():
        check_patterns(("region", "open_values", name), one.runs)
    for group, judged in (("claims", spec.claims), ("checks", spec.checks)):
        for i, claim in ((one.number(number), one) for number, one in enumerate(judged)):
            for k, name in enumerate(claim.open_values or ()):
                where: Key = (group, i, "open_values", k)
                _known(document, where, name, open_values, "open value", "open values")
    if spec.tuning:
        objective = spec.tuning.objective
        _known(document, ("tuning", "objective"), objective, spec.derived, "derived number", "there are")
        check_patterns(("tuning",), spec.tuning.runs)
    for key, condition in spec.conditions():
        _check_condition(experiment, document, key, condition)
    for name, limit in spec.limits.items():
        check_axis(("limits", name, "of"), limit.of)
        if limit.of in spec.axes and not spec.axes[limit.of].numeric:
            document.report(("limits", name, "of"), f"the values of {limit.of!r} are no numbers")
        if limit.of in spec.repeats:
            document.report(("limits", name, "of"), f"numbers are means over {limit.of!r}")
        if spec.design != "grid":
            document.report(("limits", name), "limits need a grid")
    for i, figure in enumerate(spec.figures):
        if figure.name in [one.name for one in spec.figures[:i]]:
            document.report(("figures", i, "name"), f"there is already a figure {figure.name!r}")
        check_patterns(("figures", i), figure.runs)
        for group, name in (("x", figure.x), ("y", figure.y), ("lines", figure.lines),
                            ("panels", figure.panel_axis)):  # fmt: skip
            if name and not (name == RUN and spec.runs):
                check_axis(("figures", i, group), name)
            if name in spec.repeats:
                document.report(("figures", i, group), f"numbers are means over {name!r}")
        if figure.metric:
            check_metric(("figures", i, "metric"), figure.metric)
        if figure.limit:
            _known(document, ("figures", i, "limit"), figure.limit, spec.limits, "limit", "limits")
        if figure.kind == "overlay" and spec.axes:
            document.report(("figures", i, "kind"), "runs along axes are drawn as curve, map or limit")
        if figure.grid:
            _known(document, ("figures", i, "grid"), figure.grid, spec.grids, "grid", "grids")
        elif figure.kind != "overlay":
            _check_places(spec, document, i, figure)
        for axis, chosen in figure.only.items():
            check_axis(("figures", i, "only", axis), axis)
            if axis not in spec.axes or (spec.design == "latin_hypercube" and spec.axes[axis].numeric):
                continue
            known = {text_of(level.value): level for level in levels_of(spec.axes[axis])}
            for value in chosen:
                if text_of(value) not in known:
                    sentence = f"{axis} has no value {value!r}" + hint(text_of(value), known, lead="it has")
                    document.report(("figures", i, "only", axis), sentence)


def _check_condition(experiment: Experiment, document: Document, key: Key, condition: Condition) -> None:
    spec, runs = experiment.spec, experiment.runs
    if condition.derived:
        known = spec.derived
        if condition.derived not in known:
            guess = hint(condition.derived, known, lead="there are")
            document.report((*key, "derived"), f"there is no derived number {condition.derived!r}{guess}")
    else:
        places = [(key, condition.run, condition.metric)]
        if not condition.run and spec.runs and key[0] != "limits":
            document.report(key, "needs run and metric, or derived in place of both")
            return
        if condition.run and not experiment.matching([condition.run]):
            _known(document, (*key, "run"), condition.run, runs, "run", "runs")
        if isinstance(condition.bound, Reference):
            places.append(((*key, condition.operator), condition.bound.run, condition.bound.metric))
            _known(document, (*key, condition.operator, "run"), condition.bound.run, runs, "run", "runs")
        for place, _, name in places:
            _known(document, (*place, "metric"), name, spec.metrics, "metric", "metrics")


def _check_places(spec: ExperimentSpec, document: Document, i: int, figure: FigureSpec) -> None:
    """Report an axis of a grid that has no place in a figure, or two places."""
    used = {figure.x, figure.y, figure.lines, figure.panel_axis}
    if figure.limit in spec.limits:
        of = spec.limits[figure.limit].of
        if of in used:
            document.report(("figures", i), f"{of!r} is what the limit {figure.limit!r} is of")
        used.add(of)
    for axis in (figure.x, figure.y):
        if axis in spec.axes and figure.kind == "map" and not spec.axes[axis].numeric:
            document.report(("figures", i), f"the values of {axis!r} are no numbers")
    used |= {*spec.repeats}
    left = [name for name in (*spec.axes, *([RUN] if spec.runs else [])) if name not in used]
    if spec.design == "grid" and left and not document.problems:
        sentence = f"the axis {left[0]!r} has no place in this figure: make it lines or panels"
        document.report(("figures", i), sentence)
