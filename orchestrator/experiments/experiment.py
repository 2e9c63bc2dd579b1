"""Loading of experiment files: entries with `for` and axes expanded into runs and cases.

All errors of a file are reported at once.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ..errors import ScenarioError
from ..messages import hint, short
from ..metrics.expressions import TimeWindow
from ..plan import Override, OverrideOrigin
from ..safe_files import reads
from ..scenario import loader, overrides, yaml_lines
from ..scenario.schema_validation import validated
from ..scenario.yaml_lines import Document, KeyPath
from ..signal_names import Target
from .claim_schema import Claim, DerivedSpec, ValidationSpec
from .experiment_design import DesignAxisSpec, DesignPoint, changes_at, changes_of_file, points
from .jobs import TestRequest
from .names_check import check_axes, check_names
from .schema import ChoiceSpec, ExperimentSpec, RunSpec

if TYPE_CHECKING:
    from ..evaluation.validation import Bands
    from ..measured.measurement import Measurement

FIGURES = "figures"
"""Folder of the figures, next to the folders of named runs."""
SENTENCES = ("says", "short", "source", "note")
"""Fields of claims and derived numbers that are prose, where `{name}` becomes the label of a value."""
MOST = 10_000
"""Largest number of named runs. Chosen: a hundred times our largest study; one report shows them all."""
LONGEST = 100
"""Characters of a folder name. Chosen: more do not fit into file names where a letter takes two bytes."""
_FOLDER = re.compile(rf"[\w.+-]{{1,{LONGEST}}}")
Texts = TypeVar("Texts", Claim, DerivedSpec)


@dataclass(frozen=True)
class NamedRun:
    """A run of an experiment, before the axes multiply it into cases."""

    name: str  # "" if there is only one
    label: str
    row: str
    scenario: Path
    changes: tuple[Override, ...]
    test: TestRequest | None = None  # the standard test that judges it
    windows: Mapping[str, TimeWindow] = field(default_factory=dict)
    """Key of a metric -> window [s] in place of the metric's."""


@dataclass(frozen=True)
class ForBinding:
    """One combination of the values of an entry's `for`: what `{name}` becomes in its texts."""

    document: Document
    key: KeyPath  # of the entry
    values: dict[str, str]  # in names
    words: dict[str, str]  # in sentences
    choices: list[ChoiceSpec]  # values that come with overrides

    def fill(self, text: str, *where: str, sentence: bool = False) -> str:
        """Return a text of the entry with its placeholders filled in; `where`: its key within the entry."""
        use = self.words if sentence else self.values
        for word in re.findall(r"\{([^{}]*)\}", text):
            if word not in use:
                guess = hint(word, use, lead="'for' has")
                self.document.report((*self.key, *where), f"{{{word}}} is undefined{guess}", "axis-unknown")
        return re.sub(r"\{(\w+)\}", lambda match: use.get(match[1], match[0]), text)

    def filled(self, entry: Texts) -> Texts:
        """Return the entry with all its texts filled in."""

        def fill(part: Any, name: str = "") -> Any:
            if isinstance(part, dict):
                return {k: fill(v, k) for k, v in part.items()}
            if isinstance(part, list):
                return [fill(v, name) for v in part]
            return self.fill(part, sentence=name in SENTENCES) if isinstance(part, str) else part

        if not self.values:
            return entry
        fields = entry.model_dump(by_alias=True, exclude_defaults=True, exclude={"for_each"})
        return type(entry).model_validate(fill(fields))


def fillings(
    document: Document, key: KeyPath, for_each: Mapping[str, Mapping[str, Any]], what: str
) -> Iterator[ForBinding]:
    """Yield every combination of a `for`; none, and a reported problem, if there are too many."""
    number = math.prod(map(len, for_each.values()))
    if number > MOST:
        document.report(
            (*key, "for"), f"stands for {number} {what}; at most {MOST} are allowed", "experiment-too-large"
        )
        return
    for combination in itertools.product(*(choices.items() for choices in for_each.values())):
        words, choices = {}, []
        for name, (value, chosen) in zip(for_each, combination, strict=True):
            if isinstance(chosen, ChoiceSpec):
                choices.append(chosen)
                chosen = chosen.says or value
            words[name] = chosen
        values = dict(zip(for_each, (value for value, _ in combination), strict=True))
        yield ForBinding(document, key, values, words, choices)


