"""The kinds of events that are looked for in every run, with their limits and where these come from.

To add a kind, add an entry to `EVENTS`. Those of `WARNED` are warned of in every run: the car spins, lifts
wheels, leaves the range of its model. None of them is an error: a car without control does spin.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np

from yawbench.metrics.expressions import columns_of, results_to_be
from yawbench.orchestrator.plan import Plan
from yawbench.orchestrator.results.reader import Results
from yawbench.orchestrator.results.record_of_plan import faults_of
from yawbench.orchestrator.results.run_record import EventRecord
from yawbench.scene.outline import fed, places_of
from yawbench.vehicles.motion import SPIN
from yawbench.vocabulary.gravity import G
from yawbench.vocabulary.motion import LEAST_SPEED
from yawbench.vocabulary.wheels import WHEEL_NAMES, wheels

from .watch import EventKind, EventWatch, SignalArrays, Sought, events_of

Find = Callable[[Results], Iterator[Sought]]


# ---- what is computed from signals ----


def _degrees(x: SignalArrays) -> np.ndarray:
    return np.degrees(np.abs(x[0]))


def _size(x: SignalArrays) -> np.ndarray:
    return np.abs(x[0])


def _of(*signals: str, value: Callable[[SignalArrays], np.ndarray]) -> Find:
    """Return the search for signals of the car, or of each wheel where they have a `*`."""

    def find(results: Results) -> Iterator[Sought]:
        for columns in zip(*(columns_of(results, signal) for signal in signals), strict=False):
            yield Sought(columns, value, None, _wheel(columns[0]))

    return find


def _wheel(column: str) -> str:
    """Return the wheel in a column's name in words, "" if there is none."""
    name = WHEEL_NAMES.get(column[-2:] if column[-3:-2] == "_" else "")
    return f"{name} wheel" if name else ""


def parameters(results: Results, instance: str) -> Mapping[str, Any]:
    """Return the values that the parameters of an instance had, with those of its constant inputs."""
    fmu = results.record.fmus.get(instance)
    return {**fmu.defaults, **fmu.parameters, **fmu.constants} if fmu else {}


def number(results: Results, instance: str, *names: str) -> float | None:
    """Return the first parameter of these names that an instance has as a number."""
    values = parameters(results, instance)
    found = (values.get(name) for name in names)
    return next((float(v) for v in found if isinstance(v, (int, float)) and not isinstance(v, bool)), None)


def friction_at(results: Results) -> tuple[list[str], list[float]] | None:
    """Return the columns of the friction under the wheels, or the constants that the tyre has; else None."""
    if columns := columns_of(results, "friction_*"):
        return columns, []
    for tyre in results.instances_of_role("tyre"):
        known = [number(results, tyre, name, "friction") for name in wheels("friction_*")]
        if None not in known:
            return [], [float(value) for value in known if value is not None]
    return None


def with_friction(
    results: Results,
    columns: tuple[str, ...],
    value: Callable[[SignalArrays, np.ndarray | float], np.ndarray],
) -> Iterator[Sought]:
    """Yield the search for a value of signals and of the lowest friction under a wheel."""
    friction = friction_at(results)
    if friction is None or not columns:
        return
    own, constants = friction
    if own:
        count = len(columns)
        yield Sought((*columns, *own), lambda x: value(x[:count], np.minimum.reduce(x[count:])), None)
    elif min(constants) > 0:
        yield Sought(columns, lambda x: value(x, min(constants)), None)


def _axles(results: Results) -> Iterator[Sought]:
    """Yield the share of friction times load that the tyres of each axle use."""
    friction = friction_at(results)
    signals = ("tyre_force_x_*", "tyre_force_y_*", "vertical_load_*")
    forces = [columns_of(results, signal) for signal in signals]
    if friction is None or not all(forces):
        return
    for axle, pair in (("front axle", (0, 1)), ("rear axle", (2, 3))):
        columns = [column[k] for k in pair for column in forces]
        own, constants = friction

        def share(
            x: SignalArrays, mu: tuple[float, ...] = tuple(constants[k] for k in pair if constants)
        ) -> Any:
            of = mu or (x[6], x[7])
            used = np.hypot(x[0], x[1]) + np.hypot(x[3], x[4])
            return 100.0 * used / np.maximum(of[0] * np.maximum(x[2], 0) + of[1] * np.maximum(x[5], 0), 1.0)

        yield Sought((*columns, *(own[k] for k in pair if own)), share, None, axle)


