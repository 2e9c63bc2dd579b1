"""Least-squares estimates from measured signals: search, identifiability, intervals.

The residuals are f = (y(t - d) + z - y_m(t)) / e: y simulated, y_m measured, e the expected difference of a
signal, d and z the measurement's delay and offset if they are free; and one row (p - mean) / deviation per
prior. The loss is sum rho(f^2), for signals soft_l1, rho(s) = 2 (sqrt(1 + s) - 1), quadratic for priors.
`scipy.optimize.least_squares` minimizes it, after a few steps with squares alone: trust region reflective,
within bounds, scaled by the Jacobian J. Columns of J are differences of simulations; those of delays and
offsets of compared signals need no simulation.

Errors of samples close in time are correlated: a model that is slightly wrong is wrong for a whole bend. So
rows are treated as independent only between pieces of several seconds. The covariance of the estimate is

    V = B^-1 (sum over pieces g of s_g s_g') B^-1,   B = J' diag(w) J,   s_g = (1 - A_g B^-1)^-1 J_g' psi_g

with psi = f rho', w = rho' + 2 f^2 rho'', and A_g = J_g' diag(w) J_g, the contribution of piece g to B: each
piece is judged by an estimate made without it. `(J' J)^-1` times the variance of the residuals would treat
every sample as an independent measurement, which makes intervals several times too narrow.

Sources: M. A. Branch, T. F. Coleman, Y. Li, SIAM J. Scientific Computing 21(1), 1999, 1-23 (the search);
A. C. Cameron, D. L. Miller, A Practitioner's Guide to Cluster-Robust Inference, J. Human Resources 50(2),
2015, section VI.B (the covariance CR3, and t quantiles with one degree of freedom less than pieces).
"""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

import numpy as np

from yawbench.foundation.safe_files import write_whole

PIECE = 5.0
"""Duration of a piece [s]; chosen: longer than a bend, ten times a correlation of 0.5 s."""
LEAST_PIECES = 5
"""Least number of pieces for an interval; chosen: with fewer, t quantiles exceed 3."""
LARGEST_CONDITION = 1e4
"""Condition beyond which parameters are refused; chosen: 5 to 103 where they can be identified, else 1e5."""
NAMED = 0.2
"""Share of the largest component from which on components of the weakest direction are named; chosen."""
CONFIDENCE = 0.95
"""Confidence of the intervals; chosen: the usual one."""
DIFFERENCE = 1e-4
"""Relative step of the differences for J; chosen: between rounding and curvature."""
INFEASIBLE = 1e3
"""Residual of a simulation that failed; chosen: never accepted."""
TOLERANCE = 1e-6
"""Relative change of loss or parameters that ends the search; chosen: far below any interval."""
FIRST = 1e-3
"""Likewise of the first search, with squares alone, which is faster far from the result; chosen."""

Kind = Literal["run", "offset", "delay"]
CONVERGED = "the loss or the parameters no longer change"  # message of a search that found a minimum


@dataclass(frozen=True)
class Parameter:
    """A free parameter."""

    name: str
    start: float
    low: float
    high: float
    kind: Kind = "run"  # "offset" or "delay" of a compared signal: needs no simulation
    signal: str = ""  # the compared signal of those two
    prior: tuple[float, float] | None = None  # mean and deviation
    unit: str = "1"


@dataclass(frozen=True)
class Window:
    """A part of a measurement that is simulated from its own initial state.

    Attributes:
        name: for messages.
        times: of the compared samples [s], shape (n,), evenly spaced.
        measured: compared signal -> values, shape (n,).
    """

    name: str
    times: np.ndarray
    measured: Mapping[str, np.ndarray]


Simulated = Mapping[str, np.ndarray] | None
"""Compared signal -> values at a window's times; None: the run failed."""


class Model(Protocol):
    """Simulates windows for sets of parameter values."""

    def __call__(self, sets: Sequence[Mapping[str, float]]) -> list[list[Simulated]]:
        """Return for each set the signals in each window."""


@dataclass(frozen=True)
class Identifiability:
    """Conditioning of a fit: how well the effects of its parameters can be told apart.

    Attributes:
        condition: of J with columns scaled to length 1; infinite if a column is 0.
        weakest: parameters that change together with the least effect -> share, of the largest 1.
        without_effect: parameters whose columns are 0.
    """

    condition: float
    weakest: dict[str, float]
    without_effect: tuple[str, ...] = ()

    @property
    def refused(self) -> bool:
        """Whether the parameters cannot be identified."""
        return not self.condition <= LARGEST_CONDITION

    @property
    def words(self) -> str:
        """The weakest direction in words."""
        if self.without_effect:
            return f"no effect on the compared signals: {', '.join(self.without_effect)}"
        *others, last = self.weakest
        names = f"{', '.join(others)} and {last}" if others else last
        return f"{names} change together with almost no effect on the compared signals"


