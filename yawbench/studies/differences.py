"""What differs between the results of two experiments: verdicts, numbers, runs, FMUs.

Read from what a study or sweep writes: `table.csv` and `experiment.json`.
"""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from yawbench.figures.display import digits_apart, shown
from yawbench.foundation.errors import ResultsError
from yawbench.foundation.messages import counted, listed
from yawbench.foundation.safe_files import PACKED, read_bytes, reading

from .result_files import RECORD, TABLE
from .tables import Column, Table

MOST = 40
"""Most numbers that are printed. Chosen: a screen; all are in the JSON object."""
JUDGED = ("claims", "checks")
AFTER = "status"
"""The first column of a table after those that tell its rows apart."""
ABOUT_RUN = (AFTER, "reason", "warnings", "key")
"""Columns that are not metrics."""


@dataclass(frozen=True)
class Recorded:
    """Results of an experiment as they are on disk.

    Attributes:
        record: content of `experiment.json`.
        rows: (run, levels) -> metric -> cell of `table.csv`, and `status`, `reason`, `key`.
        units: metric -> SI unit, "1" if it has none.
    """

    record: Mapping[str, Any]
    rows: Mapping[tuple[str, ...], Mapping[str, str]]
    units: Mapping[str, str]


@dataclass(frozen=True)
class NumberPair:
    """A metric of a run, or a derived number, in both experiments; None where there is no value."""

    run: str
    name: str
    unit: str
    first: float | None
    second: float | None

    @property
    def difference(self) -> float | None:
        """Second less first."""
        return None if self.first is None or self.second is None else self.second - self.first

    @property
    def relative(self) -> float | None:
        """The difference as a share of the larger of the two."""
        if self.difference is None or self.first is None or self.second is None:
            return None
        size = max(abs(self.first), abs(self.second))
        return self.difference / size if size and math.isfinite(size) else None

    def as_data(self) -> dict[str, Any]:
        """Return the pair for programs, in SI units."""
        return {**self.__dict__, "difference": self.difference, "relative": self.relative}


@dataclass(frozen=True)
class Differences:
    """What differs between two experiments."""

    compared: int  # numbers
    judged: int  # claims and checks in both
    claims: list[dict[str, Any]]  # with another verdict
    numbers: list[NumberPair]  # that differ, the largest relative difference first
    statuses: list[tuple[str, str, str]]  # run, its status in both; "" if it is not there
    fmus: list[str]  # names of FMUs with other content

    @property
    def none(self) -> bool:
        """Whether nothing differs."""
        return not (self.claims or self.numbers or self.statuses or self.fmus)

    @property
    def compares_nothing(self) -> bool:
        """Whether the experiments have nothing in common."""
        return not (self.compared or self.judged)

    def as_data(self) -> dict[str, Any]:
        """Return the differences for programs."""
        return {
            "identical": self.none and not self.compares_nothing,
            "compared": {"numbers": self.compared, "claims": self.judged},
            "claims": self.claims,
            "numbers": [pair.as_data() for pair in self.numbers],
            "runs": [{"run": run, "first": ours, "second": theirs} for run, ours, theirs in self.statuses],
            "fmus": self.fmus,
        }


def is_experiment(folder: Path) -> bool:
    """Return whether a folder has the results of a study or sweep."""
    return (folder / RECORD).is_file() and (folder / TABLE[0]).is_file()


def recorded_in(folder: Path) -> Recorded:
    """Read the results of an experiment.

    Raises:
        ResultsError: they cannot be read.
    """
    with reading("record of a study", folder / RECORD, ResultsError):
        record = json.loads(read_bytes(folder / RECORD, largest=PACKED))
        if not isinstance(record, dict) or not {"runs", "derived", *JUDGED} <= record.keys():
            raise ResultsError(f"{folder / RECORD}: is not the record of a study or sweep")
    with reading("table of a study", folder / TABLE[0], ResultsError):
        text = read_bytes(folder / TABLE[0], largest=PACKED).decode("utf-8")
        headings, *lines = csv.reader(text.splitlines())
        split = [re.fullmatch(r"(.*?)(?: \[(.*)\])?", heading) for heading in headings]
        names = [match[1] for match in split if match]
        units = {match[1]: match[2] or "1" for match in split if match}
        end = names.index(AFTER)
        begin = 1 if end > 1 and all(line[0].isdecimal() for line in lines) else 0  # numbers of rows
        rows = {tuple(line[begin:end]): dict(zip(names[end:], line[end:], strict=True)) for line in lines}
        if len(rows) < len(lines):  # repeats that no level tells apart
            rows = {tuple(line[:end]): dict(zip(names[end:], line[end:], strict=True)) for line in lines}
    return Recorded(record, rows, units)


