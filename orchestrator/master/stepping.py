"""A run that its caller steps: up to a time or a condition, with values changed and states saved on the way.

The steps are those of `RunLifecycle`, which makes every run; nothing changed, the rows are the same bits.
"""

from __future__ import annotations

import contextlib
import copy
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from yawbench.fmus.fmu import Value, Variable
from yawbench.foundation.errors import Diagnostic, ScenarioError, SimulationError, code_of
from yawbench.foundation.interrupts import interrupts
from yawbench.foundation.messages import hint, listed, short

from ..plan import Plan
from ..results.reader import Results
from ..results.recorder import MemoryRecorder
from ..results.run_record import RunStatus
from ..signal_names import SignalName, Target
from ..wiring.context import reached
from ..wiring.parameters import value_for
from .fmi import open_instance
from .log import WARNING, describe
from .run_lifecycle import OpenInstance
from .signal_pool import InstanceSlot
from .simulate import Simulation, Watch, memory_recorder
from .step_loop import Master

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
    watch: Watch | None
    notes: tuple[Diagnostic, ...]


class SteppedRun:
    """A run that has been initialized and waits to be stepped; `close` frees its instances.

    Args:
        plan: of the run.
        opener: creates the instances.
        watch: looks at the rows.

    Raises:
        ScenarioError: the results would not fit into memory.
        SimulationError: it cannot be initialized.
    """

    def __init__(
        self, plan: Plan, *, opener: OpenInstance = open_instance, watch: Watch | None = None
    ) -> None:
        self.plan = plan
        self._watch = watch
        self._recorder: MemoryRecorder = memory_recorder(plan)
        self._simulation = Simulation(plan, self._recorder, None, watch, apart=False)
        self._course = self._simulation.course
        self._open = True
        self._failed: SimulationError | None = None
        with self._acting():
            self._course.begin(opener)

    def close(self) -> None:
        """Free the instances; what was recorded stays."""
        if self._open:
            self._open = False
            with interrupts(self._simulation.stop, self._simulation.abandon):
                self._course.end()

    @contextlib.contextmanager
    def _acting(self) -> Iterator[None]:
        """Let Ctrl-C end the block between two steps; close the run if it fails.

        Raises:
            ScenarioError: the run is closed, or has failed.
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
            raise
        finally:
            stop.flag.value = 0

    @property
    def _master(self) -> Master:
        assert self._course.master is not None
        return self._course.master

    @property
    def completed(self) -> int:
        """The communication point that has been reached, from 0."""
        return self._master.completed

    @property
    def time(self) -> float:
        """Its time [s]."""
        return self.plan.time(self.completed)

    @property
    def done(self) -> bool:
        """Whether the stop time is reached, or an instance has ended the run."""
        return self.completed >= self.plan.n_steps or self._course.ended is not None

    def point_at(self, time: float) -> int:
        """Return the last communication point up to a time [s], at most the last of the run.

        Raises:
            ScenarioError: the time has passed, or lies after the end.
        """
        points = (time - self.plan.time(0)) / float(self.plan.step) + LATE
        if not self.completed <= points < self.plan.n_steps + 1:
            raise ScenarioError(
                f"time: the run is at t = {self.time:.9g} s and ends at "
                f"{self.plan.time(self.plan.n_steps):.9g} s; it cannot go to {time:.9g} s",
                code="argument-invalid",
            )
        return int(points)

    def advance(self, point: int, when: Callable[[], bool] | None = None) -> bool:
        """Step to a communication point, or until an instance ends the run.

        Args:
            point: the last one to be reached.
            when: asked after every step: whether to stop there.

        Returns whether `when` stopped it.

        Raises:
            SimulationError: an instance failed; the run is closed.
            Interrupted: Ctrl-C; the run can go on.
        """
        if when is None:
            with self._acting():
                self._course.step_to(point)
            return False
        while self.completed < point and not self.done:
            with self._acting():
                self._course.step_to(self.completed + 1)
            if when():
                return True
        return False

    def finish(self) -> Results:
        """Step to the end and return the results, which are those of a run."""
        with self._acting():
            self._course.step_to(self.plan.n_steps)
            self._simulation.save_all()
        assert self._recorder.results is not None
        return self._recorder.results

    def so_far(self) -> Results:
        """Return what has been recorded."""
        if self._open:
            self._course.flush()
        self._simulation.save(RunStatus.FAILED if self._failed else RunStatus.INTERRUPTED, self._failed)
        made = self._recorder.results
        assert made is not None
        columns = {name: values.copy() for name, values in made.columns.items()}
        return Results(made.folder, made.time.copy(), columns, made.units, made.record.model_copy(deep=True))

    # ---- values ----

    def value(self, name: SignalName) -> Value:
        """Return the value of a variable now.

        Raises:
            ScenarioError: there is no such variable, or the FMU does not tell it.
        """
        signals = self._master.signals
        slot, variable = self._found(name)
        if (at := signals.index.get(name)) is not None:
            return float(signals.pool[at])
        if name in signals.others and variable.causality == "output":
            return signals.others[name]
        with self._acting():
            status, values = slot.fmu_instance.fetch([variable.ref])
        if slot.fmu_instance.note(status) > WARNING:
            raise ScenarioError(f"{name}: {slot.name} does not tell it between steps", code="fmu-call-failed")
        return values[0]

    def _found(self, name: SignalName) -> tuple[InstanceSlot, Variable]:
        slot = self._master.signals.of.get(name.instance)
        variable = slot.instance.fmu.variables.get(name.variable) if slot else None
        if slot is None or variable is None:
            known = [f"{s.name}.{v}" for s in self._master.signals.slots for v in s.instance.fmu.variables]
            guess = hint(str(name), known, lead="variables")
            raise ScenarioError(f"there is no variable {short(str(name))}{guess}", code="signal-unknown")
        return slot, variable

    def change(self, target: Target, given: Value) -> None:
        """Change unconnected inputs and tunable parameters from now on.

        Args:
            target: `instance.variable`, `inputs.pattern`, or a fact such as friction.
            given: in SI, or text with a unit.

        Raises:
            ScenarioError: there is nothing of that name, it cannot change, or the value does not fit; nothing
                has been changed.
            SimulationError: an FMU refused it; the run is closed.
        """
        slots = self._master.signals.of
        if target.kind == "parameter":
            found = [self._found(SignalName(target.instance, target.variable))]
        else:
            found = [(slots[instance.name], variable) for instance, variable in reached(self.plan, target)]
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
        wire = next((w for w in self.plan.wires if (w.target, w.input) == (own.name, variable.name)), None)
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

    def save(self) -> SavedState:
        """Return the state of the run, to come back to it.

        Raises:
            ScenarioError: an FMU cannot save its state, or the run has faults or inputs from files, which
                cannot.
        """
        if self.plan.faults:
            raise ScenarioError("a run with faults cannot save its state", code="state-unsaved")
        files = [instance.name for instance in self.plan.instances if instance.series]
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

    def restore(self, state: SavedState) -> None:
        """Go back to a state that this run has saved; later rows are forgotten.

        Raises:
            ScenarioError: the state is of another run.
            SimulationError: an FMU did not restore its state; the run is closed.
        """
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
        if self._watch is not None:
            vars(self._watch).update(copy.deepcopy(vars(state.watch)))
        self._simulation.notes[:] = state.notes