def identifiability(jacobian: np.ndarray, names: Sequence[str]) -> Identifiability:
    """Return the condition of a Jacobian of shape (rows, parameters) and its weakest direction.

    Of no parameters, as where all have reached a bound, it is 1, and there is no direction.
    """
    if not names:
        return Identifiability(1.0, {})
    lengths = np.linalg.norm(jacobian, axis=0)
    if silent := tuple(name for name, length in zip(names, lengths, strict=True) if not length > 0.0):
        return Identifiability(np.inf, dict.fromkeys(silent, 1.0), silent)
    _, singular, directions = np.linalg.svd(jacobian / lengths, full_matrices=False)
    condition = float(singular[0] / singular[-1]) if singular[-1] > 0.0 else np.inf
    direction = directions[-1] / np.abs(directions[-1]).max()
    order = np.argsort(-np.abs(direction), kind="stable")
    return Identifiability(
        condition, {names[i]: float(direction[i]) for i in order if abs(direction[i]) >= NAMED}
    )


def covariance(residuals: np.ndarray, jacobian: np.ndarray, pieces: np.ndarray) -> np.ndarray | None:
    """Return the covariance V of an estimate, clustered by pieces; None if there are too few of them.

    Args:
        residuals: shape (rows,).
        jacobian: shape (rows, parameters).
        pieces: number of each row's piece, shape (rows,); negative: a prior.
    """
    prior = pieces < 0
    own = np.unique(pieces[~prior])
    if len(own) < LEAST_PIECES or jacobian.shape[1] == 0:
        return None
    square = np.where(prior, 0.0, residuals**2)
    score = jacobian * (residuals / np.sqrt(1.0 + square))[:, None]
    weighted = jacobian * ((1.0 + square) ** -1.5)[:, None]
    inverse = np.linalg.inv(jacobian.T @ weighted)
    meat = jacobian[prior].T @ jacobian[prior]
    for piece in own:
        rows = pieces == piece
        without = np.eye(len(inverse)) - jacobian[rows].T @ weighted[rows] @ inverse
        pull = np.linalg.lstsq(without, score[rows].sum(axis=0), rcond=None)[0]
        meat = meat + np.outer(pull, pull) * (len(own) - 1) / len(own)
    spread: np.ndarray = inverse @ meat @ inverse
    return spread


def intervals_of(covariance: np.ndarray, pieces: int) -> np.ndarray:
    """Return the half widths of the intervals of `CONFIDENCE`, shape (parameters,)."""
    from scipy.special import stdtrit  # what scipy.stats.t uses, without its slow import

    widths: np.ndarray = stdtrit(pieces - 1, 0.5 + CONFIDENCE / 2.0) * np.sqrt(np.diag(covariance))
    return widths


@dataclass(frozen=True)
class Estimate:
    """The result of a search.

    Attributes:
        values: parameter -> value.
        identifiability: at these values.
        pieces: number of pieces of `PIECE` that the windows hold.
        covariance: shape (parameters, parameters); None: too few pieces.
        at_bound: parameters that ended at a bound; they have no interval.
        sets: number of sets of values that were simulated.
        loss: at the start and at the end.
        message: why the search ended.
        simulated: signals in each window, without delays and offsets of the measurement.
    """

    values: dict[str, float]
    identifiability: Identifiability
    pieces: int
    covariance: np.ndarray | None
    at_bound: tuple[str, ...]
    sets: int
    loss: tuple[float, float]
    message: str
    simulated: list[Simulated]

    def intervals(self) -> dict[str, tuple[float, float] | None]:
        """Return the interval of `CONFIDENCE` of each parameter, None where there is none."""
        intervals: dict[str, tuple[float, float] | None] = dict.fromkeys(self.values)
        if self.covariance is not None:
            inner = [name for name in self.values if name not in self.at_bound]
            for name, half in zip(inner, intervals_of(self.covariance, self.pieces).tolist(), strict=True):
                intervals[name] = self.values[name] - half, self.values[name] + half
        return intervals

    def correlated(self, least: float = 0.9) -> list[tuple[str, str, float]]:
        """Return the pairs of parameters whose correlation is at least `least`."""
        if self.covariance is None:
            return []
        inner = [name for name in self.values if name not in self.at_bound]
        deviations = np.sqrt(np.diag(self.covariance))
        correlation = self.covariance / np.outer(deviations, deviations)
        return [
            (first, second, float(correlation[i, j]))
            for i, first in enumerate(inner)
            for j, second in enumerate(inner[:i])
            if abs(correlation[i, j]) >= least
        ]


class StartFailed(ValueError):
    """The run of the start values failed; the message names the window."""


