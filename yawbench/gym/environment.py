"""Sine with dwell as an environment of Gymnasium, and policies as controllers."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import gymnasium
import numpy as np

from yawbench import arguments
from yawbench._run import Run
from yawbench._run_many import opener_of
from yawbench._scenario import load
from yawbench.events.kinds import WarningWatch
from yawbench.foundation.errors import ScenarioError
from yawbench.orchestrator.master.simulate import simulate_in_memory
from yawbench.orchestrator.plan import Plan
from yawbench.orchestrator.results.reader import Results
from yawbench.proving_ground.sine_with_dwell import SPUN, amplitudes
from yawbench.vocabulary.motion import LEAST_SPEED

ID = "yawbench/sine-with-dwell-v0"
SCENARIO = "proving_ground/sine_with_dwell"
SIGNALS = (
    "yaw_rate_ref",
    "sideslip_ref",
    "yaw_rate",
    "sideslip",
    "velocity_x",
    "acceleration_y",
    "steer_angle",
)
"""Signals that a policy observes by default, in SI."""
ANGLE = 0.77667
"""Hand-wheel angle at 0.3 g of the default car [rad], from proving_ground/slowly_increasing_steer."""
LARGEST = 10_000.0
"""Yaw moment of an action of 1 [N.m]. Chosen: about that of locking both wheels of a side on dry road."""
WORST = -1.0
"""Reward if the car spins, or fails a criterion by 100 % of its bound or more."""

Observation = np.ndarray
"""Signals in SI, shape (signals,)."""
Policy = Callable[[Observation], Any]
"""Observation -> action, a number from -1 to 1 or an array with such a number."""


class SineWithDwell(gymnasium.Env[Observation, np.ndarray]):
    """Sine with dwell (UN R140) as an environment for controllers: an episode is a run of the series.

        >>> import gymnasium, yawbench.gym
        >>> env = gymnasium.make("yawbench/sine-with-dwell-v0")
        >>> observation, info = env.reset(seed=1)
        >>> observation.shape, env.step([0.0])[1:4]
        ((7,), (0.0, False, False))
        >>> env.close()

    A step is a sample of the controller. The observation has the signals in SI; the action is the yaw moment
    over the largest one, from -1 to 1; before the first step it is 0. `reset` draws an amplitude and a side
    of the regulation's series, which `info["amplitude"]` has; `options={"amplitude": 4.7}` [rad], negative
    for right first, determines them.

    The reward is 0 until the episode ends. It ends when the run is complete: the reward is then the smallest
    margin of the criteria (stability; responsiveness where it applies), relative to their bounds, from -1
    to 1, so it is above 0 if the car passes; `info` has the margins. It also ends, with -1, when the car
    spins: when its sideslip angle exceeds 20 degrees.

    Args:
        scenario: a scenario of sine with dwell, by name or path.
        signals: names of the observed signals.
        angle: hand-wheel angle at 0.3 g [rad] of the scenario's car, of which amplitudes are multiples.
        largest: yaw moment of an action of 1 [N.m].
        render_mode: None; a run is shown by `Run.plot` and `view`.

    Raises:
        ScenarioError: the scenario or a signal is invalid.
    """

    metadata = {"render_modes": []}

    def __init__(
        self,
        scenario: str | Path = SCENARIO,
        *,
        signals: Sequence[str] = SIGNALS,
        angle: float = ANGLE,
        largest: float = LARGEST,
        render_mode: None = None,
    ) -> None:
        if render_mode is not None:
            raise ValueError("render_mode: must be None; view and Run.plot show runs")
        self.render_mode = None
        self._angle = _positive(angle, "angle")
        self._largest = _positive(largest, "largest")
        names = arguments.texts(signals, "signals")
        if not names:
            raise ValueError("signals: must not be empty")
        self._hand = _Hand(tuple(dict.fromkeys((*names, "sideslip", "velocity_x"))))
        self._indices = [self._hand.inputs.index(name) for name in names]
        self._sideslip, self._velocity = map(self._hand.inputs.index, ("sideslip", "velocity_x"))
        self._scenario = load(scenario).swap(controller=self._hand)
        self._plans: dict[float, Plan] = {}
        self._thread: threading.Thread | None = None
        infinite = np.full(len(names), np.inf)
        self.observation_space = gymnasium.spaces.Box(-infinite, infinite, dtype=np.float64)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float64)
        self._last = np.zeros(len(names))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin a run, and return the first observation and the amplitude.

        Args:
            seed: seed of the random amplitude and side.
            options: `{"amplitude": ...}`, the amplitude of the hand wheel [rad].
        """
        super().reset(seed=seed)
        self._abandon()
        series = amplitudes(self._angle)
        amplitude = float(self.np_random.choice(series) * self.np_random.choice((1.0, -1.0)))
        if options and "amplitude" in options:
            amplitude = arguments.number(options["amplitude"], "amplitude")
        self._thread = threading.Thread(target=self._drive, args=(self._plan(amplitude),), daemon=True)
        self._thread.start()
        observation, *_, info = self._next()
        return observation, {"amplitude": amplitude, **info}

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Apply a moment until the next sample: observation, reward, terminated, truncated, info."""
        if self._thread is None:
            raise RuntimeError("the episode has ended, or has not begun: call reset()")
        self._hand.answers.put(_moment(action, self._largest))
        return self._next()

    def close(self) -> None:
        """End the run, if any."""
        self._abandon()

    def _plan(self, amplitude: float) -> Plan:
        if amplitude not in self._plans:
            self._plans[amplitude] = self._scenario.set({"driver.amplitude": amplitude}).plan()
        return self._plans[amplitude]

    def _drive(self, plan: Plan) -> None:
        """Make a run in a separate thread, in which the controller waits for every action."""
        try:
            opener, watch = opener_of(self._scenario._programs), WarningWatch(plan)
            self._hand.requests.put(simulate_in_memory(plan, opener=opener, watch=watch))
        except BaseException as error:  # including `_Abandoned`
            self._hand.requests.put(error)

    def _next(self) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Wait for the next sample, or for the end of the run."""
        request = self._hand.requests.get()
        if isinstance(request, BaseException):
            self._thread = None
            raise request
        if isinstance(request, Results):
            self._thread = None
            reward, info = self._judged(request)
            return self._last, reward, True, False, info
        self._last = np.array([request[index] for index in self._indices])
        moving = abs(request[self._velocity]) >= LEAST_SPEED
        if moving and abs(request[self._sideslip]) > SPUN:
            self._abandon()
            return self._last, WORST, True, False, {"passed": False}
        return self._last, 0.0, False, False, {}

    def _judged(self, results: Results) -> tuple[float, dict[str, Any]]:
        judged = Run(results).evaluate("sine-with-dwell", angle=self._angle)
        margins = {
            name: float(np.clip(WORST if verdict.margin is None else verdict.margin, -1.0, 1.0))
            for name, verdict in judged.criteria.items()
            if verdict.holds is not None or name == "stability"
        }
        return min(margins.values()), {**margins, "passed": min(margins.values()) >= 0.0}

    def _abandon(self) -> None:
        """End a run that waits for an action."""
        if self._thread is not None:
            self._hand.answers.put(None)
            self._thread.join()
            while not self._hand.requests.empty():
                self._hand.requests.get()
            self._thread = None


