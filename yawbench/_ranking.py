"""Ranking of a controller among others under the conditions of the proving ground."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from components.fmi.component import Component
from orchestrator.errors import ScenarioError
from orchestrator.experiments.execution import Executor
from orchestrator.experiments.jobs import Job, OnOutcome, run_job
from orchestrator.experiments.ranking import CONTROLLER, EntrySpec, load_ranking
from orchestrator.experiments.ranking_scores import RankingResult, run_ranking
from orchestrator.experiments.ranking_tables import (
    columns_of_cells,
    columns_of_entries,
    draw_matrix,
    draw_pareto,
)
from orchestrator.experiments.record import to_pandas
from orchestrator.messages import hint
from orchestrator.planner import Planner
from orchestrator.results.lock import writing
from orchestrator.scenario import catalogue

from . import arguments
from ._calls import make_all
from ._controller import Controller, ControllerLike, PythonComponent
from ._run import shown_in_notebooks
from ._scenario import fmu_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


def rank(
    controller: ControllerLike | type[Controller] | None = None,
    *,
    name: str = "",
    against: Iterable[str] | None = None,
    conditions: Sequence[str] = (),
    quick: bool = False,
    ranking: str | Path = "proving_ground/ranking",
    out: str | Path | None = None,
    workers: int | None = None,
) -> Ranking:
    """Drive a controller and others through the conditions of a ranking and return where they stand.

        >>> class Gain:
        ...     inputs = ("yaw_rate_ref", "yaw_rate")
        ...     outputs = ("yaw_moment",)
        ...
        ...     def output(self, t, u):
        ...         return 1e5 * (u.yaw_rate_ref - u.yaw_rate)
        >>> places = yb.rank(Gain, against=["none"], conditions=["saloon75"], quick=True)
        >>> places.place("Gain"), places.place("none")
        (1, 2)

    Args:
        controller: the name or path of an FMU, or plain Python: what `Scenario.swap` takes, or a class whose
            objects are; None: rank the others alone.
        name: of its entry; default: its own.
        against: entries that are driven, too; default: all of the ranking.
        conditions: of the ranking; default: all.
        quick: the last amplitude of few conditions.
        ranking: a name in a folder of scenarios, or the path of a file.
        out: folder that keeps finished runs, such as that of `yawbench rank`; default: none is kept.
        workers: processes at a time; default: one per core. Plain Python is run in this one.

    Raises:
        YawbenchError: the controller is none, or a run cannot start.
    """
    chosen = arguments.texts(conditions, "conditions", ordered=False)
    others = None if against is None else arguments.texts(against, "against", ordered=False)
    quick = arguments.flag(quick, "quick")
    workers = None if workers is None else arguments.count(workers, "workers")
    kept_in = None if out is None else arguments.path(out, "out")
    file = catalogue.find(arguments.path(ranking, "ranking"), "a ranking file")
    more, programs = _entry(controller, arguments.text(name, "name", empty=True))
    loaded = load_ranking(file, more=more, quick=quick, chosen=chosen)
    wanted = set(loaded.entries if others is None else others)
    if unknown := sorted(wanted - set(loaded.entries)):
        raise ScenarioError(
            f"there is no entry {unknown[0]!r}{hint(unknown[0], loaded.entries, lead='known')}",
            code="entry-unknown",
        )
    kept = {key: one for key, one in loaded.entries.items() if key in wanted or key in more}
    loaded = replace(loaded, entries=kept)
    opened = {path: program.fmu for path, program in programs.items()}
    planner = Planner(build=True, tell=lambda text: None, opened=opened)
    with contextlib.ExitStack() as stack:
        folder = Path(kept_in or stack.enter_context(tempfile.TemporaryDirectory()))
        stack.enter_context(writing(folder))

        def runner(jobs: Sequence[Job], told: OnOutcome) -> None:
            make_all(jobs, programs, workers=workers, done=told, run=run_job)

        execute = stack.enter_context(
            Executor(folder, loaded.identity, runner, planner, of_jobs={"format": "parquet"})
        )
        return Ranking(run_ranking(loaded, execute, keep=out is not None))


def _entry(given: Any, name: str) -> tuple[dict[str, EntrySpec], dict[Path, PythonComponent]]:
    """Return the entry of a controller by its name, and its Python component, if any, by its path."""
    if given is None:
        return {}, {}
    if arguments.names_file(given):
        fmu = fmu_of(given, "controller")
        if not (name or Path(fmu).stem):
            raise ScenarioError(f"controller: {fmu!r} is no name of an FMU", code="controller-invalid")
        return {name or Path(fmu).stem: _spec(name or Path(fmu).stem, fmu)}, {}
    if arguments.is_a(given, type) and not issubclass(given, Component):
        given = _object_of(given)
    program = PythonComponent(given, unit=CONTROLLER, role=CONTROLLER)
    words = name or program.path.stem
    return {words: _spec(words, str(program.path))}, {program.path: program}


def _object_of(given: type) -> object:
    try:
        return given()
    except Exception as error:
        said = f"no object can be made of it without arguments: {error!r}"
        raise ScenarioError(f"controller: {given.__name__}: {said}", code="controller-invalid") from error


def _spec(name: str, fmu: str) -> EntrySpec:
    return EntrySpec(title=name, fmu=fmu, parameters={}, source="given to rank", gains="authors")


@dataclass(frozen=True)
class Ranking:
    """Where controllers stand; made by `rank`.

    >>> places = yb.rank(against=["none"], conditions=["hard"], quick=True)
    >>> places.cells[["entry", "condition", "state"]].values.tolist()
    [['none', 'hard', 'failed']]
    """

    __module__ = "yawbench"

    ranked: RankingResult

    def __post_init__(self) -> None:
        arguments.instance(self.ranked, "ranked", RankingResult, "yawbench.rank")

    @cached_property
    def table(self) -> pd.DataFrame:
        """One row per controller, the first place first; `attrs["units"]` holds the units."""
        return to_pandas(columns_of_entries(self.ranked))

    @cached_property
    def cells(self) -> pd.DataFrame:
        """One row per controller and condition."""
        return to_pandas(columns_of_cells(self.ranked))

    def place(self, name: str) -> int | None:
        """Return the place of an entry, None if it lacks runs.

        Raises:
            ScenarioError: there is no such entry.
        """
        name = arguments.text(name, "name of an entry")
        places = {one.entry: one.place for one in self.ranked.scores}
        if name not in places:
            raise ScenarioError(
                f"there is no entry {name!r}{hint(name, places, lead='known')}", code="entry-unknown"
            )
        return places[name]

    def plot(self, kind: Literal["matrix", "pareto"] = "matrix") -> Figure:
        """Return a picture: `matrix`, who passes what, or `pareto`, stability over intervention.

        Raises:
            ScenarioError: there is no such picture.
        """
        drawn = {"matrix": draw_matrix, "pareto": draw_pareto}
        chosen = arguments.text(kind, "kind")
        if chosen not in drawn:
            raise ScenarioError(
                f"there is no picture {chosen!r}{hint(chosen, drawn, lead='known')}", code="figure-unknown"
            )
        return shown_in_notebooks(drawn[chosen](self.ranked, "yawbench.rank"))

    def __repr__(self) -> str:
        rows, columns = self.ranked.scores, self.ranked.ranking.conditions
        return f"<Ranking of {len(rows)} controllers in {len(columns)} conditions>"

    def _repr_html_(self) -> str:
        shown = self.table[["place", "title", "passed", "spun", "share", "margin", "sideslip"]]
        return str(shown.to_html(index=False, na_rep=""))