def _steering(results: Results) -> Iterator[Sought]:
    """Yield the hand wheel, or where it is not recorded the steer angle at an assumed ratio."""
    if columns := columns_of(results, "steering_wheel_angle"):
        yield Sought((columns[0],), _degrees, None)
    elif columns := columns_of(results, "steer_angle"):
        yield Sought((columns[0],), lambda x: RATIO * _degrees(x), None)


RATIO = 16.0
"""Steering ratio where the hand wheel is not recorded; chosen: that of a saloon."""


def sources_of_moment(results: Results) -> list[str]:
    """Return the columns of the yaw moments that controllers ask for, whatever these call them."""
    return results.candidates("yaw_moment", role="controller") or results.feeding("yaw_moment")


LEAST_MOMENT = 0.05
"""Share of its limit from which a yaw moment counts as an intervention; chosen: a driver notices less than no
brake does."""
USUAL_LIMIT = 5000.0
"""Limit of a yaw moment where none is known [N.m]; chosen: that of the papers' studies."""


def least_moment(results: Results, column: str) -> float:
    """Return the yaw moment [N.m] from which on a controller intervenes."""
    most = number(results, results.names[column].instance, "moment_limit") or USUAL_LIMIT
    return LEAST_MOMENT * most


def _intervention(results: Results) -> Iterator[Sought]:
    for column in sources_of_moment(results):
        yield Sought((column,), _size, least_moment(results, column))


def _moment_limit(results: Results) -> Iterator[Sought]:
    """Yield yaw moments at their limit; where it is not known, those that stay the same to the last bit."""
    for column in sources_of_moment(results):
        most = number(results, results.names[column].instance, "moment_limit")
        if most:
            yield Sought((column,), _size, most * (1.0 - 1e-6))
        else:
            yield Sought((column,), _Constant(), least_moment(results, column))


class _Constant:
    """The size of a signal while it stays the same, else 0."""

    def __init__(self) -> None:
        self._last = math.nan

    def __call__(self, x: SignalArrays) -> np.ndarray:
        before = np.concatenate([[self._last], x[0][:-1]])
        self._last = float(x[0][-1])
        return np.where(x[0] == before, np.abs(x[0]), 0.0)


def _torque_limit(results: Results) -> Iterator[Sought]:
    """Yield pressures, else torques, whose limit is known."""
    limits = (
        ("brake_pressure_*", ("pressure_limit",)),
        ("wheel_torque_*", ("motor_torque_limit", "torque_limit")),
        ("torque_request_*", ("torque_limit",)),
    )
    for signal, names in limits:
        for column in columns_of(results, signal):
            most = number(results, results.names[column].instance, *names)
            if most:
                yield Sought((column,), _size, most * (1.0 - 1e-6), _wheel(column))


def _slips(results: Results) -> Iterator[Sought]:
    """Yield the slip of each wheel, with that from which its control releases it where it is known."""
    known = [number(results, name, "release_slip") for name in results.instances_of_role("wheel_control")]
    limit = next(filter(None, known), None)
    for column in columns_of(results, "slip_ratio_*"):
        yield Sought((column,), lambda x: 100.0 * np.abs(x[0]), limit and 100.0 * limit, _wheel(column))


def _against(results: Results) -> Iterator[Sought]:
    """Yield the yaw moment times the sign in which it turns the car further from what is asked for.

    Only while it agrees neither with the error of the yaw rate nor with the sideslip, which a moment in its
    direction makes smaller: a law may serve one of them at the cost of the other.
    """
    slip, rate = columns_of(results, "sideslip"), columns_of(results, "yaw_rate")
    for column in sources_of_moment(results):
        wanted = fed(results, results.names[column].instance, "yaw_rate_ref")
        wanted = wanted or next(iter(columns_of(results, "yaw_rate_ref")), None)
        if wanted is None or not slip or not rate:
            continue

        def wrong(x: SignalArrays) -> np.ndarray:
            moment, asked, turns, beta = x
            error = asked - turns
            further = (moment * error < 0) & (moment * beta < 0)
            clear = (np.abs(error) > CLEAR_ERROR) & (np.abs(beta) > CLEAR_SIDESLIP)
            return np.where(further & clear, np.abs(moment), 0.0)

        yield Sought((column, wanted, rate[0], slip[0]), wrong, least_moment(results, column))