def differences(first: Recorded, second: Recorded) -> Differences:
    """Return what differs between two experiments."""
    pairs = [*_metrics(first, second), *_derived(first, second)]
    apart = [pair for pair in pairs if pair.first != pair.second]
    statuses = []
    for key in dict.fromkeys((*first.rows, *second.rows)):
        ours, theirs = (one.rows.get(key, {}).get(AFTER, "") for one in (first, second))
        if ours != theirs:
            statuses.append((", ".join(key), ours, theirs))
    judged = [(ours, theirs) for group in JUDGED for ours, theirs in _common(first, second, group)]
    theirs_of = _fmus(second)
    return Differences(
        len(pairs),
        len(judged),
        [
            {
                "says": ours["says"],
                **{
                    f"{key}_{which}": one[key]
                    for key in ("verdict", "measured", "margin")
                    for which, one in (("first", ours), ("second", theirs))
                },
            }
            for ours, theirs in judged
            if ours["verdict"] != theirs["verdict"]
        ],
        sorted(apart, key=lambda pair: -abs(pair.relative) if pair.relative is not None else -math.inf),
        statuses,
        sorted(name for name, ours in _fmus(first).items() if theirs_of.get(name, ours) != ours),
    )


def _metrics(first: Recorded, second: Recorded) -> Iterable[NumberPair]:
    for key, ours in first.rows.items():
        theirs = second.rows.get(key, {})
        for name in ours.keys() & theirs.keys() - {*ABOUT_RUN}:
            yield NumberPair(
                ", ".join(key), name, first.units[name], *(_number(cells[name]) for cells in (ours, theirs))
            )


def _number(cell: str) -> float | None:
    return float(cell) if cell else None


def _derived(first: Recorded, second: Recorded) -> Iterable[NumberPair]:
    for key, ours in first.record["derived"].items():
        if theirs := second.record["derived"].get(key):
            values = (None if one["value"] is None else float(one["value"]) for one in (ours, theirs))
            yield NumberPair("", ours["says"], ours.get("unit") or theirs.get("unit") or "1", *values)


def _common(first: Recorded, second: Recorded, group: str) -> Iterable[tuple[Any, Any]]:
    """Yield the claims or checks of both that say the same, in order where several do."""
    left = [*second.record[group]]
    for ours in first.record[group]:
        theirs = next((one for one in left if one["says"] == ours["says"]), None)
        if theirs is not None:
            left.remove(theirs)
            yield ours, theirs


def _fmus(one: Recorded) -> dict[str, set[str]]:
    """Return name of FMU -> SHA-256 of all that have it."""
    found: dict[str, set[str]] = {}
    for run in one.record["runs"].values():
        for name, digest in run["fmus"].items():
            found.setdefault(name, set()).add(digest)
    return found


def difference_tables(found: Differences, first: str, second: str) -> list[Table]:
    """Return the tables of what differs; `first`, `second`: labels of the experiments."""
    tables = []
    if found.claims:
        rows = [
            [
                one["says"],
                *(one[f"verdict_{which}"] for which in ("first", "second")),
                *("; ".join(one[f"measured_{which}"]) for which in ("first", "second")),
            ]
            for one in found.claims
        ]
        headings = ["claim", first, second, f"measured, {first}", f"measured, {second}"]
        tables.append(Table("Claims with another verdict", headings, rows))
    if found.statuses:
        cells = [[run, ours or "-", theirs or "-"] for run, ours, theirs in found.statuses[:MOST]]
        tables.append(Table("Runs with another status", ["run", first, second], cells))
    if found.numbers:
        tables.append(_numbers_table(found, first, second))
    if found.fmus and tables:
        tables[-1].notes.append(f"FMUs with other content: {listed(found.fmus)}")
    return tables


def _numbers_table(found: Differences, first: str, second: str) -> Table:
    rows = []
    for pair in found.numbers[:MOST]:
        both = pair.first is not None and pair.second is not None
        digits = digits_apart([(pair.first or 0.0, pair.second or 0.0)] if both else [], pair.unit)
        numbers = [
            "-" if x is None else shown(x, pair.unit, digits=digits) for x in (pair.first, pair.second)
        ]
        by = "-" if pair.relative is None else shown(pair.relative, "%")
        rows.append([pair.run, pair.name, *numbers, by])
    title = f"{len(found.numbers)} of {counted(found.compared, 'number')} differ"
    columns = [
        Column("run"),
        Column("number"),
        *(Column(name, number=True) for name in (first, second, "by")),
    ]
    more = len(found.numbers) - len(rows)
    return Table(title, columns, rows, [f"{more} more, with smaller differences"] if more else [])
