"""Plausibility warnings for a run: the car spins, lifts wheels, leaves the range of its model.

`CHECKS` lists all checks; to add one, add an entry. Each looks at the recorded signals block by block during
the run. None is an error: a car without control does spin.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from operator import itemgetter

import numpy as np

from vocabulary.gravity import G
from vocabulary.wheels import WHEEL_NAMES, wheels

from ..errors import Diagnostic, Location
from ..plan import Plan
from ..results.freshness import recorded_variables
from .expressions import columns_of, results_to_be

SignalArrays = Sequence[np.ndarray]
"""The values of a check's signals over a block, in their order; shape (rows,) each."""


@dataclass(frozen=True)
class PlausibilityCheck:
    """A limit of signals beyond which a warning is given.

    `message` may contain `{limit}`, `{value}`, `{size}` (absolute value), `{time}`, `{column}` and `{wheel}`.
    """

    code: str
    signals: tuple[str, ...]  # in the vocabulary; with `*`, every wheel is checked separately
    value: Callable[[SignalArrays], np.ndarray]
    limit: float  # values above it give a warning; in the unit that `message` uses
    message: str
    why: str  # source of the limit
    below: bool = False  # warn of values below the limit instead
    over_friction: bool = False  # the value is divided by the highest friction of the road


def _degrees(x: SignalArrays) -> np.ndarray:
    return np.degrees(np.abs(x[0]))


CHECKS: tuple[PlausibilityCheck, ...] = (
    PlausibilityCheck(
        "car-spins", ("sideslip",), _degrees, 45.0,
        "the car spins: its sideslip angle passes {limit} degrees at {time} s and reaches {value} degrees",
        "chosen: more than front wheels can be steered against",
    ),
    PlausibilityCheck(
        "wheel-lifts", ("vertical_load_*",), itemgetter(0), 1.0,
        "the {wheel} wheel lifts off at {time} s",
        "chosen: a load of less than 1 N is none", below=True,
    ),
    PlausibilityCheck(
        "car-rolls-over", ("roll_angle",), _degrees, 15.0,
        "the car leans {value} degrees, beyond what models with linear springs are valid for "
        "({limit} degrees, at {time} s)",
        "chosen: bump stops, which the models leave out, are reached before it",
    ),
    PlausibilityCheck(
        "car-rolls-backwards", ("velocity_x",), itemgetter(0), -0.1,
        "the car rolls backwards from {time} s, at up to {size} m/s",
        "chosen: above the creep of a car that has stopped", below=True,
    ),
    PlausibilityCheck(
        "speed-implausible", ("velocity_x",), lambda x: np.abs(x[0]), 70.0,
        "the car is faster than {limit} m/s (252 km/h): {value} m/s at {time} s",
        "chosen: above the top speed of the cars that the papers speak of",
    ),
    PlausibilityCheck(
        "steer-angle-implausible", ("steer_angle",), _degrees, 60.0,
        "the front wheels are steered by {value} degrees, more than {limit} at {time} s",
        "chosen: above the steering lock of passenger cars, 35 to 50 degrees",
    ),
    PlausibilityCheck(
        "acceleration-implausible", ("acceleration_x", "acceleration_y"), lambda x: np.hypot(*x) / G, 1.5,
        "the car accelerates by {value} times what the road's friction gives, from {time} s beyond {limit}",
        "chosen: tyres of the catalogue reach 1.2 times the friction of the road", over_friction=True,
    ),
)  # fmt: skip
"""The checks made in every run."""