def expanded(spec: ExperimentSpec, document: Document) -> ExperimentSpec:
    """Return the file with every claim, check and derived number expanded over its `for`."""
    derived: dict[str, DerivedSpec] = {}
    for name, number in spec.derived.items():
        key: KeyPath = ("derived", name)
        for binding in fillings(document, key, number.for_each, "numbers"):
            made = binding.fill(name) if number.for_each else name
            if made in derived:
                document.report(key, f"there is already a derived number {made!r}", "name-duplicate")
            derived[made] = binding.filled(number)
    expanded_claims: dict[str, list[Claim]] = {"claims": [], "checks": []}
    for group, every in expanded_claims.items():
        for i, claim in enumerate(getattr(spec, group)):
            for binding in fillings(document, (group, i), claim.for_each, group):
                every.append(binding.filled(claim))
                every[-1]._number = i
    return spec.model_copy(update={"derived": derived, **expanded_claims})


def named_runs(document: Document, i: int, entry: RunSpec) -> Iterator[NamedRun]:
    """Yield the runs of the i-th entry, up to the first with an error, which is reported."""
    key: KeyPath = ("runs", i)
    folder, known = document.path.parent, len(document.errors)
    for binding in fillings(document, key, entry.for_each, "runs"):
        name = binding.fill(entry.name, "name")
        _check_folder(name, binding)
        changes: dict[Target, Override] = {}
        for part in (entry, *binding.choices):
            swaps = {instance: binding.fill(fmu, "swap", instance) for instance, fmu in part.swap.items()}
            settings = {
                target: yaml_lines.scalar(binding.fill(value, "set", str(target)))
                if isinstance(value, str)
                else value
                for target, value in part.set.items()
            }
            filled = part.model_copy(update={"swap": swaps, "set": settings})
            for change in changes_of_file(filled, folder, "study"):
                if change.target in changes:
                    document.report((*key, "for"), f"{change.target} is given twice", "name-duplicate")
                changes[change.target] = change
        label = binding.fill(entry.label, "label", sentence=True) or name
        row = binding.fill(entry.row, "row", sentence=True) or label
        scenario = folder / binding.fill(entry.scenario, "scenario")
        if len(document.errors) > known:
            return
        yield NamedRun(name, label, row, scenario, tuple(changes.values()))


def _check_folder(name: str, binding: ForBinding) -> None:
    """Report a run name that cannot be a folder name."""
    parts = name.split("/")
    if all(_FOLDER.fullmatch(part) and part.strip(".") for part in parts) and parts[0] != FIGURES:
        return
    sentence = f"{short(name)} cannot name a run: use letters, digits, . _ + - and / between folders"
    if any(len(part) > LONGEST for part in parts):
        sentence = f"{short(name)} is too long: at most {LONGEST} characters between two /"
    binding.document.report((*binding.key, "name"), sentence, "name-duplicate")


RUNS = "runs"
"""Folder of the results of runs along axes."""
FEW = 3
"""Repeats of a quick look. Chosen: fewer give no useful confidence interval."""


@dataclass(frozen=True)
class Case:
    """A named run at a point of the axes."""

    number: int  # from 0, in the order of the design
    run: NamedRun
    point: DesignPoint
    changes: tuple[Override, ...]

    @property
    def label(self) -> str:
        """The name of the case in messages."""
        return ", ".join([*filter(None, [self.run.name]), *(level.words for level in self.point)])


