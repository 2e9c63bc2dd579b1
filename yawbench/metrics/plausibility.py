"""Plausibility warnings for a run: the car spins, lifts wheels, leaves the range of its model.

`CHECKS` lists all checks; to add one, add an entry. Each looks at the recorded signals, in SI, block by block
during the run. None is an error: a car without control does spin. A car spins only while it moves (`motion`),
and one that sets off backwards does not: its sideslip counts from there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np

from yawbench.foundation.errors import Diagnostic, Location
from yawbench.orchestrator.plan import Plan
from yawbench.orchestrator.results.record_of_plan import recorded_variables
from yawbench.vehicles.motion import standing
from yawbench.vocabulary.gravity import G
from yawbench.vocabulary.wheels import WHEEL_NAMES, wheels

from .expressions import angles_in, columns_of, motion_of, results_to_be
from .measures import si_of

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
    from_setting_off: bool = False  # of a sideslip: counted from straight back for a car that reverses
    over_friction: bool = False  # the value is divided by the highest friction of the road


def _degrees(x: SignalArrays) -> np.ndarray:
    return np.degrees(np.abs(x[0]))


BACKWARDS = math.radians(135.0)
"""Sideslip beyond which a car that sets off does so backwards [rad]; chosen: nearer to back than to aside."""

CHECKS: tuple[PlausibilityCheck, ...] = (
    PlausibilityCheck(
        "car-spins", ("sideslip",), _degrees, 45.0,
        "the car spins: its sideslip angle passes {limit} degrees at {time} s and reaches {value} degrees",
        "chosen: more than front wheels can be steered against", from_setting_off=True,
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
        angles = angles_in(results)

        def place(column: str) -> _Place:
            return _Place(index[column], si_of(results.units[column])[1])

        friction = _highest_friction(plan)
        self._states: list[_CheckState] = []
        for check in (*checks, *_ranges(plan)):
            if check.over_friction and not friction:
                continue
            scale = 1 / friction if check.over_friction and friction else 1.0
            per_signal = [columns_of(results, signal) for signal in check.signals]
            for columns in zip(*per_signal, strict=False):
                if not all(column in index for column in columns):
                    continue
                places = [place(column) for column in columns]
                if check.code == "range-left":  # its limit is in the signal's own unit
                    places = [replace(at, factor=1.0) for at in places]
                motion = motion_of(results, columns[0]).items() if columns[0] in angles else ()
                moving = {name: place(column) for name, column in motion if column in index}
                self._states.append(_CheckState(check, columns, places, scale, moving))

    @np.errstate(all="ignore")
    def look(self, rows: np.ndarray) -> None:
        """Check rows: shape (n, 1 + Real columns), time first."""
        for state in self._states:
            state.look(rows)

    def warnings(self) -> tuple[Diagnostic, ...]:
        """Return the warnings so far, in the order of the checks."""
        return tuple(filter(None, (state.warning() for state in self._states)))


@dataclass(frozen=True)
class _Place:
    """Where a signal stands in rows, and the factor that makes it SI."""

    index: int
    factor: float

    def of(self, rows: np.ndarray) -> np.ndarray:
        return rows[:, self.index] if self.factor == 1.0 else rows[:, self.index] * self.factor


class _CheckState:
    """The state of one check: the columns it looks at, and the largest value so far.

    `moving`: the places of the signals of the car's speed, for the angle of a velocity.
    """

    def __init__(
        self,
        check: PlausibilityCheck,
        columns: Sequence[str],
        places: Sequence[_Place],
        scale: float,
        moving: Mapping[str, _Place],
    ) -> None:
        self.check = check
        self.columns = columns
        self._places = places
        self._scale = scale
        self._moving = moving
        self._backwards: bool | None = None  # of the present stretch of motion; None: the car stands
        self._sign = -1.0 if check.below else 1.0
        self._time: float | None = None
        self._most = -math.inf

    def look(self, rows: np.ndarray) -> None:
        signals = [place.of(rows) for place in self._places]
        stands = standing({name: place.of(rows) for name, place in self._moving.items()})
        if self.check.from_setting_off:
            signals = [self._from_setting_off(signals[0], stands)]
        x = self._sign * self._scale * self.check.value(signals)
        if stands is not None:
            x[stands] = -math.inf
        largest = float(np.fmax.reduce(x, initial=-math.inf))
        if largest <= self._sign * self.check.limit:
            return
        if self._time is None:
            self._time = float(rows[np.argmax(x > self._sign * self.check.limit), 0])
        self._most = max(self._most, largest)

    def _from_setting_off(self, sideslip: np.ndarray, stands: np.ndarray | None) -> np.ndarray:
        """Return the sideslip [rad] from straight ahead, or from straight back where the car set off so."""
        moves = np.ones(sideslip.size, bool) if stands is None else ~stands
        begins = moves & ~np.append(self._backwards is not None, moves[:-1])
        begun = np.maximum.accumulate(np.where(begins, np.arange(sideslip.size), -1))
        backwards = np.where(begun < 0, bool(self._backwards), np.abs(sideslip[begun]) > BACKWARDS)
        if sideslip.size:
            self._backwards = bool(backwards[-1]) if moves[-1] else None
        return np.where(backwards, np.pi - np.abs(sideslip), sideslip)

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
