"""Loading of experiment files: entries with `for` expanded, and every name in them looked up.

All errors of a file are reported at once.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import hint, short
from yawbench.foundation.safe_files import reads
from yawbench.orchestrator.plan import Override
from yawbench.orchestrator.scenario import loader, yaml_lines
from yawbench.orchestrator.scenario.schema_validation import validated
from yawbench.orchestrator.scenario.yaml_lines import Document, KeyPath
from yawbench.orchestrator.signal_names import Target

from .axes import RUN, changes_of_file, levels_of, names_of
from .claim_schema import Claim, DerivedSpec, MetricReference, text_of
from .claims import cells
from .experiment import FIGURES, LoadedExperiment, NamedRun
from .schema import ChoiceSpec, ExperimentSpec, FigureSpec, RunSpec

SENTENCES = ("says", "short", "source", "note")
"""Fields of claims and derived numbers that are prose, where `{name}` becomes the label of a value."""
MOST = 10_000
"""Largest number of named runs. Chosen: a hundred times our largest study; one report shows them all."""
LONGEST = 100
"""Characters of a folder name. Chosen: more do not fit into file names where a letter takes two bytes."""
_FOLDER = re.compile(rf"[\w.+-]{{1,{LONGEST}}}")
Texts = TypeVar("Texts", Claim, DerivedSpec)


SCENARIOS = Path("scenarios")
"""Folder searched for studies if none is given."""


def found_studies(folder: Path = SCENARIOS) -> list[Path]:
    """Return all study files in the subfolders of a folder, sorted by title.

    The studies of one folder stay together, `study.yaml` first.

    Raises:
        ScenarioError: there are none.
    """
    titles = {path: loader.title_of(path) for path, _ in loader.files(folder, ["a study file"], depth=2)}
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
        check_axes(spec, document, overridden)
        check_names(experiment, document)
    document.raise_errors()
    _ = experiment.recordings  # a mistake in a measurement file is told before the runs are made
    return experiment


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


COLUMNS = (RUN, "status", "reason", "warnings", "key")
"""Columns of the table besides axes and metrics."""


def check_axes(spec: ExperimentSpec, document: Document, overridden: Iterable[Target]) -> None:
    """Report targets that two axes, or an axis and `set` or `swap`, or an option, override."""
    seen: dict[Target, str] = dict.fromkeys([*spec.targets, *overridden], "set and swap")
    for name, axis in spec.axes.items():
        for target in axis.targets:
            if target in seen:
                also = f"axis {seen[target]!r}" if seen[target] in spec.axes else "set or swap"
                document.report(("axes", name), f"{target} is given by {also} already", "name-duplicate")
            seen[target] = name
    for group, names in (("axes", spec.axes), ("metrics", spec.metrics)):
        for name in names:
            if name in COLUMNS or (group == "axes" and name in spec.metrics):
                document.report(
                    (group, name), f"{name!r} is the name of another column of the table", "name-duplicate"
                )


def check_names(experiment: LoadedExperiment, document: Document) -> None:
    """Report every reference to a run, metric, axis or number that does not exist."""
    spec, runs = experiment.spec, experiment.runs
    known: dict[str, tuple[Mapping[str, object], str]] = {
        "run": (runs, "runs"),
        "metric": (spec.metrics, "metrics"),
        "axis": (spec.axes, "axes"),
        "derived number": (spec.derived, "there are"),
        "grid": (spec.grids, "grids"),
        "limit": (spec.limits, "limits"),
        "open value": (spec.region.open_values if spec.region else {}, "open values"),
    }
    for what, name, key in itertools.chain(_names(spec), _names_of_conditions(experiment, document)):
        names, lead = known[what]
        if name not in names:
            document.report(key, f"there is no {what} {name!r}{hint(name, names, lead=lead)}", "name-unknown")
    for patterns, key in _patterns(spec):
        for k, pattern in enumerate(patterns):
            if not experiment.matching([pattern]):
                sentence = f"no run is named {pattern!r}{hint(pattern, runs, lead='runs')}"
                document.report((*key, "runs", k), sentence, "name-unknown")
    _check_correlations(spec, document)
    _check_limits(spec, document)
    for i, figure in enumerate(spec.figures):
        _check_figure(spec, document, i, figure)


def _names(spec: ExperimentSpec) -> Iterator[tuple[str, str, KeyPath]]:
    """Yield (kind, name, key) of all references except patterns of runs."""
    for i, table in enumerate(spec.tables):
        for k, name in enumerate(table.metrics):
            yield "metric", name, ("tables", i, "metrics", k)
    for name, grid in spec.grids.items():
        for cell in cells(grid):
            what, named = ("derived number", cell.metric) if grid.derived else ("run", cell.run)
            yield what, named, ("grids", name)
        if grid.metric:
            yield "metric", grid.metric, ("grids", name, "metric")
    for name, number in spec.derived.items():
        for word, source in number.of.items():
            yield "run", source.run, ("derived", name, "of", word, "run")
            yield "metric", source.metric, ("derived", name, "of", word, "metric")
        if number.rank_correlation is not None:
            yield "grid", number.rank_correlation, ("derived", name, "rank_correlation")
    for group, i, claim in spec.assertions():
        for k, name in enumerate(claim.open_values or ()):
            yield "open value", name, (group, i, "open_values", k)
    if spec.tuning:
        yield "derived number", spec.tuning.objective, ("tuning", "objective")
    for i, validation in enumerate(spec.validations):
        yield "run", validation.run, ("validations", i, "run")
    for name, limit in spec.limits.items():
        yield "axis", limit.of, ("limits", name, "of")
    for i, figure in enumerate(spec.figures):
        for name, axis in figure.axes.items():
            if axis != RUN or not spec.runs:
                yield "axis", axis, ("figures", i, name)
        for axis in figure.only:
            yield "axis", axis, ("figures", i, "only", axis)
        for what in ("metric", "limit", "grid"):
            if name := getattr(figure, what):
                yield what, name, ("figures", i, what)


def _names_of_conditions(
    experiment: LoadedExperiment, document: Document
) -> Iterator[tuple[str, str, KeyPath]]:
    """Yield the references in conditions likewise; report conditions without a run."""
    for key, condition in experiment.spec.conditions():
        if condition.derived:
            yield "derived number", condition.derived, (*key, "derived")
            continue
        if not condition.run and experiment.spec.runs and key[0] != "limits":
            document.report(key, "needs run and metric, or derived in place of both", "figure-invalid")
            continue
        if condition.run and not experiment.matching([condition.run]):
            yield "run", condition.run, (*key, "run")
        yield "metric", condition.metric, (*key, "metric")
        if isinstance(condition.bound, MetricReference):
            yield "run", condition.bound.run, (*key, condition.relation, "run")
            yield "metric", condition.bound.metric, (*key, condition.relation, "metric")


def _patterns(spec: ExperimentSpec) -> Iterator[tuple[Sequence[str], KeyPath]]:
    """Yield (patterns of runs, key of the part that has them)."""
    for name, axis in spec.axes.items():
        yield axis.runs, ("axes", name)
    for i, table in enumerate(spec.tables):
        yield table.runs, ("tables", i)
    for name, open_value in spec.region.open_values.items() if spec.region else ():
        yield open_value.runs, ("region", "open_values", name)
    if spec.tuning:
        yield spec.tuning.runs, ("tuning",)
    for i, figure in enumerate(spec.figures):
        yield figure.runs, ("figures", i)


def _check_correlations(spec: ExperimentSpec, document: Document) -> None:
    """Report rank correlations over rows, columns or published numbers that the grid lacks."""
    for name, number in spec.derived.items():
        grid = spec.grids.get(number.rank_correlation or "")
        if grid is None:
            continue
        axes = {**grid.rows, **grid.columns}
        for axis, counted in number.only.items():
            where: KeyPath = ("derived", name, "only", axis)
            if axis not in axes:
                document.report(
                    where, f"there is no axis {axis!r}{hint(axis, axes, lead='the grid has')}", "axis-unknown"
                )
                continue
            for part in (part for part in counted if part not in axes[axis]):
                guess = hint(part, axes[axis], lead=f"{axis} has")
                document.report(where, f"there is no value {part!r}{guess}", "name-unknown")
        if all(cell.published is None for cell in cells(grid)):
            sentence = f"grid {number.rank_correlation!r} has no published numbers to compare with"
            document.report(("derived", name, "rank_correlation"), sentence, "figure-invalid")


def _check_limits(spec: ExperimentSpec, document: Document) -> None:
    """Report limits of axes that cannot have one."""
    for name, limit in spec.limits.items():
        if limit.of in spec.axes and not spec.axes[limit.of].numeric:
            document.report(
                ("limits", name, "of"), f"the values of {limit.of!r} must be numbers", "figure-invalid"
            )
        if limit.of in spec.repeats:
            document.report(("limits", name, "of"), f"numbers are means over {limit.of!r}", "figure-invalid")
        if spec.design != "grid":
            document.report(("limits", name), "limits need a grid", "figure-invalid")


def _check_figure(spec: ExperimentSpec, document: Document, i: int, figure: FigureSpec) -> None:
    """Report a name that is taken, unknown values in `only`, and axes that are not shown, or shown twice."""

    def report(sentence: str, *where: str, code: str = "figure-invalid") -> None:
        document.report(("figures", i, *where), sentence, code)

    if figure.name in [other.name for other in spec.figures[:i]]:
        report(f"there is already a figure {figure.name!r}", "name", code="name-duplicate")
    if figure.what.shows == "runs" and spec.axes:
        report("runs along axes are drawn as curve, map or limit", "kind")
    for name, chosen in figure.only.items():
        axis = spec.axes.get(name)
        if axis is None or (spec.design == "latin_hypercube" and axis.numeric):
            continue
        levels = levels_of(axis)
        names = {text for level in levels for text in names_of(axis, level)}
        for value in (value for value in chosen if text_of(value) not in names):
            guess = hint(text_of(value), [text_of(level.value) for level in levels], lead="it has")
            report(f"{name} has no value {value!r}{guess}", "only", name)
    if not figure.what.over_axes:
        return
    used = {*figure.axes.values()}
    for key, name in figure.axes.items():
        if name in spec.repeats:
            report(f"numbers are means over {name!r}", key)
        if key in "xy" and name in spec.axes and figure.what.upwards and not spec.axes[name].numeric:
            report(f"the values of {name!r} must be numbers")
    if figure.limit in spec.limits:
        of = spec.limits[figure.limit].of
        if of in used:
            report(f"{of!r} is the axis of the limit {figure.limit!r}")
        used.add(of)
    shown = used | {*spec.repeats}
    left = [name for name in (*spec.axes, *([RUN] if spec.runs else [])) if name not in shown]
    if spec.design == "grid" and left and not document.errors:
        report(f"the axis {left[0]!r} is not used in this figure: assign it to lines or panels")