CLEAR_ERROR, CLEAR_SIDESLIP = 0.03, math.radians(2.0)
"""Error of the yaw rate [rad/s] and sideslip [rad] beyond which the right sign of a moment is clear;
chosen: a few times the noise of production sensors."""


def _unmet(results: Results) -> Iterator[Sought]:
    """Yield the share of the forces asked for that the torques at the wheels lack, or exceed."""
    requests = columns_of(results, "force_request_*")
    plant = next(iter(results.instances_of_role("plant")), "")
    torques = [fed(results, plant, name) for name in wheels("wheel_torque_*")]
    radius = number(results, plant, "wheel_radius")
    if not requests or None in torques or not radius:
        return

    def lacking(x: SignalArrays) -> np.ndarray:
        forces, given = x[:4], [torque / radius for torque in x[4:]]
        lacks = sum(np.abs(force - own) for force, own in zip(forces, given, strict=True))
        most = np.maximum(sum(map(np.abs, forces)), sum(map(np.abs, given)))
        return np.asarray(100.0 * lacks / np.maximum(most, LEAST_FORCE))

    yield Sought((*requests, *(name for name in torques if name)), lacking, None)


LEAST_FORCE = 1000.0
"""Sum of wheel forces [N] below which what is lacking counts as a share of this; chosen: 0.07 g of a car."""


def _sensors(results: Results) -> Iterator[Sought]:
    """Yield the distance of each measured signal from the car's, in units of what is tolerated."""
    for instance in results.instances_of_role("sensor"):
        for name, tolerated in TOLERATED.items():
            for one in wheels(name):
                measured, true = f"{instance}.{one}", columns_of(results, one)
                if measured in results.columns and true and true[0] != measured:
                    yield Sought(
                        (measured, true[0]), lambda x: np.abs(x[0] - x[1]), tolerated, one.replace("_", " ")
                    )


TOLERATED = {"yaw_rate": 0.15, "acceleration_y": 2.5, "steer_angle": 0.03, "wheel_speed_*": 6.0}
"""Distance of a measured signal from the car's that no working sensor of production has, latency
included, in the signal's unit. Chosen: three times offset and noise of `sensor_production`, and 50 ms of a
fast manoeuvre."""


class _Falls:
    """Friction as a share of that at the start of the run."""

    def __init__(self) -> None:
        self._first: np.ndarray | None = None

    def __call__(self, x: SignalArrays) -> np.ndarray:
        now = np.minimum.reduce(x)
        if self._first is None:
            self._first = now[:1].copy()
        return np.asarray(100.0 * now / np.maximum(self._first, 1e-9))


def _friction_falls(results: Results) -> Iterator[Sought]:
    if columns := columns_of(results, "friction_*"):
        yield Sought(tuple(columns), _Falls(), None)


def _misjudged(results: Results) -> Iterator[Sought]:
    """Yield by how much the friction told to a reference or controller exceeds that of the road."""
    beside = tuple(columns_of(results, "velocity_x")[:1])
    for role in ("reference", "controller"):
        for instance in results.instances_of_role(role):
            column, told = fed(results, instance, "friction"), number(results, instance, "friction")
            if column is not None:
                found = [*with_friction(results, (column,), lambda x, mu: 100 * (x[0] / mu - 1))]
            elif told is not None and beside:
                found = [*with_friction(results, beside, partial(_told, told))]
            else:
                continue
            yield from found
            if found:
                return


def _told(told: float, x: SignalArrays, mu: np.ndarray | float) -> np.ndarray:
    return np.asarray(np.full(x[0].shape, 100.0) * (told / mu - 1.0))