class NotIdentifiable(ValueError):
    """The parameters cannot be identified; `identifiability` says which."""

    def __init__(self, identifiability: Identifiability) -> None:
        super().__init__(identifiability.words)
        self.identifiability = identifiability


class Residuals:
    """Residuals of windows as functions of parameter values, and their Jacobian.

    Args:
        model: simulates.
        windows: with what was measured.
        parameters: the free ones.
        errors: compared signal -> expected difference.
        settling: time from the start of each window that is not compared [s].
        say: called with a line of progress after simulations.
        folder: keeps the simulated signals of sets of values, to resume a search; None: they are not kept.
        identity: of the model and the windows; part of the names of the kept files.
    """

    def __init__(
        self,
        model: Model,
        windows: Sequence[Window],
        parameters: Sequence[Parameter],
        errors: Mapping[str, float],
        *,
        settling: float,
        say: Callable[[str], None] = lambda text: None,
        folder: Path | None = None,
        identity: str = "",
    ) -> None:
        self.folder, self.identity = folder, identity
        self.say = say
        self.model, self.windows, self.parameters, self.errors = model, windows, parameters, errors
        self.compared = [window.times >= window.times[0] + settling - 1e-9 for window in windows]
        self.priors = [(i, *parameter.prior) for i, parameter in enumerate(parameters) if parameter.prior]
        pieces, first = [], 0
        for window, compared in zip(windows, self.compared, strict=True):
            times = window.times[compared]
            own = first + ((times - times[0]) / PIECE + 1e-9).astype(int)
            own = np.minimum(own, max(first, first + int((times[-1] - times[0]) / PIECE + 0.5) - 1))
            pieces += [own] * len(errors)
            first = int(own[-1]) + 1
        self.pieces = np.concatenate([*pieces, np.full(len(self.priors), -1)])
        self.runs = [i for i, parameter in enumerate(parameters) if parameter.kind == "run"]
        self.sets = 0
        self._known: dict[tuple[float, ...], list[Simulated]] = {}

    def simulated(self, points: Sequence[np.ndarray]) -> list[list[Simulated]]:
        """Return the signals in each window at some points; each point is simulated once."""
        keys = [tuple(point[self.runs].tolist()) for point in points]
        new = {key: point for key, point in zip(keys, points, strict=True) if key not in self._known}
        if new:
            names = [parameter.name for parameter in self.parameters]
            kept = {key: signals for key in new if (signals := self._kept(key))}
            left = [key for key in new if key not in kept]
            sets = [dict(zip(names, new[key].tolist(), strict=True)) for key in left]
            for key, signals in zip(left, self.model(sets) if sets else [], strict=True):
                kept[key] = signals
                self._keep(key, signals)
            self._known |= kept
            self.sets += len(new)
            self.say(f"{self.sets} sets of values")
        return [self._known[key] for key in keys]

    def _file(self, key: tuple[float, ...]) -> Path:
        digest = hashlib.sha256(f"{self.identity} {key}".encode()).hexdigest()
        return (self.folder or Path()) / f"{digest[:20]}.npz"

    def _kept(self, key: tuple[float, ...]) -> list[Simulated] | None:
        """Return the kept signals of a set of values; None if there are none, or they are unreadable."""
        if self.folder is None:
            return None
        try:
            with np.load(self._file(key)) as content:
                return [
                    {name: content[f"{k}.{name}"] for name in self.errors} for k in range(len(self.windows))
                ]
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
            return None

    def _keep(self, key: tuple[float, ...], signals: Sequence[Simulated]) -> None:
        if self.folder is None or any(window is None for window in signals):
            return
        content = {f"{k}.{name}": x for k, part in enumerate(signals) if part for name, x in part.items()}
        np.savez(stream := io.BytesIO(), allow_pickle=False, **content)
        self.folder.mkdir(parents=True, exist_ok=True)
        write_whole(self._file(key), stream.getvalue())

    def at(self, point: np.ndarray) -> np.ndarray:
        """Return the residuals at a point, shape (rows,)."""
        return self._rows(point, self.simulated([point])[0])

    def jacobian(self, point: np.ndarray) -> np.ndarray:
        """Return the derivatives of the residuals, shape (rows, parameters)."""
        points = [self._moved(point, i) for i in range(len(point))]
        central, *moved = self.simulated([point, *(points[i] for i in self.runs)])
        signals = dict(zip(self.runs, moved, strict=True))
        base = self._rows(point, central)
        columns = [
            (self._rows(points[i], signals.get(i, central)) - base) / (points[i][i] - point[i])
            for i in range(len(point))
        ]
        return np.stack(columns, axis=1)

    def _moved(self, point: np.ndarray, i: int) -> np.ndarray:
        """Return a point with a parameter moved a little, inwards at a bound."""
        parameter = self.parameters[i]
        step = DIFFERENCE * max(abs(point[i]), 0.01 * (parameter.high - parameter.low))
        moved: np.ndarray = point.copy()
        moved[i] += step if point[i] + step <= parameter.high else -step
        return moved

    def _rows(self, point: np.ndarray, simulated: Sequence[Simulated]) -> np.ndarray:
        rows = []
        corrections = {
            (parameter.kind, parameter.signal): value
            for parameter, value in zip(self.parameters, point, strict=True)
            if parameter.kind != "run"
        }
        for window, compared, signals in zip(self.windows, self.compared, simulated, strict=True):
            for name, error in self.errors.items():
                if signals is None:
                    rows.append(np.full(int(compared.sum()), INFEASIBLE))
                    continue
                delay = corrections.get(("delay", name), 0.0)
                values = as_measured(
                    window.times, signals[name], delay, corrections.get(("offset", name), 0.0)
                )
                rows.append((values - window.measured[name])[compared] / error)
        return np.concatenate([*rows, [(point[i] - mean) / spread for i, mean, spread in self.priors]])

    def loss(self, squares: np.ndarray) -> np.ndarray:
        """Return rho and its two derivatives of squared residuals, shape (3, rows), as scipy asks for it."""
        root = np.sqrt(1.0 + squares)
        soft = np.stack([2.0 * (root - 1.0), 1.0 / root, -0.5 / root**3])
        plain = np.stack([squares, np.ones_like(squares), np.zeros_like(squares)])
        return np.asarray(np.where(self.pieces < 0, plain, soft))


