"""Loading of experiment files: entries with `for` expanded, and every name in them looked up.

All errors of a file are reported at once.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, Field, create_model

from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import hint, short
from yawbench.foundation.safe_files import reads
from yawbench.orchestrator.plan import Override
from yawbench.orchestrator.scenario import catalogue, like, yaml_lines
from yawbench.orchestrator.scenario.schema_validation import validated
from yawbench.orchestrator.scenario.yaml_lines import Document, KeyPath
from yawbench.orchestrator.signal_names import Target

from .axes import changes_of_file
from .claim_schema import Claim, DerivedSpec
from .experiment import FIGURES, LoadedExperiment, NamedRun
from .problems import problems_of
from .sampling import read_table
from .schema import ChoiceSpec, ExperimentSpec, RunSpec
from .sections import sections

_ADDED: dict[str, Any] = {
    name: (list[section.entry], Field([], description=section.says))  # type: ignore[name-defined]
    for name, section in sections().items()
}
ExperimentFile = create_model(
    "ExperimentSpec", __base__=ExperimentSpec, __doc__=ExperimentSpec.__doc__, __module__=__name__,
    __qualname__="ExperimentFile", **_ADDED,
)  # fmt: skip
"""Schema of experiment files, with the sections that parts add."""
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
SCENARIO = "a scenario"
"""What a name is of, as `catalogue` says it."""


def found_studies() -> list[Path]:
    """Return all study files in the subfolders of `SCENARIOS`, sorted by title.

    The studies of one folder stay together, `study.yaml` first.

    Raises:
        ScenarioError: there are none.
    """
    titles = {
        path: catalogue.title_of(path) for path, _ in catalogue.files(SCENARIOS, ["a study file"], depth=2)
    }
    if not titles:
        raise ScenarioError(
            f"no study file was named, and there is none in {SCENARIOS}/*/", code="file-wrong-kind"
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
    document = like.read(path, what="experiment file")
    spec = validated(ExperimentFile, document)
    spec = with_tables(expanded(spec, document), document)
    runs = (
        {"": NamedRun("", "", "", catalogue.beside(path, spec.scenario, SCENARIO), ())}
        if spec.scenario
        else {}
    )
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
    for problem in problems_of(spec, runs, overridden) if not document.errors else ():
        document.report(*problem)
    document.raise_errors()
    _ = experiment.loaded_sections  # a mistake in a file that they name is told before the runs are made
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
        """Return the entry, which is valid already, with all its texts filled in."""

        def fill(part: Any, name: str = "") -> Any:
            if isinstance(part, BaseModel):
                given = part.model_fields_set - {"for_each"}
                return part.model_copy(update={field: fill(getattr(part, field), field) for field in given})
            if isinstance(part, dict):
                return {k: fill(v, k) for k, v in part.items()}
            if isinstance(part, list):
                return [fill(v, name) for v in part]
            return self.fill(part, sentence=name in SENTENCES) if isinstance(part, str) else part

        return fill(entry).model_copy(update={"for_each": {}}) if self.values else entry


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


def with_tables(spec: ExperimentSpec, document: Document) -> ExperimentSpec:
    """Return the file with the tables of distributions that it names in place of their names."""
    axes = dict(spec.axes)
    for name, axis in spec.axes.items():
        if isinstance(axis.table, str):
            try:
                table = read_table(document.path.parent / axis.table)
            except ValueError as error:
                document.report(("axes", name, "table"), str(error), "file-unreadable")
            else:
                axes[name] = axis.model_copy(update={"table": table})
    return spec.model_copy(update={"axes": axes})


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
        scenario = catalogue.beside(document.path, binding.fill(entry.scenario, "scenario"), SCENARIO)
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
