"""Runs that a program steps itself: up to a time or a condition, with values changed and states saved.

The steps are those of `RunLifecycle`, which makes every run; nothing changed, the rows are the same bits.
"""

from __future__ import annotations

import contextlib
import copy
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import TracebackType
from typing import Any

from yawbench.events.kinds import WarningWatch
from yawbench.fmus.fmu import Value, Variable
from yawbench.foundation.errors import Diagnostic, ScenarioError, SimulationError, code_of
from yawbench.foundation.interrupts import interrupts
from yawbench.foundation.messages import hint, listed, short
from yawbench.metrics.expressions import results_to_be
from yawbench.orchestrator.master.log import WARNING, describe
from yawbench.orchestrator.master.signal_pool import InstanceSlot
from yawbench.orchestrator.master.simulate import Simulation, memory_recorder
from yawbench.orchestrator.master.step_loop import Master
from yawbench.orchestrator.plan import Plan
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.run_record import RunStatus
from yawbench.orchestrator.signal_names import SignalName, Target
from yawbench.orchestrator.wiring.context import reached
from yawbench.orchestrator.wiring.parameters import value_for

from . import arguments
from ._run import Run
from ._run_many import Opened

LATE = 1e-6
"""Fraction of a step by which a time may fall short of a communication point and still be it."""
NAMED = 6
"""Names in a message."""


@dataclass(frozen=True)
class SavedState:
    """State of a run at a communication point, for `SteppedRun.restore` of the same run."""

    time: float  # [s]
    of: SteppedRun
    instances: dict[str, Any]
    master: dict[str, Any]
    rows: tuple[Any, ...]
    watch: WarningWatch
    notes: tuple[Diagnostic, ...]


