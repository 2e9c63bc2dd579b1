"""`yawbench sweep`: one scenario over many conditions."""

from __future__ import annotations

import contextlib
import functools
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .batch import Jobs
from .options import CallLimit, Fmus, Format, Isolate, NoBuild, Out, Set, Swap, isolation, named

if TYPE_CHECKING:
    from ..studies.jobs import Outcome
    from ..sweeps.planning import Planned
    from ..sweeps.run_sweep import Runner

SweepFile = Annotated[
    Path, named("a sweep file", help="Sweep: YAML file, or a name in scenarios/.", metavar="SWEEP")
]
Scheduler = Annotated[
    str | None,
    typer.Option("--scheduler", metavar="ADDRESS", help="Run on a Dask cluster: tcp://host:port."),
]
Keep = Annotated[
    bool, typer.Option("--keep", help="Keep the results of every run, in runs/<its key in the table>.")
]
Fresh = Annotated[bool, typer.Option("--fresh", help="Make all runs anew, those too that are finished.")]
SHOWN = 10
"""Failed runs named on the terminal; all are in the table."""


def sweep(
    context: typer.Context,
    file: SweepFile,
    swap: Swap = None,
    set_: Set = None,
    out: Out = None,
    fmus: Fmus = None,
    no_build: NoBuild = False,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    keep: Keep = False,
    format_: Format = "csv",
    fresh: Fresh = False,
    isolate: Isolate = False,
    call_limit: CallLimit = None,
) -> None:
    """Run a scenario over a grid, list or Latin hypercube.

    Its metrics become a table, limits, curves and maps. Without --out, results go to
    results/<folder of the sweep file>/<its name>: sweep.parquet, one row per run; sweep.md;
    figures. Every run has a process of its own. An interrupted sweep goes on where it was; nothing
    that is finished is run again.
    """
    from ..fmu.opener import stale_fmus
    from ..results.formats import check_format
    from ..results.naming import default_folder
    from ..scenario.overrides import read_changes
    from ..studies.jobs import pool
    from ..sweeps.journal import Journal
    from ..sweeps.planning import plan_sweep
    from ..sweeps.report import REPORT, findings_text, limit_tables, write_sweep
    from ..sweeps.run_sweep import finish, left_to_do
    from ..sweeps.sweep_file import load_sweep
    from ..sweeps.table import Swept, point_text
    from ..titles import changed
    from .batch import hold, print_tables, say, stoppable

    check_format(format_)
    limit = isolation(isolate, call_limit)
    given = read_changes(swap or (), set_ or ())
    loaded = load_sweep(file, changes=given)
    folder = out or default_folder(file, given)
    hold(context, folder)
    with stoppable(folder):
        with _bar("planning", len(loaded.points), quiet=True) as planning:
            planned = plan_sweep(
                loaded, folder / "runs", fmus, call_limit=limit, build=not no_build, progress=planning
            )
        for note in stale_fmus(planned.fmus.values()):
            say(f"note: {note}")
        runner = _runner(planned, jobs, scheduler)
        with contextlib.closing(Journal(folder, loaded.identity, fresh=fresh)) as journal:
            left = left_to_do(planned, journal.records, keep=keep, format=format_)
            total = len({run.key for run in planned.runs})
            say(f"{len(planned.runs)} runs{_finished(total - len(left), total)}")
            if loaded.by_options:
                say(f"changed: {changed(loaded.by_options)}")
            with _bar(loaded.path.stem, total, total - len(left)) as progress:
                finish(left, journal, runner=runner, told=_counted(progress, total - len(left)))
            swept = Swept(planned, dict(journal.records))
            with pool(jobs) as workers:
                problems = write_sweep(swept, folder, each=workers.map)
    for problem in problems:
        say(problem)
    print_tables(limit_tables(swept))
    for run in swept.failed[:SHOWN]:
        say(f"{point_text(planned, run)} failed: {'; '.join(swept.record(run).problems)}")
    if len(swept.failed) > SHOWN:
        say(f"{len(swept.failed) - SHOWN} more failed")
    if found := findings_text(swept):
        say(f"note: {found}")
    say(f"Table and figures: {folder} (begin with {folder / REPORT})")
    if swept.failed:
        raise typer.Exit(1)


def _runner(planned: Planned, workers: int | None, scheduler: str | None) -> Runner:
    """Return where runs are made.

    Raises:
        ScenarioError: the package that a cluster needs is missing.
    """
    from ..errors import ScenarioError
    from ..sweeps.local import run_here

    if scheduler is None:
        return functools.partial(run_here, workers=workers)
    try:
        from ..sweeps.cluster import run_on_cluster
    except ImportError:
        raise ScenarioError(
            "--scheduler needs the package distributed: pip install 'yawbench[cluster]'"
        ) from None
    return functools.partial(run_on_cluster, scheduler=scheduler, fmus=planned.fmus)


def _finished(done: int, total: int) -> str:
    if not done:
        return ""
    return ", all finished before" if done == total else f", {done} finished before"


def _counted(progress: Callable[[int], None], done: int) -> Callable[[Outcome], None]:
    count = done

    def told(outcome: Outcome) -> None:
        nonlocal count
        count += 1
        progress(count)

    return told


@contextlib.contextmanager
def _bar(title: str, total: int, done: int = 0, *, quiet: bool = False) -> Iterator[Callable[[int], None]]:
    """Show progress and the time left: a bar on a terminal, elsewhere a line now and then, or none."""
    if not sys.stderr.isatty() or os.environ.get("TERM") == "dumb":
        yield (lambda count: None) if quiet else _lines(total, done)
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("left"),
        TimeRemainingColumn(), TextColumn("so far"), TimeElapsedColumn(),
    )  # fmt: skip
    # time left from the pace of the last runs; they differ less than their number
    with Progress(*columns, console=Console(stderr=True), transient=True, speed_estimate_period=120) as bar:
        task = bar.add_task(title.replace("[", r"\["), total=total, completed=done)
        yield lambda count: bar.update(task, completed=count)


def _lines(total: int, done: int) -> Callable[[int], None]:
    """Return what writes a line for every tenth of the runs that are left."""
    import time

    from .batch import say

    began, last = time.monotonic(), done

    def told(count: int) -> None:
        nonlocal last
        if count < total and 10 * (count - last) < total - done:
            return
        last = count
        left = (time.monotonic() - began) / (count - done) * (total - count)
        say(f"[{count:{len(str(total))}}/{total}]" + (f" {left:.0f} s left" if count < total else ""))

    return told
