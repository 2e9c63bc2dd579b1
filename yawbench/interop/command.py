"""`yawbench second-opinion`, `export-ssp`, `export-fmu`: a scenario in other masters, as SSP, as one FMU."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from yawbench.commands.json_and_latex import tabular
from yawbench.commands.options import CHANGES, RunOptions, ScenarioFile, plan_of_scenario, takes
from yawbench.commands.output import print_tables
from yawbench.commands.terminal_progress import say
from yawbench.foundation.errors import ScenarioError, SimulationError
from yawbench.foundation.messages import counted, fold, hint, listed, printable

if TYPE_CHECKING:
    from yawbench.orchestrator.plan import Plan

    from .second_opinion import SecondOpinion


Masters = Annotated[
    list[str] | None,
    typer.Option("--master", metavar="NAME", help="libcosim, Ecos or fmpy; repeatable. Default: all."),
]
Pinned = Annotated[
    bool,
    typer.Option("--one-core/--no-one-core", help="Also measure every master on a single processor core."),
]


@tabular
@takes(*CHANGES, "fmus", "no_build")
def second_opinion(
    scenario: ScenarioFile, options: RunOptions, master: Masters = None, one_core: Pinned = True
) -> None:
    """Run a scenario in libcosim, Ecos and fmpy, and compare.

    Compares every signal, and the time per step. Exit status 1 if libcosim or Ecos disagrees: their
    algorithm is `jacobi`.
    """
    from yawbench.orchestrator.scenario.overrides import changed

    from .second_opinion import MASTERS, second_opinion

    known = {program.title.lower(): program for program in MASTERS}
    for name in master or ():
        if name.lower() not in known:
            raise ScenarioError(
                f"--master {name}: unknown master{hint(name, known, lead='known')}",
                code="master-unknown",
            )
    chosen = [known[name.lower()] for name in master or known]
    plan = plan_of_scenario(scenario, options)
    if plan.faults:
        raise ScenarioError(
            f"{scenario}: faults are not supported by other masters; omit {_faults_of(plan)}",
            code="faults-unsupported",
        )
    if plan.changes:
        say(f"changed: {changed(plan.changes)}")
    with tempfile.TemporaryDirectory(prefix="yawbench-") as folder:
        try:
            opinions = second_opinion(
                plan,
                Path(folder),
                masters=chosen,
                pinned=one_core,
                progress=lambda text: say(f"running in {text}"),
            )
        except RuntimeError as error:
            raise SimulationError(str(error), instance=None, time=0.0) from None
    show(opinions)
    if all(opinion.problem for opinion in opinions):
        raise SimulationError(
            f"{scenario}: nothing was compared, no other master has a result",
            instance=None,
            time=0.0,
            code="nothing-to-compare",
        )
    wrong = [opinion for opinion in opinions if not opinion.agrees and opinion.master.title != "fmpy"]
    if wrong:
        names = " and ".join(opinion.master.title for opinion in wrong)
        raise SimulationError(
            f"{scenario}: the results disagree with {names}, see above",
            instance=None,
            time=0.0,
            code="masters-disagree",
        )


def _faults_of(plan: Plan) -> str:
    """Return the faults of a plan in words."""
    return "; ".join(dict.fromkeys(f"{signal.fault.on}: {signal.fault}" for signal in plan.faults))


def show(opinions: list[SecondOpinion]) -> None:
    """Print the differences by signal, the times per step, and notes."""
    from yawbench.studies.tables import Table

    comparable = [opinion for opinion in opinions if not opinion.problem]
    if comparable:
        names = [opinion.master.title for opinion in comparable]
        columns = set(range(1, len(comparable) + 1))
        apart = Table("Largest difference / range", ["signal", *names], numbers=columns)
        for signal in comparable[0].differences:
            apart.rows.append([signal, *(f"{opinion.differences[signal]:.1e}" for opinion in comparable)])
        apart.rows.append(["largest", *(f"{opinion.largest:.1e}" for opinion in comparable)])
        keys = list(comparable[0].seconds)
        times = Table("us per communication step", ["master", *keys], numbers=set(range(1, len(keys) + 1)))
        for opinion in comparable:
            times.rows.append([opinion.master.title, *(f"{1e6 * opinion.seconds[key]:.0f}" for key in keys)])
        print_tables([apart, times])
        _show_still(comparable[0])
    for opinion in opinions:
        if opinion.problem:
            print(printable(f"{opinion.master.title}: {opinion.problem}"))
        elif opinion.one_step or opinion.master.note:
            step = "compared with a common step size for all instances: " if opinion.one_step else ""
            print(printable(f"{opinion.master.title}: {step}{opinion.master.note}"))


def _show_still(opinion: SecondOpinion) -> None:
    """Print which signals are constant during the run: their agreement is not evidence."""
    if opinion.differences and len(opinion.still) == len(opinion.differences):
        print("No signal changes during the run, so its agreement is not evidence: let it last longer.")
    elif opinion.still:
        share = f"{len(opinion.still)} of {counted(len(opinion.differences), 'signal')}"
        names = listed(fold(list(opinion.still)))
        print(printable(f"Constant during the run, so their agreement is not evidence: {share}, {names}."))


ArchiveOption = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="FILE", help="Archive to write. Default: <scenario>.ssp in the working directory."
    ),
]
Standard = Annotated[
    Literal["1.0", "2.0"] | None,
    typer.Option("--standard", help="Version of SSP. Default: 1.0, or 2.0 for FMUs of FMI 3.0."),
]
Version = Annotated[
    Literal["2", "3"],
    typer.Option("--fmi", help="Version of FMI of the FMUs; 3 is for native ones that were built here."),
]
For = Annotated[
    Literal["all", "libcosim", "omsimulator"],
    typer.Option(
        "--for", help="Write choices as numbers; omit what OMSimulator does not support, and list it."
    ),
]


@takes(*CHANGES, "fmus", "no_build")
def export_ssp(
    scenario: ScenarioFile,
    options: RunOptions,
    out: ArchiveOption = None,
    for_: For = "all",
    standard: Standard = None,
    fmi: Version = "2",
) -> None:
    """Write a scenario and its FMUs as an SSP archive.

    SSP: System Structure and Parameterization. `yawbench run` accepts the archive and gives the same numbers.
    """
    from .ssp_write import as_fmi3, for_omsimulator, with_numbers, write_ssp

    plan = plan_of_scenario(scenario, options)
    notes = list(map(str, plan.diagnostics))
    if plan.faults:
        notes.append(f"faults are not part of the archive: {_faults_of(plan)}")
    path = out or Path(f"{scenario.stem}.ssp")
    if for_ != "all":
        standard = standard or "1.0"  # which alone they read
    with tempfile.TemporaryDirectory(prefix="yawbench-") as folder:
        if fmi == "3":
            plan = as_fmi3(plan, Path(folder))
        if for_ != "all":
            plan = with_numbers(plan, Path(folder))
        if for_ == "omsimulator":
            plan, more = for_omsimulator(plan)
            notes += more
        for note in notes:
            say(f"note: {note}")
        write_ssp(plan, path, standard, named=out is not None)
    say(f"{path}: {len(plan.instances)} instances, {len(plan.wires)} connections")


FmuOption = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="FILE", help="FMU to write. Default: <scenario>.fmu in the working directory."
    ),
]


@takes(*CHANGES, "fmus", "no_build")
def export_fmu(scenario: ScenarioFile, options: RunOptions, out: FmuOption = None) -> None:
    """Write a scenario as one FMU of FMI 2.0.

    Its units are stepped together inside, with the algorithm `jacobi`. Parameters and recorded outputs are
    those of the units, named `instance.variable`. Needs the package fmu-manipulation-toolbox.
    """
    from .one_fmu import write_one_fmu

    plan = plan_of_scenario(scenario, options)
    path = out or Path(f"{scenario.stem}.fmu")
    notes = [*map(str, plan.diagnostics), *write_one_fmu(plan, path, named=out is not None)]
    if plan.faults:
        notes.append(f"faults are not part of the FMU: {_faults_of(plan)}")
    for note in notes:
        say(f"note: {note}")
    say(f"{path}: {len(plan.instances)} instances, {len(plan.wires)} connections")


DbcFile = Annotated[
    Path, typer.Argument(metavar="DBC", help="DBC file of a CAN network.", show_default=False)
]
Channels = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="CHANNEL=MESSAGE.SIGNAL",
        help="Channel of a sensor and its signal. Default: list all signals.",
    ),
]
BitRate = Annotated[
    float | None,
    typer.Option(
        "--bit-rate", metavar="NUMBER", help="Of the bus in bit/s, for the latency. Default: none.", min=1
    ),
]
Radius = Annotated[
    float | None,
    typer.Option("--wheel-radius", metavar="NUMBER", help="In m, of wheel speeds in km/h or m/s.", min=0.01),
]


@tabular
def dbc(
    file: DbcFile, channels: Channels = None, bit_rate: BitRate = None, wheel_radius: Radius = None
) -> None:
    """Print parameters of a sensor with the numbers of a CAN network.

    Resolution, range, time between messages and latency, as `parameters:` of a sensor in a scenario.
    """
    from yawbench.studies.tables import Table

    from .can_signals import read_dbc, sensor_parameters

    signals = read_dbc(file)
    if not channels:
        headings = ["signal", "unit", "resolution", "from", "to", "cycle, ms"]
        table = Table(str(file), headings, numbers={2, 3, 4, 5})
        for name, one in signals.items():
            numbers = one.scale if one.whole else 0.0, one.least, one.largest, 1000 * one.cycle
            table.rows.append([name, one.unit, *(f"{number:g}" for number in numbers)])
        print_tables([table])
        return
    pairs = dict(text.partition("=")[::2] for text in channels)
    parameters = sensor_parameters(signals, pairs, bit_rate=bit_rate, wheel_radius=wheel_radius)
    print(printable(f"parameters:   # {file.name}: {', '.join(channels)}"))
    for name, value in parameters.items():
        print(f"  {name}: {value!r}")


ResultsFolder = Annotated[
    Path, typer.Argument(metavar="RESULTS", help="Folder with results.", show_default=False)
]
Columns = Annotated[
    list[str],
    typer.Argument(metavar="COLUMN=MESSAGE.SIGNAL", help="Recorded signal and the signal that carries it."),
]
DbcOption = Annotated[Path, typer.Option("--dbc", metavar="FILE", help="DBC file of the network.")]
LogOption = Annotated[Path, typer.Option("--out", metavar="FILE", help="Log to write, .blf or .asc.")]


def export_can(
    results: ResultsFolder, columns: Columns, dbc: DbcOption, out: LogOption, wheel_radius: Radius = None
) -> None:
    """Write results as a log of CAN frames.

    Measurement files and time series read the log like any other recording, with the DBC file beside it.
    """
    from yawbench.orchestrator.results.reader import load_results

    from .can_log import write_log

    pairs = dict(text.partition("=")[::2] for text in columns)
    count = write_log(load_results(results), dbc, pairs, out, wheel_radius=wheel_radius)
    say(f"{out}: {counted(count, 'frame')}")
