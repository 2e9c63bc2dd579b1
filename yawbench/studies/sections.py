"""Sections of experiment files that parts of yawbench add, such as runs compared with measured cars.

A part registers what it adds as a plug-in, under the key of the section:

    PLUGINS = {"section of a study": {"validations": "yawbench.measured_cars.of_studies:VALIDATIONS"}}
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from yawbench.foundation import plugins
from yawbench.orchestrator.scenario.schema_validation import StrictModel

if TYPE_CHECKING:
    from yawbench.orchestrator.results.reader import Results

    from .tables import Table

KIND = "section of a study"


@dataclass(frozen=True)
class Section:
    """A list of entries, each about a named run.

    Attributes:
        entry: schema of an entry; `claim_schema.RunName` marks the name of its run.
        says: description of the section.
        load: reads the files that entries name, relative to a folder; its errors are told before any run.
        compare: returns findings on the runs that have results, from these and what was loaded; a finding has
            `as_data()` for the record of the study.
        table: returns the table of a finding.
        view: returns what a page shows of a finding, from it and the anchor of its viewer.
    """

    entry: type[StrictModel]
    says: str
    load: Callable[[Sequence[Any], Path], Any]
    compare: Callable[[Mapping[str, Results], Any], list[Any]]
    table: Callable[[Any], Table]
    view: Callable[[Any, str], Any]


@cache
def sections() -> dict[str, Section]:
    """Return the sections of all parts, by their keys."""
    return {name: plugins.require(KIND, name) for name in plugins.names(KIND)}
