"""Linear models of scenarios, from saved states of their components and central differences."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from yawbench import arguments
from yawbench._scenario import Scenario
from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import listed, short
from yawbench.foundation.progress import bar
from yawbench.orchestrator.scenario.overrides import with_changes

from .operating_point import LARGE, SMALL, OperatingPoint

if TYPE_CHECKING:
    from control import StateSpace

HORIZON = 1000
"""Steps of the responses that decide which states are kept. Chosen: 1 s at the usual step of 1 ms."""
TOLERANCE = 1e-6
"""Hankel singular value, relative to the largest, below which a state is omitted. Chosen: well above the
noise of the differences, and below any measurable effect."""
FAST = 0.3
"""Discrete eigenvalue below which a mode settles within a step. Chosen: a time constant of 0.8 steps."""
DIRECT = 0.05
"""Largest feedthrough, as a share of a signal's response, for a signal to be a state. Chosen: far above that
of a step relative to a time constant, far below that of a gain."""
SAME = 1e-4
"""Relative difference up to which a value of the reduced model equals that of the full model. Chosen: far
above noise."""
DISTINCT = 1e6
"""Largest condition number of values chosen as states, each relative to its largest response. Chosen: leaves
three digits above the noise."""
REQUESTED, SIGNAL, VALUE, EARLIER = 100.0, 10.0, 1.0, 0.0
"""Preference as a state: of a requested output, of another signal, of a value inside a component, of a
sample that the master keeps (none). Chosen: factors of 10, so that a signal is taken unless it is nearly a
combination of others."""


@dataclass(frozen=True, repr=False)
class LinearModel:
    """Linear model of deviations, dx/dt = A x + B u, y = C x + D u; created by `linearize`.

        >>> yb.linearize(base, at=0.5, inputs=["driver.steer_angle"], outputs=["plant.yaw_rate"])
        <LinearModel at 0.5 s, continuous: ... states from driver.steer_angle to plant.yaw_rate>

    Attributes:
        A, B, C, D: matrices in SI, of shapes (states, states), (states, inputs), (outputs, states) and
            (outputs, inputs).
        inputs, outputs, states: name -> unit of measurement, in order; "" for a value inside a component.
        dt: sampling time [s] of a sampled model, x[k+1] = A x[k] + B u[k]; 0: continuous.
        time: time of the operating point [s].
        title: title of the scenario.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    states: Mapping[str, str]
    dt: float
    time: float
    title: str

    def to_control(self) -> StateSpace:
        """Return the model as a `StateSpace` of python-control, with its names, `_` in place of `.`.

        Raises:
            ImportError: python-control is not installed.
        """
        import control

        kinds = {"inputs": self.inputs, "outputs": self.outputs, "states": self.states}
        named = {kind: [name.replace(".", "_") for name in names] for kind, names in kinds.items()}
        return control.ss(self.A, self.B, self.C, self.D, self.dt, **named)

    def __repr__(self) -> str:
        kind = f"sampled every {self.dt:g} s" if self.dt else "continuous"
        into, of = (listed(list(names), last="and") for names in (self.inputs, self.outputs))
        return f"<LinearModel at {self.time:g} s, {kind}: {len(self.states)} states from {into} to {of}>"


def linearize(
    scenario: Scenario, *, at: float, inputs: Iterable[str], outputs: Iterable[str], discrete: bool = False
) -> LinearModel:
    """Linearize a scenario around the state that its run reaches at a given time.

        >>> model = yb.linearize(base, at=1, inputs=["driver.steer_angle"], outputs=["plant.yaw_rate"])
        >>> model.inputs, model.outputs
        ({'driver.steer_angle': 'rad'}, {'plant.yaw_rate': 'rad/s'})

    The components run in Python up to this time. From their saved states, every signal and every value
    inside a component that the inputs affect is displaced in both directions for one step of all instances,
    which gives a sampled model. States without effect between inputs and outputs are removed by balanced
    truncation; the others are signals, or values inside components that no signal shows. The continuous model
    has the same response to inputs that are held for a step; modes that settle within a step become direct
    feedthrough.

    Where a law is not smooth (a dead band, a limit just reached), the slope is the mean of both sides.

    Args:
        scenario: scenario from `load`, possibly changed.
        at: time of the operating point [s], rounded down to a step of all instances.
        inputs: signals (`instance.output`, for all receivers) or inputs (`instance.input`) that deviate.
        outputs: signals that are observed.
        discrete: whether to return the sampled model.

    Raises:
        ScenarioError: the time lies outside the run, a signal is unknown, an FMU hides its state (from
            another tool, or in C), there are faults, or no continuous model has this response.
        SimulationError: an instance failed.
    """
    scenario = arguments.instance(scenario, "scenario", Scenario, "yawbench.load")
    time = arguments.number(at, "at")
    into, of = arguments.texts(inputs, "inputs"), arguments.texts(outputs, "outputs")
    discrete = arguments.flag(discrete, "discrete")
    for name, names in (("inputs", into), ("outputs", of)):
        if not names or len(set(names)) < len(names) or (name == "outputs" and set(names) & set(into)):
            raise ValueError(f"{name}: must be signals, each once (got {short(names)})")
    title = with_changes(scenario.title, scenario.changes)
    with bar(f"Linearize {title}"):
        point = OperatingPoint(scenario, time, into, of)
        sampled = _reduced(_differences(point))
        model = sampled.named() if discrete else sampled.continuous(point.dt)
    if model is None:
        text = f"a mode changes its sign with every step of {point.dt:g} s, which no continuous model does"
        raise ScenarioError(f"{scenario.title}: {text}: request discrete=True", code="option-invalid")
    a, b, c, d, states = model
    dt = point.dt if discrete else 0.0
    return LinearModel(a, b, c, d, point.inputs, point.outputs, states, dt, point.time, title)


