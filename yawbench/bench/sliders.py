"""Bench: a page with sliders, and the runs that it asks for while they move.

The page states a scenario and its changes; the bench plans the run, makes it in a worker process that keeps
its FMUs open, and returns the viewer of this run with the earlier ones as ghosts. Runs are kept by their
keys, so that a slider that returns to a position shows its run at once. The run that a page will ask for
first is begun when the page is asked for, while the browser still loads it.
"""

from __future__ import annotations

import shlex
import threading
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass as checked

from yawbench.figures.display import LabelledRun
from yawbench.fmus.fmu import Variable, is_path
from yawbench.fmus.opener import Building, find_folder
from yawbench.foundation.errors import Interrupted, ScenarioError, YawbenchError
from yawbench.foundation.interrupts import StopFlag
from yawbench.foundation.messages import hint, short
from yawbench.foundation.workers import Pool, default_workers
from yawbench.orchestrator.plan import Instance, Plan
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.scenario import catalogue
from yawbench.orchestrator.scenario.overrides import read_changes
from yawbench.orchestrator.scenario.quantities import convert
from yawbench.orchestrator.scenario.schema import LoadedScenario
from yawbench.orchestrator.signal_names import Target
from yawbench.orchestrator.wiring.context import facts_of, reached
from yawbench.orchestrator.wiring.parameters import value_for
from yawbench.planner import Planner
from yawbench.reports.page_parts import Page, render
from yawbench.reports.viewer import Settings, assets, viewer
from yawbench.reports.viewer_samples import PackedRun, pack
from yawbench.studies.jobs import LASTING, NEEDED, Job, execute, keyed, planned, recorded
from yawbench.vocabulary.facts import FACTS
from yawbench.vocabulary.units import DISPLAYED
from yawbench.vocabulary.vehicle import CAR

KEPT = 24
"""Runs kept in memory. Chosen: a slider's way there and back; 0.4 GB at 64 signals of 8,001 rows, twice."""
PATIENCE = 0.5
"""Time [s] for which the latest run waits for the one before it, which then is stopped. Chosen: longer than
the papers' runs take, so that the worker keeps its FMUs."""
FACT_RANGES = {"friction": (0.1, 1.1), "speed": (5.0, 50.0)}
"""Usual ranges of facts. Chosen: wet ice to racing tyres; a car park to 180 km/h."""
SHOWN = ("mass", "cg_height")
"""Quantities of the car with a slider at first, besides facts and parameters of the driver."""
FIRST = 6
"""Number of sliders at first; chosen: they fit above the fold."""
AHEAD = ""
"""Name in place of a page's, of runs that no page has asked for yet."""


class Superseded(YawbenchError):
    """A later run of the same page has taken the place of this one."""


@dataclass(frozen=True)
class Knob:
    """A value that a slider changes.

    Attributes:
        target: as `--set` takes it.
        unit: of measurement, degrees and km/h as on figures; "" if it has none.
        value: of the scenario, in that unit.
        low, high: usual range.
        says: what the value is.
        usual: whether the range is that of the vocabulary or the FMU, not just around the value.
        factor: of a value in SI.
    """

    target: str
    unit: str
    value: float
    low: float
    high: float
    says: str
    usual: bool = True
    factor: float = 1.0

    @classmethod
    def of_si(
        cls, target: str, unit: str, numbers: tuple[float, float, float], says: str, usual: bool
    ) -> Knob:
        """Return the knob of a value and its range in SI."""
        shown, factor = DISPLAYED.get(unit, ("" if unit == "1" else unit, 1.0))
        value, low, high = (float(f"{factor * number:.12g}") for number in numbers)
        return cls(target, shown, value, low, high, says, usual, factor)

    @property
    def step(self) -> float:
        """The least move of the slider, about a two-hundredth of its range."""
        return float(f"{(self.high - self.low) / 200:.0e}")


def knobs_of(scenario: LoadedScenario, plan: Plan) -> list[Knob]:
    """Return what sliders can change: facts, quantities of the vehicle file, parameters of instances."""
    knobs = {knob.target: knob for knob in _facts(scenario, plan)}
    for instance in plan.instances:
        for variable in instance.fmu.of("parameter"):
            value = instance.parameter(variable.name)
            if variable.type != "Real" or not isinstance(value, (int, float)):
                continue
            of_file = scenario.vehicle_file.parameters.get(variable.name)
            own = variable.name in scenario.units[instance.name].parameters
            target = f"{instance.name}.{variable.name}"
            if variable.name in CAR and of_file is not None and not own:
                target, value = f"vehicle.{variable.name}", float(value_for(variable, of_file.value))
            if any(
                knob.target in FACTS and variable.name in FACTS[knob.target].parameters
                for knob in knobs.values()
            ):
                continue  # the fact sets it
            knobs.setdefault(target, _knob(target, variable, float(value)))
    return list(knobs.values())


