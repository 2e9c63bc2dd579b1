"""`yawbench run`: run a scenario."""

from __future__ import annotations

import contextlib
import os
import sys
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path

from .options import Fmus, Out, ScenarioFile, Set, Swap

SHOWN = 5
"""Warnings shown; all are in run.json."""
BESIDE = 36
"""Columns of a terminal that the title leaves to the bar and its numbers."""


def run(
    scenario: ScenarioFile, swap: Swap = None, set_: Set = None, out: Out = None, fmus: Fmus = None
) -> None:
    """Run a scenario and write results.csv and run.json.

    Without --out, results go to results/<folder of the scenario>/<its name>; those of an earlier run
    there are replaced.
    """
    from ..master.simulate import simulate
    from ..scenario.load import load_scenario
    from ..wiring.make_plan import make_plan

    plan = make_plan(load_scenario(scenario, swaps=swap or (), settings=set_ or ()), fmus=fmus)
    for note in plan.notes:
        _say(f"note: {note}")
    folder = out or default_folder(scenario)
    with _bar(plan.title or scenario.stem) as progress:
        info = simulate(plan, folder, progress=progress)
    for message in info.warnings[:SHOWN]:
        _say(f"warning: {message.unit} at t = {message.time:.9g} s: {message.text}")
    if len(info.warnings) > SHOWN:
        _say(f"warning: {len(info.warnings) - SHOWN} more, see {folder / 'run.json'}")
    _say(f"{folder}: {info.rows} rows of {info.columns} variables in {info.wall_time:.2f} s")


def default_folder(scenario: Path) -> Path:
    """Return where the results of a scenario file go if nothing else is said."""
    return Path("results", scenario.absolute().parent.name, scenario.stem)


def _say(text: str) -> None:
    print(text, file=sys.stderr)


@contextlib.contextmanager
def _bar(title: str) -> Iterator[Callable[[int, int], None] | None]:
    """Show a progress bar on a terminal while the block runs, and nothing elsewhere.

    It draws when it is told how far the run is. A bar with a thread of its own would take the
    interpreter lock away from the units.
    """
    if not sys.stderr.isatty() or os.environ.get("TERM") == "dumb":
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, auto_refresh=False, transient=True) as bar:
        shown = textwrap.shorten(title, max(10, console.width - BESIDE), placeholder="…")
        task = bar.add_task(shown.replace("[", r"\["), total=None)

        def report(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total, refresh=True)

        yield report