@dataclass(frozen=True)
class LoadedExperiment:
    """A validated experiment file, expanded; its scenarios have not been read yet."""

    path: Path
    spec: ExperimentSpec
    runs: dict[str, NamedRun]
    for_all: tuple[Override, ...] = ()  # by the file's own `swap`, `set`, ...
    by_options: tuple[Override, ...] = ()  # of all runs, on the command line
    design: tuple[tuple[str, DesignPoint], ...] = ()
    """Run and point of every case, where not all runs have the same points; empty: all runs at all points."""
    origin: OverrideOrigin = "sweep"
    """Origin of the overrides that the axes make."""
    all_repeats: int = 0
    """Number of repeats of the file if this is a quick look at a few of them, else 0."""

    @property
    def changed(self) -> tuple[Override, ...]:
        """The overrides of all runs."""
        return (*self.for_all, *self.by_options)

    @property
    def identity(self) -> str:
        """Identifies the experiment in its results folder: name of its file's folder and of the file."""
        return f"{self.path.absolute().parent.name}/{self.path.name}"

    @cached_property
    def points(self) -> list[DesignPoint]:
        """All points of the design; without axes a single one without levels."""
        return list(dict.fromkeys(point for _, point in self.design)) or points(self.spec)

    @cached_property
    def cases(self) -> list[Case]:
        """All runs at all points, ordered by run, or those of `design`."""
        pairs = self.design or itertools.product(self.runs, self.points)
        return [
            Case(number, run, point, (*self.for_all, *run.changes, *self.by_options, *self._at(point, run)))
            for number, (run, point) in enumerate((self.runs[name], point) for name, point in pairs)
        ]

    def setting(self, point: DesignPoint) -> DesignPoint:
        """Return a point without the axes of repeats."""
        pairs = zip(self.spec.axes.values(), point, strict=True)
        return tuple(level for axis, level in pairs if not axis.repeats)

    @cached_property
    def settings(self) -> list[DesignPoint]:
        """All distinct points without the axes of repeats."""
        return list(dict.fromkeys(map(self.setting, self.points)))

    @property
    def short(self) -> LoadedExperiment:
        """The experiment with only the first few repeats."""
        axes = {
            name: axis.model_copy(update={"values": dict(itertools.islice((axis.values or {}).items(), FEW))})
            if axis.repeats
            else axis
            for name, axis in self.spec.axes.items()
        }
        shortened = replace(self, spec=self.spec.model_copy(update={"axes": axes}))
        return replace(shortened, all_repeats=self.repeats if shortened.repeats < self.repeats else 0)

    @property
    def repeats(self) -> int:
        """The number of repeats; 1 without axes of repeats."""
        return math.prod(self.spec.axes[name].length or 1 for name in self.spec.repeats)

    @property
    def quick(self) -> str:
        """Say that this is a quick look at a few repeats; "" if it is not."""
        return f"A quick look: {self.repeats} of {self.all_repeats} repeats." if self.all_repeats else ""

    @cached_property
    def first_cases(self) -> list[Case]:
        """All runs at all settings, only the first of their repeats."""
        first: dict[tuple[str, DesignPoint], Case] = {}
        for case in self.cases:
            first.setdefault((case.run.name, self.setting(case.point)), case)
        return list(first.values())

    def matching(self, patterns: Sequence[str]) -> list[NamedRun]:
        """Return the runs whose names match any pattern, in the order of the patterns."""
        names = [name for pattern in patterns for name in self.runs if fnmatchcase(name, pattern)]
        return [self.runs[name] for name in dict.fromkeys(names)]

    def axis_of(self, place: str) -> tuple[str, Target] | None:
        """Return the axis of the file, and the target on it, that a problem names; None if it names none."""
        if self.design:
            return None
        changes = itertools.chain.from_iterable(map(self._at, self.points))
        change = next((change for change in changes if str(change) == place), None)
        axes = self.spec.axes.items()
        target = change.target if change else None
        return next(((name, target) for name, axis in axes if target in axis.targets), None)

    @cached_property
    def recordings(self) -> list[tuple[ValidationSpec, Measurement, Bands]]:
        """The validations with their measurements and bands."""
        if not self.spec.validations:
            return []
        from ..evaluation.validation import load_bands
        from ..measured.measurement import load_measurement

        beside = self.path.parent
        return [
            (
                spec,
                load_measurement(beside / spec.measured),
                load_bands(beside / spec.bands if (beside / spec.bands).is_file() else spec.bands),
            )
            for spec in self.spec.validations
        ]

    def _at(self, point: DesignPoint, run: NamedRun | None = None) -> list[Override]:
        """Return the overrides at a point; with `run`, only those of axes that apply to it."""
        pairs = [
            (axis, level)
            for axis, level in zip(self.spec.axes.values(), point, strict=True)
            if run is None or any(fnmatchcase(run.name, pattern) for pattern in axis.runs)
        ]
        return [
            change
            for axis, level in pairs
            for change in changes_at(axis, level, self.path.parent, self.origin)
        ]