def as_measured(times: np.ndarray, values: np.ndarray, delay: float, offset: float) -> np.ndarray:
    """Return simulated values as a measurement with a delay [s] and an offset gives them."""
    if delay == 0.0:
        return values + offset
    from scipy.interpolate import CubicSpline

    shifted: np.ndarray = CubicSpline(times, values)(np.clip(times - delay, times[0], times[-1]))
    return shifted + offset


def estimate(residuals: Residuals, *, most_sets: int) -> Estimate:
    """Search the parameter values with the least loss.

    Args:
        residuals: of the training windows.
        most_sets: number of sets of values after which the search stops.

    Raises:
        StartFailed: the simulation of the start values failed.
        NotIdentifiable: the parameters cannot be identified, at the start or at the end.
    """
    from scipy.optimize import least_squares

    parameters = residuals.parameters
    names = [parameter.name for parameter in parameters]
    start, low, high = (np.array([getattr(p, key) for p in parameters]) for key in ("start", "low", "high"))
    for window, signals in zip(residuals.windows, residuals.simulated([start])[0], strict=True):
        if signals is None:
            raise StartFailed(window.name)
    require_identifiable(residuals.jacobian(start), names)
    best = start, np.inf
    loss_at_start, message = None, CONVERGED

    def values(point: np.ndarray) -> np.ndarray:
        nonlocal best, loss_at_start
        rows = residuals.at(point)
        loss = float(residuals.loss(rows**2)[0].sum())
        loss_at_start = loss if loss_at_start is None else loss_at_start
        best = min(best, (point.copy(), loss), key=lambda pair: pair[1])
        if residuals.sets >= most_sets:
            raise _Spent
        return rows

    try:
        point = start
        for loss_function, tolerance in (("linear", FIRST), (residuals.loss, TOLERANCE)):
            point = least_squares(
                values, point, residuals.jacobian, bounds=(low, high), method="trf", x_scale="jac",
                loss=loss_function, ftol=tolerance, xtol=tolerance, gtol=None,
            ).x  # fmt: skip
    except _Spent:
        message = f"{most_sets} sets of values were simulated"
    point, loss = best
    rows, jacobian = residuals.at(point), residuals.jacobian(point)
    inner = (point > low + 1e-6 * (high - low)) & (point < high - 1e-6 * (high - low))
    identified = require_identifiable(
        jacobian[:, inner], [n for n, keep in zip(names, inner, strict=True) if keep]
    )
    return Estimate(
        dict(zip(names, point.tolist(), strict=True)), identified,
        int(residuals.pieces.max()) + 1, covariance(rows, jacobian[:, inner], residuals.pieces),
        tuple(name for name, keep in zip(names, inner, strict=True) if not keep),
        residuals.sets, (loss_at_start or loss, loss), message, residuals.simulated([point])[0],
    )  # fmt: skip


def require_identifiable(jacobian: np.ndarray, names: Sequence[str]) -> Identifiability:
    """Return the identifiability of parameters; raise NotIdentifiable if they are refused."""
    identified = identifiability(jacobian, names)
    if identified.refused:
        raise NotIdentifiable(identified)
    return identified


class _Spent(Exception):
    """The allowed number of sets of values has been simulated."""
