"""`rank` of the Python library: a ranking of controllers under the conditions of the proving ground."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from yawbench import arguments
from yawbench._controller import Controller, ControllerLike, PythonComponent
from yawbench._run import shown_in_notebooks
from yawbench._run_many import make_all, planner_of
from yawbench._scenario import fmu_of
from yawbench.components.fmi.component import Component
from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import hint
from yawbench.foundation.progress import bar
from yawbench.orchestrator.results.folder_lock import writing
from yawbench.orchestrator.scenario import catalogue
from yawbench.studies.executor import Executor
from yawbench.studies.jobs import Job, OnOutcome, Outcome, run_job
from yawbench.studies.tables import to_pandas

from .ranking import CONTROLLER, EntrySpec, load_ranking
from .ranking_figures import draw_matrix, draw_pareto
from .ranking_scores import RankingResult
from .ranking_tables import columns_of_cells, columns_of_entries
from .whole_ranking import run_whole

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


def rank(
    controller: ControllerLike
    | type[Controller]
    | Mapping[str, ControllerLike | type[Controller]]
    | None = None,
    *,
    name: str = "",
    against: Iterable[str] | None = None,
    conditions: Sequence[str] = (),
    quick: bool = False,
    ranking: str | Path = "proving_ground/ranking",
    out: str | Path | None = None,
    workers: int | None = None,
    progress: bool | None = None,
) -> Ranking:
    """Rank a controller among others under the conditions of a ranking.

        >>> class Gain:
        ...     inputs = ("yaw_rate_ref", "yaw_rate")
        ...     outputs = ("yaw_moment",)
        ...
        ...     def output(self, t, u):
        ...         return 1e5 * (u.yaw_rate_ref - u.yaw_rate)
        >>> places = yb.rank(Gain, against=["none"], conditions=["saloon75"], quick=True)
        >>> places.table[["entry", "passed"]].values.tolist()
        [['Gain', 1], ['none', 0]]

    Args:
        controller: name or path of an FMU, or plain Python as in `Scenario.swap`, or a class of such
            objects, or a mapping of names of entries to these; None: rank only the others.
        name: name of the entry of a single controller; default: the name of the controller.
        against: other entries to rank; default: all of the ranking.
        conditions: of the ranking; default: all.
        quick: run only the last amplitude of a few conditions.
        ranking: a name in a folder of scenarios, or the path of a file.
        out: folder for finished runs, such as that of `yawbench rank`; default: they are not kept.
        workers: number of processes; default: the number of cores. Plain Python runs in this process.
        progress: show a bar; default: in a terminal or a notebook, after two seconds.

    Raises:
        YawbenchError: the controller is invalid, or a run cannot start.
    """
    chosen = arguments.texts(conditions, "conditions", ordered=False)
    others = None if against is None else arguments.texts(against, "against", ordered=False)
    quick = arguments.flag(quick, "quick")
    progress = None if progress is None else arguments.flag(progress, "progress")
    workers = None if workers is None else arguments.count(workers, "workers")
    kept_in = None if out is None else arguments.path(out, "out")
    file = catalogue.find(arguments.path(ranking, "ranking"), "a ranking file")
    more, programs = _entries(controller, arguments.text(name, "name", empty=True))
    loaded = load_ranking(file, more=more, quick=quick, chosen=chosen)
    wanted = set(loaded.entries if others is None else others)
    if unknown := sorted(wanted - set(loaded.entries)):
        raise ScenarioError(
            f"there is no entry {unknown[0]!r}{hint(unknown[0], loaded.entries, lead='known')}",
            code="entry-unknown",
        )
    kept = {key: entry for key, entry in loaded.entries.items() if key in wanted or key in more}
    loaded = replace(loaded, entries=kept)
    with contextlib.ExitStack() as stack:
        shown = stack.enter_context(bar(loaded.spec.title, wanted=progress))
        planner = planner_of(programs)
        folder = Path(kept_in or stack.enter_context(tempfile.TemporaryDirectory()))
        stack.enter_context(writing(folder))

        def runner(jobs: Sequence[Job], on_outcome: OnOutcome) -> None:
            def done(outcome: Outcome) -> None:
                on_outcome(outcome)
                shown.advance()

            shown.extend(len(jobs))
            make_all(jobs, programs, workers=workers, done=done, run=run_job)

        execute = stack.enter_context(
            Executor(folder, loaded.identity, runner, planner, of_jobs={"format": "parquet"})
        )
        return Ranking(run_whole(loaded, execute, keep=out is not None))


def _entries(controller: Any, name: str) -> tuple[dict[str, EntrySpec], dict[Path, PythonComponent]]:
    """Return the entries of controllers by name, and the Python components among them by path."""
    entries: dict[str, EntrySpec] = {}
    programs: dict[Path, PythonComponent] = {}
    if controller is None:
        return entries, programs
    named = {name: controller}
    if isinstance(controller, Mapping):
        named = arguments.mapping(controller, "controller", "a mapping of names to controllers")
        if name:
            raise ScenarioError(
                "name: must not be given for a mapping, which has the names", code="argument-invalid"
            )
    for label, wanted in named.items():
        words, entry, program = _entry(wanted, label)
        entries[words] = entry
        programs |= {program.path: program} if program else {}
    return entries, programs


def _entry(controller: Any, name: str) -> tuple[str, EntrySpec, PythonComponent | None]:
    """Return the name of a controller's entry, the entry, and the Python component, if any."""
    if arguments.names_file(controller):
        fmu = fmu_of(controller, "controller")
        if not (name or Path(fmu).stem):
            raise ScenarioError(f"controller: {fmu!r} is not the name of an FMU", code="controller-invalid")
        return name or Path(fmu).stem, _spec(name or Path(fmu).stem, fmu), None
    if isinstance(controller, type) and not issubclass(controller, Component):
        controller = _object_of(controller)
    program = PythonComponent(controller, instance=CONTROLLER, role=CONTROLLER, label=name)
    words = name or program.path.stem
    sampled = {} if program.step_size is None else {"step_size": program.step_size}
    return words, _spec(words, str(program.path), {**program.parameters, **sampled}), program


