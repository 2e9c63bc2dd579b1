"""Arguments and options shared by several subcommands, and the plan of a scenario with them applied."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..fault_kinds import KINDS, NO_FAULTS
from ..results.formats import FORMATS

if TYPE_CHECKING:
    from ..plan import Override, Plan


def named(kind: str, **told: Any) -> Any:
    """Return an argument for a file of a kind, or for its name (see `scenario.catalogue`)."""

    def find(given: Any) -> Any:
        from ..scenario import catalogue

        if isinstance(given, (list, tuple)):
            return [catalogue.find(one, kind) for one in given]
        return given and catalogue.find(given, kind)

    def complete(incomplete: str) -> list[str]:
        from ..scenario import catalogue

        return [name for name in catalogue.names(kind) if name.startswith(incomplete)]

    return typer.Argument(callback=find, autocompletion=complete, **told)


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

    swap: Annotated[
        list[str] | None,
        typer.Option(
            "--swap", metavar="UNIT=FMU", help="Replace a unit's FMU: a name or a path. Repeatable."
        ),
    ] = None
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="UNIT.PARAMETER=VALUE",
            help="Set a parameter of a unit; also vehicle.NAME, inputs.NAME, UNIT.step_size, UNIT.validate, "
            "start_time, stop_time, step_size, algorithm. Repeatable.",
        ),
    ] = None
    fault: Annotated[
        list[str] | None,
        typer.Option(
            "--fault",
            metavar="'PLACE: KIND VALUE'",
            help="Let something go wrong, such as 'plant.yaw_rate -> sensor: freeze from 2 s until 3 s'; "
            "place: unit.output, unit.output -> unit or unit.input; "
            f"kind: {', '.join(KINDS)}; {NO_FAULTS} takes away the scenario's own. Repeatable.",
        ),
    ] = None
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", help="Folder for the results, and for the page if there is one."
        ),
    ] = None
    fmus: Annotated[
        Path | None,
        typer.Option("--fmus", metavar="DIR", help="Folder of the FMUs; default: the nearest fmus/ folder."),
    ] = None
    no_build: Annotated[
        bool,
        typer.Option(
            "--no-build",
            envvar="YAWBENCH_NO_BUILD",
            help="Use FMUs as they are, even if their sources have changed; by default they are rebuilt.",
        ),
    ] = False
    jobs: Annotated[
        int | None,
        typer.Option("--jobs", metavar="N", min=1, help="Runs at a time; default: one per processor core."),
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
            "--quick", help="Judge claims at the chosen point alone, not over the region of the open values."
        ),
    ] = False
    fresh: Annotated[
        bool,
        typer.Option(
            "--fresh", "--again", help="Make all runs anew, including those that have been made already."
        ),
    ] = False
    no_run: Annotated[
        bool,
        typer.Option("--no-run", help="Run and build nothing: judge and draw what is in the results folder."),
    ] = False
    isolate: Annotated[
        bool,
        typer.Option(
            "--isolate",
            help="Run each unit in a process of its own: if its FMU crashes or hangs, the run ends with "
            "an error and the results so far. Same numbers; 30 to 70 µs more per unit and step.",
        ),
    ] = False
    call_limit: Annotated[
        str | None,
        typer.Option(
            "--call-limit",
            metavar="TIME",
            help="With --isolate: the longest that a call of an FMU may take, such as '500 ms'; default: "
            "10 s.",
        ),
    ] = None
    no_validate: Annotated[
        bool,
        typer.Option(
            "--no-validate",
            help="Accept FMUs whose model descriptions are formally wrong, with a warning that says what is.",
        ),
    ] = False

    def __post_init__(self) -> None:
        from ..errors import ScenarioError

        if self.fresh and self.no_run:
            raise ScenarioError("--fresh and --no-run contradict each other", code="option-invalid")
        if self.format_ != "csv":  # importing the other formats takes time
            from ..results.formats import check_format

            check_format(self.format_)
        _ = self.limit, self.changes  # raises now if they are invalid

    @property
    def build(self) -> bool:
        """Whether FMUs that are out of date are built."""
        return not (self.no_build or self.no_run)

    @functools.cached_property
    def changes(self) -> tuple[Override, ...]:
        """The overrides for all runs."""
        from ..scenario.overrides import read_changes

        return read_changes(self.swap or (), self.set_ or (), self.fault or ())

    @property
    def changing(self) -> dict[str, Any]:
        """The options that change all runs, as they were given."""
        return {"swap": self.swap, "set": self.set_, "fault": self.fault}

    @functools.cached_property
    def limit(self) -> float | None:
        """Time limit of an FMU call [s]; None if instances are not isolated."""
        from ..errors import ScenarioError

        given = self.call_limit
        if not self.isolate:
            if given is not None:
                raise ScenarioError(
                    "--call-limit goes with --isolate: in one process no call can be ended",
                    code="option-invalid",
                )
            return None
        from ..master.isolation import CALL_LIMIT
        from ..scenario.quantities import seconds

        if given is None:
            return CALL_LIMIT
        try:
            return float(seconds(int(given) if given.isdecimal() else given))
        except ValueError as error:
            raise ScenarioError(f"--call-limit: {error}") from None

    @property
    def of_jobs(self) -> dict[str, Any]:
        """The fields of jobs that the options set."""
        return {"fmus": self.fmus, "call_limit": self.limit, "format": self.format_}


def takes(*names: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Add options of `RunOptions` after a command's own; it receives them as `wishes`."""
    shared = inspect.signature(RunOptions, eval_str=True).parameters

    def taking(command: Callable[..., None]) -> Callable[..., None]:
        own = inspect.signature(command, eval_str=True).parameters

        @functools.wraps(command)
        def called(**given: Any) -> None:
            wishes = RunOptions(**{name: given.pop(name) for name in names})
            command(**given, wishes=wishes)

        every = [one for name, one in own.items() if name != "wishes"]
        every += [one for name, one in shared.items() if name in names]
        called.__signature__ = inspect.Signature(every)  # type: ignore[attr-defined]
        return called

    return taking


CHANGES = ("swap", "set_", "fault")
"""Options of commands that change a scenario."""
MAKING = ("out", "fmus", "no_build", "isolate", "call_limit")
"""Options of commands that make runs."""


def plan_of_scenario(scenario: Path, wishes: RunOptions) -> Plan:
    """Return the plan of a scenario with the overrides of the options, building its FMUs if necessary.

    Raises:
        YawbenchError: the scenario, an option or an FMU is invalid, or a component cannot be built.
    """
    from ..planner import Planner

    planner = Planner(build=wishes.build)
    loaded = planner.load(scenario, wishes.changes, validate=not wishes.no_validate)
    return planner.plan(loaded, fmus=wishes.fmus, isolated=wishes.isolate)