class SteppedRun:
    """A run that waits to be stepped, and frees its FMUs at the end of `with`; created by `Scenario.start`.

    >>> with base.start() as s:
    ...     s.run_to(1.5)
    ...     before = s.save()
    ...     s.set("friction", 0.2)
    ...     s.run_until(lambda: abs(s["plant.sideslip"]) > 0.05)
    ...     s.restore(before)
    ...     run = s.finish()
    1.5
    True
    >>> (run["plant.sideslip"] == base.run()["plant.sideslip"]).all().item()
    True
    """

    def __init__(self, plan: Plan, opener: Callable[..., Any]) -> None:
        self._plan, self._opened = plan, Opened(opener)
        self._columns = results_to_be(plan)
        self._watch = WarningWatch(plan)
        self._recorder = memory_recorder(plan)
        self._simulation = Simulation(plan, self._recorder, None, self._watch, apart=False)
        self._course = self._simulation.course
        self._open = True
        self._failed: SimulationError | None = None
        with self._acting():
            self._course.begin(self._opened)

    def __enter__(self) -> SteppedRun:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free the FMUs. What was recorded stays."""
        if self._open:
            self._open = False
            with interrupts(self._simulation.stop, self._simulation.abandon):
                self._course.end()

    @contextlib.contextmanager
    def _acting(self) -> Iterator[None]:
        """Let Ctrl-C end the block between two steps; close the run if it fails.

        Raises:
            ScenarioError: the run is closed, or has failed.
            SimulationError: it fails; an exception of Python code is its cause.
        """
        if not self._open:
            why = f"it failed: {self._failed}" if self._failed else "start another one"
            raise ScenarioError(f"this run is closed; {why}", code="run-closed")
        stop = self._simulation.stop
        try:
            with interrupts(stop, self._simulation.abandon):
                yield
        except SimulationError as error:
            self._failed = error
            with contextlib.suppress(SimulationError):
                self._course.flush()
            self.close()
            raise error from self._opened.cause(error)
        finally:
            stop.flag.value = 0

    @property
    def _master(self) -> Master:
        assert self._course.master is not None
        return self._course.master

    @property
    def time(self) -> float:
        """The time that has been reached [s]."""
        return self._plan.time(self._master.completed)

    @property
    def done(self) -> bool:
        """Whether the run has reached its stop time, or an FMU has ended it."""
        return self._master.completed >= self._plan.n_steps or self._course.ended is not None

    def step(self, steps: int = 1) -> float:
        """Make communication steps, at most to the stop time, and return the time reached [s].

        Raises:
            SimulationError: an FMU failed; an exception of Python code is its `__cause__`.
        """
        steps = arguments.count(steps, "steps", most=self._plan.n_steps + 1)
        return self._go_to(min(self._master.completed + steps, self._plan.n_steps))

    def run_to(self, time: float) -> float:
        """Step to the last communication point up to a time [s], and return its time.

        Raises:
            ScenarioError: the time has passed, or lies after the stop time.
            SimulationError: an FMU failed.
        """
        return self._go_to(self._point_at(time))

    def _go_to(self, point: int) -> float:
        with self._acting():
            self._course.step_to(point)
        return self.time

    def run_until(self, condition: Callable[[], bool], time: float | None = None) -> bool:
        """Step until a condition is true, and return whether it has become so: a breakpoint.

        Args:
            condition: called after every step, without arguments.
            time: where to stop at the latest [s]; default: the stop time.

        Raises:
            ScenarioError, SimulationError: as for `run_to`.
        """
        condition = arguments.function(condition, "condition")
        last = self._plan.n_steps if time is None else self._point_at(time)
        while self._master.completed < last and not self.done:
            self._go_to(self._master.completed + 1)
            if condition():
                return True
        return False

    def _point_at(self, time: float) -> int:
        """Return the last communication point up to a time [s], at most the last of the run.

        Raises:
            ScenarioError: the time has passed, or lies after the end.
        """
        wanted = arguments.number(time, "time")
        points = (wanted - self._plan.time(0)) / float(self._plan.step) + LATE
        if not self._master.completed <= points < self._plan.n_steps + 1:
            raise ScenarioError(
                f"time: the run is at t = {self.time:.9g} s and ends at "
                f"{self._plan.time(self._plan.n_steps):.9g} s; it cannot go to {wanted:.9g} s",
                code="argument-invalid",
            )
        return int(points)

    def finish(self) -> Run:
        """Run to the stop time and return the results; without changes, those of `Scenario.run`, to the bit.

        Raises:
            SimulationError: an FMU failed.
        """
        with self._acting():
            self._course.step_to(self._plan.n_steps)
            self._simulation.save_all()
        assert self._recorder.results is not None
        return Run(self._recorder.results)

    @property
    def run(self) -> Run:
        """What has been recorded so far."""
        if self._open:
            self._course.flush()
        self._simulation.save(RunStatus.FAILED if self._failed else RunStatus.INTERRUPTED, self._failed)
        made = self._recorder.results
        assert made is not None
        columns = {name: values.copy() for name, values in made.columns.items()}
        record = made.record.model_copy(deep=True)
        return Run(Results(made.folder, made.time.copy(), columns, made.units, record))

    # ---- values ----

    def __getitem__(self, name: str) -> Value:
        """Return the value now of a variable, by `instance.variable` or by the unique name of a column."""
        text = arguments.text(name, "name of a variable")
        known = SignalName.parse(text if "." in text else self._columns.column(text))
        signals = self._master.signals
        slot, variable = self._found(known)
        if (at := signals.index.get(known)) is not None:
            return float(signals.pool[at])
        if known in signals.others and variable.causality == "output":
            return signals.others[known]
        with self._acting():
            status, values = slot.fmu_instance.fetch([variable.ref])
        if slot.fmu_instance.note(status) > WARNING:
            sentence = f"{known}: {slot.name} does not tell it between steps"
            raise ScenarioError(sentence, code="fmu-call-failed")
        return values[0]

    def _found(self, name: SignalName) -> tuple[InstanceSlot, Variable]:
        slot = self._master.signals.of.get(name.instance)
        variable = slot.instance.fmu.variables.get(name.variable) if slot else None
        if slot is None or variable is None:
            known = [f"{s.name}.{v}" for s in self._master.signals.slots for v in s.instance.fmu.variables]
            guess = hint(str(name), known, lead="variables")
            raise ScenarioError(f"there is no variable {short(str(name))}{guess}", code="signal-unknown")
        return slot, variable

    def set(self, name: str, value: Value) -> None:
        """Change an unconnected input or a tunable parameter from now on; later steps compute with it.

        Args:
            name: `instance.variable`, `inputs.pattern`, or a fact such as "friction".
            value: in SI, or text with a unit.

        Raises:
            ScenarioError: there is no such thing, it cannot change during a run, or the value does not fit;
                nothing has been changed.
            SimulationError: an FMU refused it.
        """
        with arguments.as_scenario_errors("set"):
            target = Target.parse(arguments.text(name, "name"))
            given = arguments.scalar(value, "value")
        slots = self._master.signals.of
        if target.kind == "parameter":
            found = [self._found(SignalName(target.instance, target.variable))]
        else:
            found = [(slots[instance.name], variable) for instance, variable in reached(self._plan, target)]
        if not found:
            raise ScenarioError(
                f"{short(str(target))}: is nothing that can change in a run; give instance.variable, "
                "inputs.pattern or a fact such as friction",
                code="variable-unknown",
            )
        wanted = []
        for slot, variable in found:
            if why := self._fixed(slot, variable):
                raise ScenarioError(f"{slot.name}.{variable.name}: {why}", code="variable-wrong-kind")
            try:
                wanted.append((slot, variable, value_for(variable, given)))
            except ValueError as error:
                text = f"{slot.name}.{variable.name}: {error}"
                raise ScenarioError(text, code=code_of(error, "argument-invalid")) from None
        with self._acting():
            for slot, variable, value in wanted:
                self._put(slot, variable, value)
        says = f"{target} = {given} from t = {self.time:.9g} s, by the caller"
        self._simulation.notes.append(Diagnostic("value-changed", says, "info"))

    def _fixed(self, slot: InstanceSlot, variable: Variable) -> str:
        """Return why a variable cannot change; "" if it can."""
        own = slot.instance
        if variable.elements > 1:
            return "is an element of an array"
        wire = next((w for w in self._plan.wires if (w.target, w.input) == (own.name, variable.name)), None)
        if wire is not None:
            return f"is driven by {wire.source}.{wire.output}"
        if variable.name in own.series:
            return "follows a recorded file"
        if variable.causality == "input" or (
            variable.causality == "parameter" and variable.variability == "tunable"
        ):
            return ""
        what = "is a fixed parameter" if variable.causality == "parameter" else f"is an {variable.causality}"
        parameters = (v for v in own.fmu.variables.values() if v.causality == "parameter")
        free = [v.name for v in parameters if v.variability == "tunable"]
        more = f" and {len(free) - NAMED} more" if len(free) > NAMED else ""
        others = listed(free[:NAMED], last="and") + more if free else "no parameter"
        return f"{what}; of {own.name}, {others} can change"

    def _put(self, slot: InstanceSlot, variable: Variable, value: Value) -> None:
        """Set a variable in its FMU, and where the loop sets it again in every step."""
        signals = self._master.signals
        for i, own in enumerate(slot.inputs):
            if own.name == variable.name:
                signals.pool[slot.sources[i]] = slot.u[i] = float(value)
        if any(own.name == variable.name for own, _ in slot.other_inputs):
            signals.others[slot.name, variable.name] = value
        status = slot.fmu_instance.note(slot.fmu_instance.put([variable.ref], [variable.encoded(value)]))
        if status > WARNING:
            sentence = describe(
                slot.name, f"setting {variable.name}", self.time, status, self._simulation.log
            )
            raise SimulationError(sentence, instance=slot.name, time=self.time, code="fmu-call-failed")

    # ---- states ----

    def save(self) -> object:
        """Return the state of the run, which `restore` takes.

        Raises:
            ScenarioError: an FMU cannot save its state, or the run has faults or inputs from files.
        """
        if self._plan.faults:
            raise ScenarioError("a run with faults cannot save its state", code="state-unsaved")
        files = [instance.name for instance in self._plan.instances if instance.series]
        if files:
            text = f"a run with inputs from files cannot save its state ({listed(files)})"
            raise ScenarioError(text, code="state-unsaved")
        master, kept, cannot = self._master, dict[str, Any](), list[str]()
        with self._acting():
            self._course.flush()
            for slot in master.signals.slots:
                save = getattr(slot.fmu_instance, "save_state", None)
                kept[slot.name] = save() if save is not None else None
                if kept[slot.name] is None:
                    cannot.append(slot.name)
        if cannot:
            raise ScenarioError(
                f"{listed(cannot, last='and')} cannot save {'its' if len(cannot) == 1 else 'their'} state",
                code="state-unsaved",
            )
        signals = master.signals
        values = {
            "completed": master.completed,
            "pool": signals.pool.copy(),
            "inputs": signals.inputs.copy(),
            "others": dict(signals.others),
            "clocks": {period: clock.value for period, clock in master.clocks.items()},
            "ended": self._course.ended,
        }
        watch, notes = copy.deepcopy(self._watch), tuple(self._simulation.notes)
        return SavedState(self.time, self, kept, values, self._recorder.mark(), watch, notes)

    def restore(self, state: object) -> None:
        """Go back to a state that this run has saved; what was recorded since is forgotten.

        Raises:
            ScenarioError: the state is of another run.
            SimulationError: an FMU did not restore its state; the run is closed.
        """
        state = arguments.instance(state, "state", SavedState, "save")
        if state.of is not self:
            raise ScenarioError("the state is of another run", code="argument-invalid")
        master, values = self._master, state.master
        with self._acting():
            for slot in master.signals.slots:
                instance: Any = slot.fmu_instance
                if not instance.restore_state(state.instances[slot.name]):
                    text = f"{slot.name}: did not restore its state"
                    raise SimulationError(text, instance=slot.name, time=state.time, code="fmu-call-failed")
            signals = master.signals
            signals.pool[:] = values["pool"]
            signals.inputs[:] = values["inputs"]
            signals.others.clear()
            signals.others.update(values["others"])
            for period, clock in master.clocks.items():
                clock.value = values["clocks"][period]
            master.go_back(values["completed"])
            self._recorder.go_back(state.rows)
            self._course.go_back(values["completed"], values["ended"])
        vars(self._watch).update(copy.deepcopy(vars(state.watch)))
        self._simulation.notes[:] = state.notes

    def __repr__(self) -> str:
        end = self._plan.time(self._plan.n_steps)
        return f"<SteppedRun {self._plan.title!r} at t = {self.time:.9g} of {end:.9g} s>"
