"""Entries with `for`: the runs, claims, checks and derived numbers that each of them stands for."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from ..plan import Change
from ..scenario import yaml_lines
from ..scenario.yaml_lines import Document, Key
from ..wording import hint, short
from .changes import changes_of_file
from .judged_schema import Claim, DerivedSpec
from .schema import ChoiceSpec, ExperimentSpec, RunSpec

FIGURES = "figures"
"""Folder of the figures, beside those of named runs."""
SENTENCES = ("says", "short", "source", "note")
"""Fields of claims and derived numbers that are for people."""
MOST = 10_000
"""Runs that are named. Chosen: a hundred times the largest of ours; all stand in one report."""
LONGEST = 100
"""Characters of a run's folder. Chosen: more do not fit into file names where a letter takes two bytes."""
_FOLDER = re.compile(rf"[\w.+-]{{1,{LONGEST}}}")
Texts = TypeVar("Texts", Claim, DerivedSpec)


@dataclass(frozen=True)
class NamedRun:
    """One run of an experiment, wherever it stands on the axes."""

    name: str  # "" if there is only one
    label: str
    row: str
    scenario: Path
    changes: tuple[Change, ...]


@dataclass(frozen=True)
class Filling:
    """One of those that an entry stands for: what is in the place of its words in braces."""

    document: Document
    key: Key  # of the entry
    values: dict[str, str]  # in names
    words: dict[str, str]  # in sentences
    choices: list[ChoiceSpec]  # what the values of a run bring along

    def fill(self, text: str, *where: str, sentence: bool = False) -> str:
        """Return a text of the entry, `where` it stands there, with what its words in braces stand for."""
        use = self.words if sentence else self.values
        for word in re.findall(r"\{([^{}]*)\}", text):
            if word not in use:
                guess = hint(word, use, lead="'for' has")
                self.document.report((*self.key, *where), f"{{{word}}} stands for nothing{guess}")
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
        given = entry.model_dump(by_alias=True, exclude_defaults=True, exclude={"for_each"})
        return type(entry).model_validate(fill(given))


def fillings(
    document: Document, key: Key, for_each: Mapping[str, Mapping[str, Any]], what: str
) -> Iterator[Filling]:
    """Yield every combination of a `for`; none of too many."""
    number = math.prod(map(len, for_each.values()))
    if number > MOST:
        document.report((*key, "for"), f"stands for {number} {what}; at most {MOST} are taken")
        return
    for combination in itertools.product(*(choices.items() for choices in for_each.values())):
        words, choices = {}, []
        for name, (value, chosen) in zip(for_each, combination, strict=True):
            if isinstance(chosen, ChoiceSpec):
                choices.append(chosen)
                chosen = chosen.says or value
            words[name] = chosen
        values = dict(zip(for_each, (value for value, _ in combination), strict=True))
        yield Filling(document, key, values, words, choices)


def expanded(spec: ExperimentSpec, document: Document) -> ExperimentSpec:
    """Return the file with one claim, check or derived number for each that an entry stands for."""
    derived: dict[str, DerivedSpec] = {}
    for name, number in spec.derived.items():
        key: Key = ("derived", name)
        for one in fillings(document, key, number.for_each, "numbers"):
            made = one.fill(name) if number.for_each else name
            if made in derived:
                document.report(key, f"there is already a derived number {made!r}")
            derived[made] = one.filled(number)
    said: dict[str, list[Claim]] = {"claims": [], "checks": []}
    for group, every in said.items():
        for i, claim in enumerate(getattr(spec, group)):
            for one in fillings(document, (group, i), claim.for_each, group):
                every.append(one.filled(claim))
                every[-1]._number = i
    return spec.model_copy(update={"derived": derived, **said})


def named_runs(document: Document, i: int, entry: RunSpec) -> Iterator[NamedRun]:
    """Yield the runs that the i-th entry stands for, none if it is wrong."""
    key: Key = ("runs", i)
    folder, known = document.path.parent, len(document.problems)
    for one in fillings(document, key, entry.for_each, "runs"):
        name = one.fill(entry.name, "name")
        _check_folder(name, one)
        changes: dict[str, Change] = {}
        for part in (entry, *one.choices):
            swaps = {unit: one.fill(fmu, "swap", unit) for unit, fmu in part.swap.items()}
            settings = {
                place: yaml_lines.scalar(one.fill(value, "set", place)) if isinstance(value, str) else value
                for place, value in part.set.items()
            }
            filled = part.model_copy(update={"swap": swaps, "set": settings})
            for change in changes_of_file(filled, folder, "study"):
                if change.place in changes:
                    document.report((*key, "for"), f"{change.place} is given twice")
                changes[change.place] = change
        label = one.fill(entry.label, "label", sentence=True) or name
        row = one.fill(entry.row, "row", sentence=True) or label
        scenario = folder / one.fill(entry.scenario, "scenario")
        if len(document.problems) > known:
            return
        yield NamedRun(name, label, row, scenario, tuple(changes.values()))


def _check_folder(name: str, one: Filling) -> None:
    """Report a name that cannot be that of a folder."""
    parts = name.split("/")
    if all(_FOLDER.fullmatch(part) and part.strip(".") for part in parts) and parts[0] != FIGURES:
        return
    sentence = f"{short(name)} cannot name a run: use letters, digits, . _ + - and / between folders"
    if any(len(part) > LONGEST for part in parts):
        sentence = f"{short(name)} is too long: at most {LONGEST} characters between two /"
    one.document.report((*one.key, "name"), sentence)