class PlausibilityWatch:
    """Applies the checks to the rows of a run as they are recorded."""

    def __init__(self, plan: Plan, checks: Iterable[PlausibilityCheck] = CHECKS) -> None:
        results = results_to_be(plan)
        reals = [column for column, variable in recorded_variables(plan).items() if variable.type == "Real"]
        index = {column: 1 + k for k, column in enumerate(reals)}
        friction = _highest_friction(plan)
        self._states: list[_CheckState] = []
        for check in (*checks, *_ranges(plan)):
            if check.over_friction and not friction:
                continue
            scale = 1 / friction if check.over_friction and friction else 1.0
            per_signal = [columns_of(results, signal) for signal in check.signals]
            for columns in zip(*per_signal, strict=False):
                if all(column in index for column in columns):
                    self._states.append(_CheckState(check, columns, [index[c] for c in columns], scale))

    @np.errstate(all="ignore")
    def look(self, rows: np.ndarray) -> None:
        """Check rows: shape (n, 1 + Real columns), time first."""
        for state in self._states:
            state.look(rows)

    def warnings(self) -> tuple[Diagnostic, ...]:
        """Return the warnings so far, in the order of the checks."""
        return tuple(filter(None, (state.warning() for state in self._states)))


class _CheckState:
    """The state of one check: the columns it looks at, and the largest value so far."""

    def __init__(
        self, check: PlausibilityCheck, columns: Sequence[str], indices: list[int], scale: float
    ) -> None:
        self.check = check
        self.columns = columns
        self._indices = indices
        self._scale = scale
        self._sign = -1.0 if check.below else 1.0
        self._time: float | None = None
        self._most = -math.inf

    def look(self, rows: np.ndarray) -> None:
        x = self._sign * self._scale * self.check.value([rows[:, k] for k in self._indices])
        largest = float(np.fmax.reduce(x, initial=-math.inf))
        if largest <= self._sign * self.check.limit:
            return
        if self._time is None:
            self._time = float(rows[np.argmax(x > self._sign * self.check.limit), 0])
        self._most = max(self._most, largest)

    def warning(self) -> Diagnostic | None:
        if self._time is None:
            return None
        value, column = self._sign * self._most, self.columns[0]
        message = self.check.message.format(
            limit=f"{self.check.limit:g}",
            value=f"{value:.3g}",
            size=f"{abs(value):.3g}",
            time=f"{self._time:.3g}",
            wheel=WHEEL_NAMES.get(column[-2:], ""),
            column=column,
        )
        where = Location(signal=column, time=self._time)
        return Diagnostic(self.check.code, message, "warning", where, value)


def _ranges(plan: Plan) -> Iterator[PlausibilityCheck]:
    """Yield a check for every recorded output whose range is limited by its FMU or by one that it feeds."""
    instances = {instance.name: instance.fmu.variables for instance in plan.instances}
    limits = {(instance, name): [instances[instance][name]] for instance, name in plan.record}
    for wire in plan.wires:
        if (wire.source, wire.output) in limits and not wire.converts:
            limits[wire.source, wire.output].append(instances[wire.target][wire.input])
    why = "the model description"
    for (instance, name), variables in limits.items():
        lowest = max((v.minimum for v in variables if v.minimum is not None), default=None)
        highest = min((v.maximum for v in variables if v.maximum is not None), default=None)
        for limit, below in ((lowest, True), (highest, False)):
            if limit is not None:
                message = "{column} is {value} at {time} s, beyond the {limit} that its model is valid for"
                # tolerate rounding
                rounding = 1e-9 * max(1.0, abs(limit)) * (-1 if below else 1)
                yield PlausibilityCheck(
                    "range-left",
                    (f"{instance}.{name}",),
                    itemgetter(0),
                    limit + rounding,
                    message,
                    why,
                    below,
                )


def _highest_friction(plan: Plan) -> float | None:
    """Return the highest constant friction of any instance; None if there is none, or if friction varies."""
    known = [
        float(value)
        for instance in plan.instances
        for name, value in instance.constants.items()
        if name in ("friction", *wheels("friction_*"))
    ]
    driven = [wire.input for wire in plan.wires] + [
        name for instance in plan.instances for name in instance.series
    ]
    varies = any(name.startswith("friction") for name in driven)
    return max(known, default=0.0) or None if not varies else None
