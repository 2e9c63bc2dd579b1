"""`yawbench second-opinion`: the same scenario in masters that others wrote."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .batch import print_tables, say
from .options import CHANGES, ScenarioFile, Wishes, takes
from .planning import plan_of_scenario

if TYPE_CHECKING:
    from ..interop.second_opinion import Opinion

Masters = Annotated[
    list[str] | None,
    typer.Option("--master", metavar="NAME", help="libcosim, Ecos or fmpy; repeatable. Default: all."),
]
Pinned = Annotated[
    bool, typer.Option("--one-core/--no-one-core", help="Measure every master also on one processor core.")
]


@takes(*CHANGES, "fmus", "no_build")
def second_opinion(
    scenario: ScenarioFile, wishes: Wishes, master: Masters = None, one_core: Pinned = True
) -> None:
    """Run a scenario in libcosim, Ecos and fmpy, and compare.

    Every signal, and the time per step. Exit status 1 if one that should agree does not: libcosim
    and Ecos run what `jacobi` runs here.
    """
    from ..errors import ScenarioError, SimulationError
    from ..interop.second_opinion import MASTERS, second_opinion
    from ..titles import changed, faults_of
    from ..wording import hint

    known = {one.title.lower(): one for one in MASTERS}
    for name in master or ():
        if name.lower() not in known:
            raise ScenarioError(f"--master {name}: there is no such master{hint(name, known, lead='known')}")
    chosen = [known[name.lower()] for name in master or known]
    plan = plan_of_scenario(scenario, wishes)
    if plan.faults:
        raise ScenarioError(f"{scenario}: other masters know nothing of faults; leave out {faults_of(plan)}")
    if plan.changes:
        say(f"changed: {changed(plan.changes)}")
    with tempfile.TemporaryDirectory(prefix="yawbench-") as folder:
        try:
            opinions = second_opinion(
                plan,
                Path(folder),
                masters=chosen,
                pinned=one_core,
                said=lambda text: say(f"running in {text}"),
            )
        except RuntimeError as error:
            raise SimulationError(str(error), unit=None, time=0.0) from None
    show(opinions)
    wrong = [one for one in opinions if not one.agrees and one.master.title != "fmpy"]
    if wrong:
        names = " and ".join(one.master.title for one in wrong)
        raise SimulationError(f"{scenario}: no agreement with {names}, see above", unit=None, time=0.0)


def show(opinions: list[Opinion]) -> None:
    """Print the differences by signal, the times per step, and what has to be known."""
    from ..experiments.tables import Table
    from ..wording import printable

    found = [one for one in opinions if not one.problem]
    if found:
        names = [one.master.title for one in found]
        columns = set(range(1, len(found) + 1))
        apart = Table("Largest difference / range", ["signal", *names], numbers=columns)
        for signal in found[0].differences:
            apart.rows.append([signal, *(f"{one.differences[signal]:.1e}" for one in found)])
        apart.rows.append(["largest", *(f"{one.largest:.1e}" for one in found)])
        keys = list(found[0].seconds)
        times = Table("us per communication step", ["master", *keys], numbers=set(range(1, len(keys) + 1)))
        for one in found:
            times.rows.append([one.master.title, *(f"{1e6 * one.seconds[key]:.0f}" for key in keys)])
        print_tables([apart, times])
        _show_still(found[0])
    for one in opinions:
        if one.problem:
            print(printable(f"{one.master.title}: {one.problem}"))
        elif one.one_step or one.master.note:
            step = "compared with one step for all units: " if one.one_step else ""
            print(printable(f"{one.master.title}: {step}{one.master.note}"))


def _show_still(one: Opinion) -> None:
    """Say of how many signals the comparison says little, since they do not change during the run."""
    from ..wording import counted, fold, listed, printable

    if one.still:
        share = f"{len(one.still)} of {counted(len(one.differences), 'signal')}"
        names = listed(fold(list(one.still)))
        print(printable(f"Constant during the run, so their agreement says little: {share}, {names}."))
