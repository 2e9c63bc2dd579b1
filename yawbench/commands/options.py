"""Arguments and options shared by several subcommands; plans, processes and executors made with them."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from yawbench.foundation.errors import ScenarioError
from yawbench.orchestrator.fault_kinds import KINDS, NO_FAULTS
from yawbench.orchestrator.results.file_formats import FORMATS

from .json_and_latex import with_options
from .terminal_progress import BUILDING, OPENING, announced

if TYPE_CHECKING:
    from yawbench.fmus.opener import Building
    from yawbench.orchestrator.plan import Override, Plan
    from yawbench.studies.executor import Executor
    from yawbench.studies.experiment_result import Each


def named(kind: str, **settings: Any) -> Any:
    """Return an argument for a file of a kind, given as a path or a name (see `scenario.catalogue`)."""

    def find(value: Any) -> Any:
        from yawbench.orchestrator.scenario import catalogue

        if isinstance(value, (list, tuple)):
            return [catalogue.find(name, kind) for name in value]
        return value and catalogue.find(value, kind)

    return typer.Argument(callback=find, autocompletion=completing(kind), **settings)


def completing(kind: str) -> Callable[[str], list[str]]:
    """Return what completes the names of a kind of file."""

    def complete(incomplete: str) -> list[str]:
        from yawbench.orchestrator.scenario import catalogue

        home = f"{catalogue.HOMES.get(kind, '')}/"
        names = [name.removeprefix(home) for name in catalogue.names(kind)]
        return [name for name in names if name.startswith(incomplete)]

    return complete


def completing_names(*of: str) -> Callable[[str], list[str]]:
    """Return what completes names of the vocabulary: `facts`, `quantities`, `signals` or `metrics`."""

    def complete(incomplete: str) -> list[str]:
        from yawbench.orchestrator.signal_names import OF_RUN, VEHICLE
        from yawbench.vocabulary.facts import FACTS
        from yawbench.vocabulary.signals import SIGNALS
        from yawbench.vocabulary.vehicle import CAR

        names: list[str] = []
        names += [f"{name}=" for name in (*FACTS, *OF_RUN)] if "facts" in of else []
        names += [f"{VEHICLE}.{name}=" for name in CAR] if "quantities" in of else []
        names += [*SIGNALS, "path"] if "signals" in of else []
        if "metrics" in of:
            from yawbench.metrics.measures import catalogue as measures

            names += ["standard", *(f"{measure.name}(" for measure in measures())]
        return [name for name in names if name.startswith(incomplete)]

    return complete


def complete_swap(incomplete: str) -> list[str]:
    """Complete INSTANCE=FMU: instances by the names of roles, then the FMUs of the role."""
    from yawbench.fmus.opener import Opener, find_folder
    from yawbench.vocabulary.roles import ROLES

    instance, equals, _ = incomplete.partition("=")
    if not equals:
        return [f"{role.name}=" for role in ROLES.values() if role.name.startswith(instance)]
    opener = Opener()
    known = opener.names(find_folder(Path("scenario.yaml"), opener=opener))
    fmus = [name for name in known if name.startswith(f"{instance}_")]
    return [text for name in fmus if (text := f"{instance}={name}").startswith(incomplete)]


def complete_fault(incomplete: str) -> list[str]:
    """Complete TARGET: KIND: instances by the names of roles, their signals, then the kinds."""
    from yawbench.vocabulary.roles import ROLES
    from yawbench.vocabulary.signals import SIGNALS

    target, colon, _ = incomplete.partition(":")
    if colon:
        return [text for kind in KINDS if (text := f"{target}: {kind}").startswith(incomplete)]
    instance, dot, _ = target.partition(".")
    if not dot:
        return [f"{role.name}." for role in ROLES.values() if role.name.startswith(instance)]
    return [text for name in SIGNALS if (text := f"{instance}.{name}").startswith(target)]


def _refuse_of_car(settings: Iterable[str]) -> None:
    """Refuse quantities of the car without the word before them, as `mass` of `vehicle.mass`.

    Raises:
        ScenarioError: with the names that are meant.
    """
    from yawbench.vocabulary.vehicle import CAR

    errors = []
    for text in settings:
        name, equals, value = (part.strip() for part in text.partition("="))
        if equals and name in CAR:
            errors.append(f"--set {text}: did you mean vehicle.{name}={value}, or INSTANCE.{name}={value}?")
    if errors:
        raise ScenarioError(errors, code="option-invalid")


def _of_vehicle(name: str | None) -> tuple[Override, ...]:
    """Return the override of the vehicle file.

    Raises:
        ScenarioError: the file does not exist.
    """
    from yawbench.orchestrator.plan import Override
    from yawbench.orchestrator.scenario import catalogue

    if name is None:
        return ()
    return (Override.of("vehicle", str(catalogue.find(name, "a vehicle file").resolve()), "--vehicle"),)


ScenarioFile = Annotated[
    Path,
    named(
        "a scenario",
        help="Scenario: YAML file, SSP archive, or a name in scenarios/.",
        metavar="SCENARIO",
    ),
]


@dataclass(frozen=True)
class RunOptions:
    """Options shared by the commands; those that a command does not declare with `takes` keep their defaults.

    Raises:
        ScenarioError: two options contradict each other, or one is malformed.
    """

    vehicle: Annotated[
        str | None,
        typer.Option(
            "--vehicle",
            metavar="FILE",
            help="Vehicle file in place of the scenario's, or a name that `yawbench list vehicles` gives.",
            autocompletion=completing("a vehicle file"),
        ),
    ] = None
    swap: Annotated[
        list[str] | None,
        typer.Option(
            "--swap",
            metavar="INSTANCE=FMU",
            autocompletion=complete_swap,
            help="Replace the FMU of an instance, by name or path. Repeatable.",
        ),
    ] = None
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="INSTANCE.PARAMETER=VALUE",
            autocompletion=completing_names("facts", "quantities"),
            help="Set a parameter of an instance; also vehicle.NAME, inputs.NAME, INSTANCE.step_size, "
            "INSTANCE.validate, start_time, stop_time, step_size, algorithm. Repeatable.",
        ),
    ] = None
    fault: Annotated[
        list[str] | None,
        typer.Option(
            "--fault",
            metavar="'TARGET: KIND VALUE'",
            autocompletion=complete_fault,
            help="Inject a fault, such as 'plant.yaw_rate -> sensor: freeze from 2 s until 3 s'; "
            "target: INSTANCE.OUTPUT, INSTANCE.OUTPUT -> INSTANCE or INSTANCE.INPUT; "
            f"kind: {', '.join(KINDS)}; {NO_FAULTS} removes the scenario's own. Repeatable.",
        ),
    ] = None
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder for the results and pages."),
    ] = None
    fmus: Annotated[
        Path | None,
        typer.Option("--fmus", metavar="DIR", help="Folder of the FMUs. Default: the nearest fmus/ folder."),
    ] = None
    no_build: Annotated[
        bool,
        typer.Option(
            "--no-build",
            envvar="YAWBENCH_NO_BUILD",
            help="Do not rebuild FMUs whose sources have changed.",
        ),
    ] = False
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs",
            metavar="N",
            min=1,
            help="Number of parallel runs. Default: the number of processor cores.",
        ),
    ] = None
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="Run on a Dask cluster: tcp://host:port."),
    ] = None
    keep: Annotated[
        bool, typer.Option("--keep", help="Keep the results of every run, in runs/<its key in the table>.")
    ] = False
    format_: Annotated[
        str,
        typer.Option(
            "--format",
            metavar="FORMAT",
            help=f"Format of the results: {', '.join(f'{k} ({x.says})' for k, x in FORMATS.items())}.",
        ),
    ] = "csv"
    quick: Annotated[
        bool,
        typer.Option(
            "--quick", help="Judge claims at the nominal point only, not over the region of open values."
        ),
    ] = False
    fresh: Annotated[
        bool,
        typer.Option("--fresh", "--again", help="Repeat all runs, including finished ones."),
    ] = False
    no_run: Annotated[
        bool,
        typer.Option(
            "--no-run", help="Only judge and draw what is in the results folder; build and run nothing."
        ),
    ] = False
    dry_run: Annotated[
        bool,
        typer.Option(
            "--dry-run",
            help="Only tell how many runs would be made, how long they would take and how much disk space; "
            "run and write nothing, and build FMUs only if there are none yet.",
        ),
    ] = False
    isolate: Annotated[
        bool,
        typer.Option(
            "--isolate",
            help="Run each instance in its own process: if its FMU crashes or hangs, the run ends with "
            "an error and the results so far. Same numbers; 40 to 90 µs more per instance and step.",
        ),
    ] = False
    call_limit: Annotated[
        str | None,
        typer.Option(
            "--call-limit",
            metavar="TIME",
            help="With --isolate: time limit of an FMU call, such as '500 ms'. Default: 10 s.",
        ),
    ] = None
    no_validate: Annotated[
        bool,
        typer.Option(
            "--no-validate",
            help="Accept FMUs with invalid model descriptions, with a warning.",
        ),
    ] = False

    def __post_init__(self) -> None:
        if self.fresh and self.no_run:
            raise ScenarioError("--fresh and --no-run are mutually exclusive", code="option-invalid")
        if self.dry_run and self.no_run:
            raise ScenarioError("--dry-run and --no-run are mutually exclusive", code="option-invalid")
        if self.format_ != "csv":  # importing the other formats takes time
            from yawbench.orchestrator.results.file_formats import check_format

            check_format(self.format_)
        _ = self.limit, self.changes  # raises now if they are invalid

    @property
    def build(self) -> Building:
        """Whether FMUs that are out of date are built; for a dry run, only those that do not exist."""
        return not (self.no_build or self.no_run) and (not self.dry_run or "missing")

    @functools.cached_property
    def changes(self) -> tuple[Override, ...]:
        """The overrides for all runs."""
        from yawbench.orchestrator.scenario.overrides import read_changes

        _refuse_of_car(self.set_ or ())
        return (*_of_vehicle(self.vehicle), *read_changes(self.swap or (), self.set_ or (), self.fault or ()))

    @property
    def changing(self) -> dict[str, Any]:
        """The options that change all runs, as they were given."""
        vehicle = None if self.vehicle is None else [self.vehicle]
        return {"vehicle": vehicle, "swap": self.swap, "set": self.set_, "fault": self.fault}

    @functools.cached_property
    def limit(self) -> float | None:
        """Time limit of an FMU call [s]; None if instances are not isolated."""
        limit = self.call_limit
        if not self.isolate:
            if limit is not None:
                raise ScenarioError(
                    "--call-limit requires --isolate: a call in this process cannot be ended",
                    code="option-invalid",
                )
            return None
        from yawbench.orchestrator.master.isolation import CALL_LIMIT
        from yawbench.orchestrator.scenario.quantities import seconds

        if limit is None:
            return CALL_LIMIT
        try:
            return float(seconds(int(limit) if limit.isdecimal() else limit))
        except ValueError as error:
            raise ScenarioError(f"--call-limit: {error}") from None

    @property
    def of_jobs(self) -> dict[str, Any]:
        """The fields of jobs that the options set."""
        return {"fmus": self.fmus, "call_limit": self.limit, "format": self.format_}


def takes(*names: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Decorate a command with options of `RunOptions`, passed as `options` and listed after its own."""
    shared = inspect.signature(RunOptions, eval_str=True).parameters

    def taking(command: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(command)
        def called(**arguments: Any) -> None:
            options = RunOptions(**{name: arguments.pop(name) for name in names})
            command(**arguments, options=options)

        more = {name: (own.default, own.annotation) for name, own in shared.items() if name in names}
        return with_options(command, called, without="options", **more)

    return taking


CHANGES = ("vehicle", "swap", "set_", "fault")
"""Options of commands that change a scenario."""
MAKING = ("out", "fmus", "no_build", "isolate", "call_limit")
"""Options of commands that make runs."""


def plan_of_scenario(scenario: Path, options: RunOptions, record: Sequence[str] = ()) -> Plan:
    """Return the plan of a scenario with the overrides of the options, building its FMUs if necessary.

    `record`: signals to record, or patterns of names; default: those the scenario records.

    Raises:
        YawbenchError: the scenario, an option or an FMU is invalid, or a component cannot be built.
    """
    from yawbench.planner import Planner

    planner = Planner(build=options.build)
    loaded = planner.load(scenario, options.changes, validate=not options.no_validate)
    with announced(BUILDING if options.build else OPENING):
        return planner.plan(loaded, fmus=options.fmus, isolated=options.isolate, record=record)


def pooled(context: typer.Context, options: RunOptions) -> Each:
    """Return a `map` that distributes work over processes until this command ends.

    Raises:
        YawbenchError: this process may not open as many files as that needs.
    """
    from yawbench.foundation.workers import Pool

    return context.with_resource(Pool(options.jobs)).map


def executor_of(
    folder: Path, identity: str, options: RunOptions, each: Each = map, **of_jobs: Any
) -> Executor:
    """Return the executor of experiments in a results folder, which shows their progress on the terminal.

    Args:
        folder: locked results folder.
        identity: of the experiments in it.
        options: the options of the command.
        each: `map` used to read results.
        of_jobs: fields of all jobs in place of the options'.
    """
    from yawbench.planner import Planner
    from yawbench.studies.executor import Executor, runner_of

    from .terminal_progress import Terminal

    runner = None if options.no_run else runner_of(options.jobs, options.scheduler)
    planner = Planner(build=options.build)
    fields = options.of_jobs | of_jobs
    return Executor(
        folder,
        identity,
        runner,
        planner,
        options.fresh,
        fields,
        each,
        Terminal(making=not options.no_run, building=bool(options.build)),
    )