def _facts(scenario: LoadedScenario, plan: Plan) -> Iterator[Knob]:
    for name, fact, given in facts_of(scenario):
        if any(True for _ in reached(plan, Target("fact", variable=name))):
            value = float(convert(given.value, fact.unit) if isinstance(given.value, str) else given.value)
            low, high = FACT_RANGES[name]
            numbers = value, min(low, value), max(high, value)
            yield Knob.of_si(name, fact.unit, numbers, f"{name} for all instances", True)


def _knob(target: str, variable: Variable, value: float) -> Knob:
    quantity = CAR.get(variable.name)
    plausible = quantity.plausible if quantity else None
    if plausible is None and variable.minimum is not None and variable.maximum is not None:
        plausible = variable.minimum, variable.maximum
    around = (min(0.0, 2 * value), max(0.0, 2 * value)) if value else (-1.0, 1.0)
    low, high = plausible or around
    if variable.minimum is not None:
        low = max(low, variable.minimum)
    if variable.maximum is not None:
        high = min(high, variable.maximum)
    numbers = value, min(low, value), max(high, value)
    return Knob.of_si(target, variable.unit or "", numbers, variable.description, plausible is not None)


def shown_first(knobs: Sequence[Knob], plan: Plan) -> list[str]:
    """Return the targets with a slider at first: facts, the driver's parameters that are set, mass."""
    stated = {
        f"{instance.name}.{name}"
        for instance in plan.instances
        if instance.role == "driver"
        for name, given in instance.given.items()
        if given.origin.kind == "scenario"
    }
    wanted = (
        *FACTS,
        *sorted(stated),
        *(f"vehicle.{name}" for name in SHOWN),
        *(f"plant.{name}" for name in SHOWN),
    )
    known = {knob.target for knob in knobs}
    return [target for target in wanted if target in known][:FIRST]


@dataclass(frozen=True, kw_only=True)
class BenchPage(Page):
    """The page with sliders of a scenario."""

    template = "bench.html.j2"
    scenario: str
    others: Sequence[str]  # names of scenarios to choose from
    knobs: Sequence[Knob]  # all values that a slider can change
    swaps: Sequence[tuple[Instance, list[str]]]  # instances with the FMUs that can take their place
    wires: Sequence[str]  # that a fault can act on
    data: dict[str, Any]  # for the script


@checked(frozen=True, config=ConfigDict(extra="forbid", strict=True))
class Wanted:
    """A run that a page asks for.

    Attributes:
        page: the page that asks; of its runs, only the latest counts.
        label: in the viewer.
        scenario: by name or path.
        settings, swaps, faults: as `--set`, `--swap` and `--fault` take them.
        earlier: (key, label) of earlier runs to show beside it.
    """

    page: str
    label: str
    scenario: str
    settings: tuple[str, ...] = ()
    swaps: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    earlier: tuple[tuple[str, str], ...] = ()

    @property
    def command(self) -> str:
        """The command that makes the run."""
        options = (("--set", self.settings), ("--swap", self.swaps), ("--fault", self.faults))
        options_given = [part for option, values in options for value in values for part in (option, value)]
        return shlex.join(["yawbench", "run", self.scenario, *options_given])