Matrices = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, str]]
"""A, B, C, D, and the names of the states with units."""


@dataclass(frozen=True)
class _Sampled:
    """Sampled model x[k+1] = F x[k] + G u[k] of all values that the inputs affect.

    Attributes:
        f, g: matrices in SI.
        names: of the values x, with units.
        preferences: preference of each value as a state.
        outputs: indices of the outputs among x.
    """

    f: np.ndarray
    g: np.ndarray
    names: list[tuple[str, str]]
    preferences: np.ndarray
    outputs: list[int]


def _differences(point: OperatingPoint) -> _Sampled:
    """Return the sampled model at an operating point, by central differences."""
    shown = [point.key_of(name) for name in point.outputs]
    keys = list(dict.fromkeys((*shown, *point.reached())))
    f, g = np.empty((len(keys), len(keys))), np.empty((len(keys), len(point.inputs)))
    for j, (key, x) in enumerate(zip(keys, point.values(keys).tolist(), strict=True)):
        size = point.size(key, x)
        high, low = x + size, x - size
        difference = point.after(keys, displaced={key: high}, added={})
        difference -= point.after(keys, displaced={key: low}, added={})
        f[:, j] = difference / (high - low)
    for j, (name, unit) in enumerate(point.inputs.items()):
        size = LARGE.get(unit, SMALL)
        difference = point.after(keys, displaced={}, added={name: size})
        difference -= point.after(keys, displaced={}, added={name: -size})
        g[:, j] = difference / (2.0 * size)
    signals = point.signals
    names = [signals[at] if isinstance(at, int) and at in signals else (point.name(at), "") for at in keys]
    preferences = [
        REQUESTED if at in shown else SIGNAL if at in signals else EARLIER if isinstance(at, int) else VALUE
        for at in keys
    ]
    return _Sampled(f, g, names, np.array(preferences), list(range(len(shown))))