def _beyond_grip(signal: str) -> Find:
    """Return the search for a yaw rate times speed, as a share of what friction allows."""

    def find(results: Results) -> Iterator[Sought]:
        rate, speed = columns_of(results, signal), columns_of(results, "velocity_x")
        if not rate and signal == "yaw_rate_ref":
            rate = [
                column
                for name in results.instances_of_role("controller")
                if (column := fed(results, name, signal))
            ]
        if rate and speed:
            yield from with_friction(
                results, (rate[0], speed[0]), lambda x, mu: 100 * np.abs(x[0] * x[1]) / (mu * G)
            )

    return find


def _monitors(results: Results) -> Iterator[Sought]:
    for instance in results.instances_of_role("monitor"):
        if f"{instance}.fault" in results.columns:
            yield Sought((f"{instance}.fault",), itemgetter(0), None)


def _cones(results: Results) -> Iterator[Sought]:
    for column, name in results.names.items():
        if name.variable == "cone_overrun":
            yield Sought((column,), itemgetter(0), None)


def _acceleration(results: Results) -> Iterator[Sought]:
    """Yield the acceleration as a multiple of what the highest friction gives, if that is constant."""
    friction = _highest_friction(results)
    for columns in zip(
        columns_of(results, "acceleration_x"), columns_of(results, "acceleration_y"), strict=False
    ):
        if friction:
            yield Sought(columns, lambda x: np.hypot(*x) / G / friction, None)


def _highest_friction(results: Results) -> float | None:
    """Return the highest constant friction of any instance; None if there is none, or if friction varies."""
    fmus = results.record.fmus.values()
    driven = [wire.target.variable for wire in results.record.connections]
    driven += [name for fmu in fmus for name in fmu.series]
    if any(name.startswith("friction") for name in driven):
        return None
    known = [fmu.constants.get(name) for fmu in fmus for name in ("friction", *wheels("friction_*"))]
    return max((float(value) for value in known if isinstance(value, (int, float))), default=0.0) or None


# ---- the kinds ----

WARNED: tuple[EventKind, ...] = (
    EventKind(
        "car-spins", "the car spins", _of("sideslip", value=_degrees), math.degrees(SPIN), "deg",
        "chosen: see SPIN", from_setting_off=True,
        warning="the car spins: its sideslip angle passes {limit} degrees at {time} s and reaches "
        "{value} degrees",
    ),
    EventKind(
        "wheel-lifts", "lifts", _of("vertical_load_*", value=itemgetter(0)), 1.0, "N",
        "chosen: a load of less than 1 N is none", below=True, warning="the {where} lifts off at {time} s",
    ),
    EventKind(
        "car-rolls-over", "the car leans", _of("roll_angle", value=_degrees), 15.0, "deg",
        "chosen: bump stops, which the models leave out, are reached before it",
        warning="the car leans {value} degrees, beyond what models with linear springs are valid for "
        "({limit} degrees, at {time} s)",
    ),
    EventKind(
        "car-rolls-backwards", "the car rolls backwards", _of("velocity_x", value=itemgetter(0)), -0.1, "m/s",
        "chosen: above the creep of a car that has stopped", below=True,
        warning="the car rolls backwards from {time} s, at up to {size} m/s",
    ),
    EventKind(
        "speed-implausible", "the car is faster than cars are", _of("velocity_x", value=_size), 70.0, "m/s",
        "chosen: above the top speed of the cars that the papers speak of",
        warning="the car is faster than {limit} m/s (252 km/h): {value} m/s at {time} s",
    ),
    EventKind(
        "steer-angle-implausible", "the front wheels are steered further than cars can",
        _of("steer_angle", value=_degrees), 60.0, "deg",
        "chosen: above the steering lock of passenger cars, 35 to 50 degrees",
        warning="the front wheels are steered by {value} degrees, more than {limit} at {time} s",
    ),
    EventKind(
        "acceleration-implausible", "the car accelerates by more than friction gives", _acceleration, 1.5,
        "1",
        "chosen: tyres of the catalogue reach 1.2 times the friction of the road",
        warning="the car accelerates by {value} times what the road's friction gives, from {time} s "
        "beyond {limit}",
    ),
)  # fmt: skip
"""Events that every run warns of."""

