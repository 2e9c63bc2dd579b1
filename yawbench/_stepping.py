"""Runs that a program steps itself: created by `Scenario.start`."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import Any, TypeVar

from yawbench.events.kinds import WarningWatch
from yawbench.fmus.fmu import Value
from yawbench.foundation.errors import SimulationError
from yawbench.metrics.expressions import results_to_be
from yawbench.orchestrator.master.stepping import SavedState
from yawbench.orchestrator.master.stepping import SteppedRun as Stepped
from yawbench.orchestrator.plan import Plan
from yawbench.orchestrator.signal_names import SignalName, Target

from . import arguments
from ._run import Run
from ._run_many import Opened

T = TypeVar("T")


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
        self._opened = Opened(opener)
        self._run = self._of_program(lambda: Stepped(plan, opener=self._opened, watch=WarningWatch(plan)))
        self._columns = results_to_be(plan)

    def __enter__(self) -> SteppedRun:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free the FMUs. What was recorded stays."""
        self._run.close()

    @property
    def time(self) -> float:
        """The time that has been reached [s]."""
        return self._run.time

    @property
    def done(self) -> bool:
        """Whether the run has reached its stop time, or an FMU has ended it."""
        return self._run.done

    def step(self, steps: int = 1) -> float:
        """Make communication steps, at most to the stop time, and return the time reached [s].

        Raises:
            SimulationError: an FMU failed; an exception of Python code is its `__cause__`.
        """
        steps = arguments.count(steps, "steps", most=self._run.plan.n_steps + 1)
        point = min(self._run.completed + steps, self._run.plan.n_steps)
        self._of_program(lambda: self._run.advance(point))
        return self.time

    def run_to(self, time: float) -> float:
        """Step to the last communication point up to a time [s], and return its time.

        Raises:
            ScenarioError: the time has passed, or lies after the stop time.
            SimulationError: an FMU failed.
        """
        point = self._run.point_at(arguments.number(time, "time"))
        self._of_program(lambda: self._run.advance(point))
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
        last = self._run.plan.n_steps if time is None else self._run.point_at(arguments.number(time, "time"))
        return self._of_program(lambda: self._run.advance(last, condition))

    def __getitem__(self, name: str) -> Value:
        """Return the value now of a variable, by `instance.variable` or by the unique name of a column."""
        text = arguments.text(name, "name of a variable")
        return self._run.value(SignalName.parse(text if "." in text else self._columns.column(text)))

    def set(self, name: str, value: Value) -> None:
        """Change an unconnected input or a tunable parameter from now on; later steps compute with it.

        Args:
            name: `instance.variable`, `inputs.pattern`, or a fact such as "friction".
            value: in SI, or text with a unit.

        Raises:
            ScenarioError: there is no such thing, it cannot change during a run, or the value does not fit.
            SimulationError: an FMU refused it.
        """
        with arguments.as_scenario_errors("set"):
            target = Target.parse(arguments.text(name, "name"))
            given = arguments.scalar(value, "value")
        self._of_program(lambda: self._run.change(target, given))

    def save(self) -> object:
        """Return the state of the run, which `restore` takes.

        Raises:
            ScenarioError: an FMU cannot save its state, or the run has faults or inputs from files.
        """
        return self._run.save()

    def restore(self, state: object) -> None:
        """Go back to a state that this run has saved; what was recorded since is forgotten.

        Raises:
            ScenarioError: the state is of another run.
        """
        self._run.restore(arguments.instance(state, "state", SavedState, "save"))

    def finish(self) -> Run:
        """Run to the stop time and return the results; without changes, those of `Scenario.run`, to the bit.

        Raises:
            SimulationError: an FMU failed.
        """
        return Run(self._of_program(self._run.finish))

    @property
    def run(self) -> Run:
        """What has been recorded so far."""
        return Run(self._run.so_far())

    def _of_program(self, act: Callable[[], T]) -> T:
        """Return what `act` does; an exception of Python code is the cause of its error."""
        try:
            return act()
        except SimulationError as error:
            raise error from self._opened.cause(error)

    def __repr__(self) -> str:
        plan = self._run.plan
        end = plan.time(plan.n_steps)
        return f"<SteppedRun {plan.title!r} at t = {self.time:.9g} of {end:.9g} s>"