def _object_of(kind: type) -> object:
    try:
        return kind()
    except Exception as error:
        reason = f"cannot be created without arguments: {error!r}"
        raise ScenarioError(f"controller: {kind.__name__}: {reason}", code="controller-invalid") from error


def _spec(name: str, fmu: str, parameters: Mapping[str, Any] | None = None) -> EntrySpec:
    own = dict(parameters or {})
    return EntrySpec(title=name, fmu=fmu, parameters=own, source="given to rank", gains="authors")


@dataclass(frozen=True)
class Ranking:
    """Result of a ranking; created by `rank`.

    >>> places = yb.rank(against=["none"], conditions=["hard"], quick=True)
    >>> places.cells[["entry", "condition", "state"]].values.tolist()
    [['none', 'hard', 'failed']]
    """

    _ranked: RankingResult

    @cached_property
    def table(self) -> pd.DataFrame:
        """Table with a row per controller, the best first; `attrs["units"]` has the units."""
        return to_pandas(columns_of_entries(self._ranked))

    @cached_property
    def cells(self) -> pd.DataFrame:
        """Table with a row per controller and condition."""
        return to_pandas(columns_of_cells(self._ranked))

    def place(self, name: str) -> int | None:
        """Return the rank of an entry, from 1; None if runs of it are missing.

        Raises:
            ScenarioError: the entry is unknown.
        """
        name = arguments.text(name, "name of an entry")
        places = {score.entry: score.place for score in self._ranked.scores}
        if name not in places:
            raise ScenarioError(
                f"there is no entry {name!r}{hint(name, places, lead='known')}", code="entry-unknown"
            )
        return places[name]

    def plot(self, kind: Literal["matrix", "pareto"] = "matrix") -> Figure:
        """Return a figure: `matrix` (who passes what) or `pareto` (stability over intervention).

        Raises:
            ScenarioError: the kind is unknown.
        """
        drawn = {"matrix": draw_matrix, "pareto": draw_pareto}
        chosen = arguments.text(kind, "kind")
        if chosen not in drawn:
            raise ScenarioError(
                f"kind: there is no figure {chosen!r}{hint(chosen, drawn, lead='known')}",
                code="figure-unknown",
            )
        return shown_in_notebooks(drawn[chosen](self._ranked, "yawbench.rank"))

    def __repr__(self) -> str:
        rows, columns = self._ranked.scores, self._ranked.ranking.conditions
        return f"<Ranking of {len(rows)} controllers in {len(columns)} conditions>"

    def _repr_html_(self) -> str:
        shown = self.table[["place", "title", "passed", "spun", "share", "headroom", "sideslip"]]
        return str(shown.to_html(index=False, na_rep=""))