class _Abandoned(BaseException):
    """Exception that ends the run of an abandoned episode; not an error of the controller."""


class _Hand:
    """Controller of an environment, which requests every value from the agent."""

    outputs = ("yaw_moment",)

    def __init__(self, inputs: tuple[str, ...]) -> None:
        self.inputs = inputs
        self.requests: SimpleQueue[Sequence[float] | Results | BaseException] = SimpleQueue()
        self.answers: SimpleQueue[float | None] = SimpleQueue()
        self._began = -math.inf

    def __deepcopy__(self, memo: object) -> _Hand:
        return self  # the run uses this object itself

    def start(self, t: float, u: Sequence[float]) -> None:
        self._began = t

    def output(self, t: float, u: Sequence[float]) -> float:
        if t <= self._began:
            return 0.0
        self.requests.put(u)
        answer = self.answers.get()
        if answer is None:
            raise _Abandoned
        return answer


class _PolicyController:
    """Policy as a controller, called in runs as in the environment."""

    outputs = ("yaw_moment",)

    def __init__(self, policy: Policy, inputs: tuple[str, ...], largest: float) -> None:
        self.policy, self.inputs, self._largest = policy, inputs, largest
        self._began = -math.inf

    def start(self, t: float, u: Sequence[float]) -> None:
        self._began = t

    def output(self, t: float, u: Sequence[float]) -> float:
        return 0.0 if t <= self._began else _moment(self.policy(np.array(u)), self._largest)


def as_controller(
    policy: Policy, *, signals: Sequence[str] = SIGNALS, largest: float = LARGEST
) -> _PolicyController:
    """Return a policy as a controller, for `Scenario.swap`, `experiment` and `rank`.

        >>> import yawbench.gym
        >>> damp = yawbench.gym.as_controller(lambda observation: 8.0 * (observation[0] - observation[2]))
        >>> yb.rank(damp, name="damp", against=["none"], conditions=["hard"], quick=True).place("damp")
        1

    Args:
        policy: observation -> action, as in the environment; every run uses a copy of an object.
        signals, largest: as in the environment.
    """
    policy = arguments.function(policy, "policy", "observation")
    return _PolicyController(
        policy, tuple(arguments.texts(signals, "signals")), _positive(largest, "largest")
    )


def _moment(action: Any, largest: float) -> float:
    """Return the yaw moment of an action [N.m].

    Raises:
        ValueError: it is not a single finite number.
    """
    values = np.ravel(np.asarray(action, dtype=float))
    if values.size != 1 or not math.isfinite(values[0]):
        raise ValueError(f"action: must be one finite number from -1 to 1 (got {action!r})")
    return float(min(max(values[0], -1.0), 1.0)) * largest


def _positive(value: Any, name: str) -> float:
    number = arguments.number(value, name)
    if number <= 0.0:
        raise ScenarioError(f"{name}: must be above 0 (got {number:g})", code="argument-invalid")
    return number