@dataclass(frozen=True)
class _Reduced:
    """Reduced sampled model z[k+1] = a z[k] + b u[k]; the values of the full model are `rows` z."""

    a: np.ndarray
    b: np.ndarray
    rows: np.ndarray
    full: _Sampled
    size: np.ndarray  # largest response of each value of the full model
    held: np.ndarray  # and to each input if it is held, shape (values, inputs)
    shown: np.ndarray  # whether the reduced model has the same response of the value

    def _states(self, rows: np.ndarray, usable: np.ndarray) -> tuple[np.ndarray, list[int], dict[str, str]]:
        """Choose values of the full model as states, as many as `rows` has columns.

        Returns:
            The states in the coordinates of `rows`, the indices of the values, and their names with units. If
            too few values are independent of each other, the last states are modes without a meaning.
        """
        from scipy.linalg import null_space, qr

        n = rows.shape[1]
        normal = rows / self.size[:, None]
        weight = np.where(usable, self.full.preferences, 0.0)
        chosen = qr((weight[:, None] * normal).T, pivoting=True)[2][:n].tolist() if n else []
        while chosen and not (weight[chosen].all() and np.linalg.cond(normal[chosen]) < DISTINCT):
            chosen.pop()
        rest = null_space(normal[chosen]).T if chosen else np.eye(n)
        names = [self.full.names[i] for i in chosen] + [(f"mode {k + 1}", "") for k in range(len(rest))]
        return np.vstack([rows[chosen], rest]), chosen, dict(names)

    def named(self) -> Matrices:
        """Return the model with values of the full model as states."""
        t, _, names = self._states(self.rows, self.shown)
        a, c = _changed(self.a, t), self.rows[self.full.outputs] @ np.linalg.inv(t)
        return a, t @ self.b, c, np.zeros((len(c), self.b.shape[1])), names

    def continuous(self, dt: float) -> Matrices | None:
        """Return the continuous model with the same response to held inputs; None if there is none.

        Modes that settle within a step are replaced by their final values.
        """
        from scipy.linalg import expm, logm, schur, solve_sylvester

        triangle, q, n = schur(self.a, sort=lambda x, y=0.0: abs(complex(x, y)) > FAST)
        slow, cross, fast = triangle[:n, :n], triangle[:n, n:], triangle[n:, n:]
        x = solve_sylvester(slow, -fast, -cross) if cross.size else np.zeros_like(cross)
        # z = q (s + x f, f) decouples s and f
        b_fast = q[:, n:].T @ self.b
        b_slow = q[:, :n].T @ self.b - x @ b_fast
        of_slow = self.rows @ q[:, :n]
        of_fast = self.rows @ (q[:, :n] @ x + q[:, n:])
        settled = np.linalg.solve(np.eye(len(fast)) - fast, b_fast)
        direct = (np.abs(of_fast @ settled) <= DIRECT * self.held).all(axis=1)
        t, chosen, names = self._states(of_slow, self.shown & direct)
        follows = np.zeros((n, len(fast)))
        follows[: len(chosen)] = of_fast[chosen]
        a = _changed(slow, t)
        b = t @ b_slow + follows @ b_fast + (follows @ fast - a @ follows) @ settled
        outputs = self.full.outputs
        c = of_slow[outputs] @ np.linalg.inv(t)
        d = (of_fast[outputs] - c @ follows) @ settled
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about accuracy, which is checked here
            # logarithm of the Schur form: with states of different units it would lose digits
            logarithm = np.real(logm(slow)) if n else slow
        if np.abs(expm(logarithm) - slow).max(initial=0.0) > TOLERANCE * np.abs(slow).max(initial=0.0):
            return None
        rates = _changed(logarithm, t) / dt
        b = _held_input(rates, dt, b)
        return rates, b, c, d, names


def _changed(a: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return `a` for the states t z."""
    changed: np.ndarray = t @ a @ np.linalg.inv(t)
    return changed


def _held_input(a: np.ndarray, dt: float, b: np.ndarray) -> np.ndarray:
    """Return the continuous B of a sampled one: b = (integral of exp(a t) over dt) B; a may be singular."""
    from scipy.linalg import expm

    n = len(a)
    both = expm(np.block([[a * dt, np.eye(n) * dt], [np.zeros((n, 2 * n))]]))
    continuous: np.ndarray = np.linalg.solve(both[:n, n:], b)
    return continuous


def _responses(f: np.ndarray, g: np.ndarray, steps: int) -> np.ndarray:
    """Return f^k g of all steps k, shape (steps, states, inputs)."""
    columns = [g]
    for _ in range(steps - 1):
        columns.append(f @ columns[-1])
    return np.array(columns)


def _reduced(full: _Sampled) -> _Reduced:
    """Remove states that are not controllable or not observable, by balanced truncation.

    The truncation uses a finite time, so that integrators and unstable modes are allowed, and responses
    instead of Gramians, which are their squares and would halve the digits.
    """
    from scipy.linalg import qr, svd

    reach = _responses(full.f, full.g, HORIZON)
    size = np.abs(reach).max(axis=(0, 2))
    size[size == 0.0] = 1.0
    f = full.f * size / size[:, None]
    show = np.zeros((len(f), len(full.outputs)))
    show[full.outputs, range(len(full.outputs))] = 1.0
    forth = qr(np.hstack(list(reach / size[:, None])).T, mode="r")[0][: len(f)].T
    back = qr(np.hstack(list(_responses(f.T, show, HORIZON))).T, mode="r")[0][: len(f)]
    u, sigma, v = svd(back @ forth, full_matrices=False)
    order = int(np.sum(sigma > TOLERANCE * sigma[0])) if sigma.size else 0
    root = np.sqrt(sigma[:order])
    t, w = size[:, None] * (forth @ v[:order].T / root), (u[:, :order] / root).T @ back / size
    a, b = w @ full.f @ t, w @ full.g
    same = np.abs(t @ _responses(a, b, HORIZON) - reach).max(axis=(0, 2)) <= SAME * size
    return _Reduced(a, b, t, full, size, np.abs(np.cumsum(reach, axis=0)).max(axis=0), same)