def experiment_of(
    path: Path,
    runs: Iterable[NamedRun],
    *,
    changes: Sequence[Override] = (),
    axes: Mapping[str, DesignAxisSpec] | None = None,
    design: Sequence[tuple[str, DesignPoint]] = (),
    origin: OverrideOrigin = "sweep",
    **keys: Any,
) -> LoadedExperiment:
    """Return an experiment that is not read from an experiment file.

    Args:
        path: the file that it is made of; its folder and name identify it.
        runs: the named runs.
        changes: overrides of all runs.
        axes, design, origin: see `LoadedExperiment`.
        keys: of the schema, such as its title, metrics and figures.
    """
    named = {run.name: run for run in runs}
    listed = [{"name": run.name, "scenario": run.scenario.name} for run in named.values()]
    spec = ExperimentSpec.model_validate({"runs": listed, **keys}).model_copy(update={"axes": axes or {}})
    return LoadedExperiment(path, spec, named, (), tuple(changes), tuple(design), origin)


SCENARIOS = Path("scenarios")
"""Folder searched for studies if none is given."""


def found_studies(folder: Path = SCENARIOS) -> list[Path]:
    """Return all study files in the subfolders of a folder, sorted by title.

    The studies of one folder stay together, `study.yaml` first.

    Raises:
        ScenarioError: there are none.
    """
    titles: dict[Path, str] = {}
    for path, _ in loader.files(folder, ["a study file"], depth=2):
        data = yaml_lines.read(path, what="study file").data
        titles[path] = str(data.get("title", "")) if isinstance(data, dict) else ""
    if not titles:
        raise ScenarioError(
            f"no study file was named, and there is none in {folder}/*/", code="file-wrong-kind"
        )
    first = {path.parent: min(titles[p] for p in titles if p.parent == path.parent) for path in titles}
    return sorted(titles, key=lambda path: (first[path.parent], path.stem != "study", titles[path]))


@reads("experiment file", ScenarioError)
def load_experiment(path: Path | str, *, changes: Sequence[Override] = ()) -> LoadedExperiment:
    """Load an experiment file: a study, a sweep or a tuning.

    Args:
        path: the file.
        changes: overrides of all runs; paths of FMUs are relative to the working directory.

    Raises:
        ScenarioError: the file is invalid; lists all errors.
    """
    path = Path(path)
    document = yaml_lines.read(path, what="experiment file")
    overrides.apply_to_all_runs(document, changes)
    spec = validated(ExperimentSpec, document)
    spec = expanded(spec, document)
    runs = {"": NamedRun("", "", "", path.parent / spec.scenario, ())} if spec.scenario else {}
    for i, entry in enumerate(spec.runs):
        for run in named_runs(document, i, entry):
            if len(runs) == MOST:
                document.report(
                    ("runs",), f"more than {MOST} runs; at most {MOST} are allowed", "experiment-too-large"
                )
                document.raise_errors()
            if run.name in runs:
                document.report(("runs", i, "name"), f"there is already a run {run.name!r}", "name-duplicate")
            runs[run.name] = run
    overridden = {change.target: change for change in changes}
    own = changes_of_file(spec, path.parent, "sweep" if spec.axes else "study")
    for_all = tuple(change for change in own if change.target not in overridden)
    experiment = LoadedExperiment(path, spec, runs, for_all, tuple(overridden.values()))
    if not document.errors:
        check_axes(spec, document)
        check_names(experiment, document)
    document.raise_errors()
    _ = experiment.recordings  # a mistake in a measurement file is told before the runs are made
    return experiment