class Bench:
    """Makes the runs of bench pages, one at a time; all its processes end with `close`.

    Args:
        build: as of the `Planner`.
    """

    def __init__(self, *, build: Building = False) -> None:
        self._planner = Planner(build=build)
        self._planning = threading.Lock()
        self._turn = threading.Lock()
        self._pool = Pool(1, preload=NEEDED, lasting=LASTING)
        self._closing = StopFlag()
        self._latest: dict[str, StopFlag] = {}
        self._key_ahead = ""  # of the run that is made before its page asks for it
        self._paths: dict[str, Path] = {}  # of scenarios, by name: finding one reads all
        self._kept: OrderedDict[str, tuple[Results, PackedRun]] = OrderedDict()
        threading.Thread(target=self._warm, daemon=True).start()

    def _warm(self) -> None:
        """Start the worker before the first run asks for it."""
        with self._turn, suppress(Interrupted):
            for _ in self._pool.each(default_workers, [()], look=self._look):
                pass

    def _look(self) -> None:
        if self._closing.requested:
            raise Interrupted

    def page(self, scenario: str, others: Sequence[str]) -> str:
        """Return the page of a scenario; `others`: the names of scenarios to choose from.

        Raises:
            YawbenchError: the scenario or an FMU is wrong.
        """
        path = self._scenario(scenario)
        job = Job(scenario, path, Path())
        with self._planning:
            loaded, plan = planned(job, self._planner)
            archives = self._planner.opener.names(find_folder(path, opener=self._planner.opener))
        threading.Thread(target=self._make_ahead, args=(replace(job, plan=plan),), daemon=True).start()
        knobs = knobs_of(loaded, plan)
        swaps = [
            (instance, choices)
            for instance in plan.instances
            if len(choices := _alternatives(instance, archives)) > 1
        ]
        data = {
            "scenario": scenario,
            "shown": shown_first(knobs, plan),
            "knobs": {knob.target: asdict(knob) | {"step": knob.step} for knob in knobs},
        }
        view = BenchPage(
            title=plan.title or scenario, scenario=scenario, data=data, knobs=knobs,
            swaps=swaps, others=others,
            wires=[f"{wire.source}.{wire.output} -> {wire.target}" for wire in plan.wires],
            assets=assets("bench.js", "bench.css", package=__package__),
        )  # fmt: skip
        return render(view)

    def _scenario(self, name: str) -> Path:
        """Return the scenario of a name; a path is refused."""
        if name not in self._paths:
            known = catalogue.names("a scenario")
            path = catalogue.named(name) if name in known else None
            if path is None:
                others = hint(name, known, lead="by name there are")
                raise ScenarioError(f"there is no scenario {short(name)}{others}", code="scenario-unknown")
            self._paths[name] = path
        return self._paths[name]

    def run(self, wanted: Wanted) -> tuple[str, list[str]]:
        """Make a run unless it is kept; return its key and the warnings about its course.

        Raises:
            Superseded: a later call for the same page has come.
            YawbenchError: the scenario or a change is wrong, or the run failed.
        """
        stop, earlier = StopFlag(), self._latest.get(wanted.page)
        self._latest[wanted.page] = stop
        changes = read_changes(wanted.swaps, wanted.settings, wanted.faults)
        if files := [
            str(change)
            for change in changes
            if change.target.names_file and (not change.swaps or is_path(str(change.value)))
        ]:
            raise ScenarioError(f"{files[0]}: the bench takes names, no files", code="option-invalid")
        path = self._scenario(wanted.scenario)
        with self._planning:
            job = Job(wanted.scenario, path, Path(), changes)
            job = keyed(replace(job, plan=planned(job, self._planner)[1]))
        if job.key not in self._kept:
            self._make(job, wanted.page, stop, earlier)
        self._kept.move_to_end(job.key)
        return job.key, [str(warning) for warning in self._kept[job.key][0].record.course_warnings]

    def _make_ahead(self, job: Job) -> None:
        """Make the run that a page shows first; what is wrong with it is told when the page asks for it."""
        stop, earlier = StopFlag(), self._latest.get(AHEAD)
        job = keyed(job)
        self._latest[AHEAD], self._key_ahead = stop, job.key
        with suppress(YawbenchError):
            self._make(job, AHEAD, stop, earlier)

    def _make(self, job: Job, page: str, stop: StopFlag, earlier: StopFlag | None) -> None:
        """Make a run when it is its turn, unless it has been made by then, and keep it."""
        if not self._turn.acquire(timeout=PATIENCE):
            ahead = self._latest.get(AHEAD) if self._key_ahead != job.key else None
            for other in filter(None, (earlier, ahead)):
                other.request()
            self._turn.acquire()
        try:
            if job.key in self._kept:
                return
            if self._latest.get(page) is not stop or stop.requested or self._closing.requested:
                raise Superseded("a later run has taken the place of this one", code="run-superseded")
            (outcome,) = execute([job], run=recorded, pool=self._pool, stop=stop)
        except Interrupted:
            self._pool.end()
            raise Superseded("a later run has taken the place of this one", code="run-superseded") from None
        finally:
            self._turn.release()
        if not outcome.ok:
            raise YawbenchError(list(outcome.diagnostics))
        (packed,) = pack([outcome.value], exact=True)
        self._kept[job.key] = outcome.value, replace(packed, address=f"block/{job.key}")
        while len(self._kept) > KEPT:
            self._kept.popitem(last=False)

    def viewer(self, runs: Sequence[tuple[str, str]]) -> str:
        """Return the viewer of kept runs by (key, label): the first, and the others as ghosts."""
        kept = [(label, *self._kept[key]) for key, label in runs if key in self._kept]
        labelled = [LabelledRun(label, results) for label, results, _ in kept]
        settings = Settings(ghosts=range(1, len(kept)))
        return viewer(labelled, settings, name="run", alone=True, packed=[packed for *_, packed in kept])

    def block(self, key: str) -> bytes | None:
        """Return the samples of a kept run."""
        return self._kept[key][1].data if key in self._kept else None

    def close(self) -> None:
        """End all processes."""
        for stop in (self._closing, *self._latest.values()):
            stop.request()
        with self._turn:
            self._pool.end()


def _alternatives(instance: Instance, archives: Sequence[str]) -> list[str]:
    """Return the names of the FMUs that can take the place of an instance's: those of its role."""
    return sorted({instance.fmu.name, *(name for name in archives if name.startswith(f"{instance.role}_"))})


def wanted_of(request: bytes) -> Wanted:
    """Return the run that a page's request describes.

    Raises:
        ScenarioError: the request is malformed.
    """
    try:
        return TypeAdapter(Wanted).validate_json(request)
    except ValidationError:
        raise ScenarioError(
            "the request for a run is not one of the bench's page", code="value-invalid"
        ) from None