EVENTS: tuple[EventKind, ...] = (
    EventKind(
        "steering", "the hand wheel is turned", _steering, 5.0, "deg",
        "GTR 8: the steering begins at 5 degrees of the hand wheel; steer angles at a ratio of 16, chosen",
        merge=0.5,
    ),
    EventKind("cone-hit", "a cone is hit", _cones, 0.0, "m", "ISO 3888: no cone may be touched"),
    EventKind(
        "axle-at-grip", "at its grip", _axles, 85.0, "%",
        "chosen: tyres of the catalogue reach 91 to 120 % of friction times load, and slide at 80 to 100 %",
        lasting=0.03, merge=0.2,
    ),
    EventKind(
        "intervention", "the controller acts", _intervention, LEAST_MOMENT * USUAL_LIMIT, "N.m",
        "chosen: see LEAST_MOMENT", merge=0.1,
    ),
    EventKind(
        "moment-at-limit", "the yaw moment is at its limit", _moment_limit, math.inf, "N.m",
        "the controller's moment_limit; without one, chosen: a moment that stays the same for 50 ms",
        lasting=0.05, merge=0.1,
    ),
    EventKind(
        "torque-at-limit", "at the limit of its brake or motor", _torque_limit, math.inf, "SI",
        "the limit of the wheel control or actuator",
    ),
    EventKind(
        "wheel-slips", "slips", _slips, 15.0, "%",
        "the wheel control's release_slip, else chosen: about the slip of the largest force on a dry road",
        lasting=0.02, merge=0.1,
    ),
    EventKind(
        "sideslip-past", "sideslip past its bound", _of("sideslip", value=_degrees), 20.0, "deg",
        "the ranking's bound: see docs/ranking.md", merge=0.2,
    ),
    EventKind(
        "yaw-rate-past", "the car turns faster than grip can hold", _beyond_grip("yaw_rate"), 120.0, "%",
        "chosen: a fifth more than friction holds in a steady turn", lasting=0.1, merge=0.2,
    ),
    EventKind(
        "reference-past", "more yaw rate is asked for than grip can hold", _beyond_grip("yaw_rate_ref"),
        105.0, "%", "chosen: above the rounding of references at the friction", lasting=0.1, merge=0.2,
    ),
    EventKind(
        "moment-against", "the yaw moment turns the car further away", _against,
        LEAST_MOMENT * USUAL_LIMIT, "N.m", "chosen: as for an intervention", lasting=0.1, merge=0.1,
    ),
    EventKind(
        "request-unmet", "the wheels do not give the forces asked for", _unmet, 50.0, "%",
        "chosen: half of what is asked for", lasting=0.1, merge=0.05,
    ),
    EventKind(
        "sensor-off", "is measured wrong", _sensors, math.inf, "SI", "chosen: see TOLERATED", lasting=0.2,
        merge=0.2,
    ),
    EventKind(
        "friction-falls", "the friction under a wheel falls", _friction_falls, 80.0, "%",
        "chosen: a fifth less than at the start", below=True, merge=0.1,
    ),
    EventKind(
        "friction-misjudged", "the control is told more friction than there is", _misjudged, 25.0, "%",
        "chosen: more than estimators are wrong by on a known road", lasting=0.1, merge=0.2,
    ),
    EventKind(
        "wind", "side wind", _of("wind_force_y", value=_size), 300.0, "N",
        "chosen: 0.02 g of a car",
    ),
    EventKind(
        "fault-detected", "a fault is detected", _monitors, 0.5, "1", "the monitor's output",
    ),
    EventKind(
        "standstill", "the car stands", _of("velocity_x", value=_size), LEAST_SPEED, "m/s",
        "vocabulary.motion: angles of a velocity mean nothing below", below=True, merge=0.5,
    ),
)  # fmt: skip
"""Further events, which are no warnings."""

KINDS = {kind.name: kind for kind in (*WARNED, *EVENTS)}


class WarningWatch(EventWatch):
    """Looks for the events alone that runs of a plan are warned of: what runs of a sweep can afford."""

    def __init__(self, plan: Plan) -> None:
        super().__init__(_to_be(plan), (*WARNED, *_ranges(plan)))

    def events(self) -> None:
        """Return nothing: most events were not looked for."""

    def geometry(self) -> dict[str, Any]:
        """Return nothing: results in memory have no record to read."""
        return {}


class RunWatch(EventWatch):
    """Looks for all events of a run of a plan, and has its faults."""

    def __init__(self, plan: Plan) -> None:
        self._results = _to_be(plan, defaults=True)
        super().__init__(self._results, (*WARNED, *_ranges(plan), *EVENTS))
        self._path = [self._index(name) for name in ("position_x", "position_y")]
        self._bounds = [(math.inf, -math.inf)] * len(self._path)

    def _index(self, signal: str) -> int | None:
        """Return the place of a signal in the rows, None if it is not recorded."""
        columns = columns_of(self._results, signal)
        return 1 + self.reals.index(columns[0]) if columns and columns[0] in self.reals else None

    def look(self, rows: np.ndarray) -> None:
        super().look(rows)
        for k, index in enumerate(self._path):
            if index is not None and rows.size:
                low, high = self._bounds[k]
                ends = np.fmin.reduce(rows[:, index]), np.fmax.reduce(rows[:, index])
                self._bounds[k] = float(np.fmin(low, ends[0])), float(np.fmax(high, ends[1]))

    def geometry(self) -> dict[str, Any]:
        if not np.isfinite(self._bounds).all():
            return {}
        return places_of(self._results, *self._bounds).record()

    def events(self) -> list[EventRecord]:
        return _with_faults(self.found(), self._results)


def events_in(results: Results) -> list[EventRecord]:
    """Return the events of a run: those of its record, else found in what was recorded."""
    if "events" in results.record.model_fields_set:
        return results.record.events
    known: dict[str, Any] = vars(results)  # kept there, as a cached property is: several tables ask
    if "_events" not in known:
        known["_events"] = _with_faults(events_of(results, (*WARNED, *EVENTS)), results)
    found: list[EventRecord] = known["_events"]
    return found


def _with_faults(events: list[EventRecord], results: Results) -> list[EventRecord]:
    """Return events with the faults that the scenario states, in the order of their begin."""
    begin = results.record.start_time
    faults = [
        EventRecord(
            time=begin if fault.begin is None else fault.begin,
            until=fault.until,
            kind="fault",
            where=fault.words,
            signal=next(iter(fault.at), fault.on),
        )
        for fault in results.record.faults
    ]
    return sorted([*events, *faults], key=lambda event: event.time)


def _to_be(plan: Plan, *, defaults: bool = False) -> Results:
    """Return results without rows, with the values that parameters and constant inputs of a plan have."""
    results = results_to_be(plan)
    for instance in plan.instances:
        fmu = results.record.fmus[instance.name]
        fmu.constants = dict(instance.constants)
        fmu.series = dict.fromkeys(instance.series)  # type: ignore[assignment]  # their names alone
        if defaults:
            fmu.parameters = dict(instance.parameters)
            fmu.defaults = {v.name: v.start for v in instance.fmu.of("parameter")}
    results.record.faults = faults_of(plan)
    results.record.start_time = plan.time(0)
    return results


def _ranges(plan: Plan) -> Iterator[EventKind]:
    """Yield a kind for every recorded output whose range is limited by its FMU or by one that it feeds."""
    instances = {instance.name: instance.fmu.variables for instance in plan.instances}
    limits = {(instance, name): [instances[instance][name]] for instance, name in plan.record}
    for wire in plan.wires:
        if (wire.source, wire.output) in limits and not wire.converts:
            limits[wire.source, wire.output].append(instances[wire.target][wire.input])
    for (instance, name), variables in limits.items():
        lowest = max((v.minimum for v in variables if v.minimum is not None), default=None)
        highest = min((v.maximum for v in variables if v.maximum is not None), default=None)
        for limit, below in ((lowest, True), (highest, False)):
            if limit is not None:
                rounding = 1e-9 * max(1.0, abs(limit)) * (-1 if below else 1)  # tolerated
                column = f"{instance}.{name}"
                yield EventKind(
                    "range-left",
                    "beyond what its model is valid for",
                    partial(_column, column),
                    limit + rounding,
                    variables[0].unit or "",
                    "the model description",
                    below,
                    si=False,
                    warning="{column} is {value} at {time} s, beyond the {limit} that its model is valid for",
                )


def _column(column: str, _: Results) -> Iterator[Sought]:
    yield Sought((column,), itemgetter(0), None, column)
