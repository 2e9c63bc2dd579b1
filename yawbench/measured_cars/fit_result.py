"""Fits: the search, the single track beside it, scores on training and held-out windows.

A model is better if the mean square of its differences, each over its expected difference, is smaller;
held-out windows decide. fit % is 100 (1 - |e| / |y - mean|) with Euclidean norms, of all compared samples of
a signal; the mean is that of the window.

Source of fit %: L. Ljung, System Identification Toolbox, `compare` (normalized root mean square).
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from yawbench.foundation.errors import ScenarioError, code_of
from yawbench.foundation.messages import hint
from yawbench.foundation.workers import Pool
from yawbench.orchestrator.scenario import yaml_lines
from yawbench.orchestrator.signal_names import Target
from yawbench.planner import Planner
from yawbench.studies.jobs import NEEDED
from yawbench.vocabulary.facts import FACTS
from yawbench.vocabulary.signals import SIGNALS
from yawbench.vocabulary.vehicle import CAR

from .fit_file import MEASURED, FitWindow, FreeSpec, LoadedFit, number_in
from .least_squares import (
    CONFIDENCE,
    Estimate,
    NotIdentifiable,
    Parameter,
    Residuals,
    Simulated,
    StartFailed,
    as_measured,
    estimate,
)
from .scenario_model import MARGIN, ScenarioModel, delay_and_offset
from .single_track import SIGNALS as OF_SINGLE_TRACK
from .single_track import UNITS, SingleTrack, SingleTrackWindow, start_states, typical_values

PARTS = {"training": "training", "held_out": "held-out"}


@dataclass(frozen=True)
class Score:
    """Differences of a signal between a model and the measurement."""

    rms: float
    largest: float
    fit: float  # [%]


@dataclass(frozen=True)
class FittedModel:
    """A model with its estimate and its simulated signals in the windows of each part."""

    title: str
    parameters: Sequence[Parameter]
    estimate: Estimate
    simulated: Mapping[str, Sequence[Simulated]]  # part -> a window's signals, as the measurement shows them


@dataclass(frozen=True)
class FitResult:
    """A fit: the scenario's model, and the single track beside it or why there is none."""

    fit: LoadedFit
    scenario: FittedModel
    single_track: FittedModel | None
    without: str  # why there is no single track

    @property
    def models(self) -> list[FittedModel]:
        """The models."""
        return [self.scenario, *([self.single_track] if self.single_track else [])]

    @cached_property
    def scores(self) -> dict[tuple[str, str, str], Score]:
        """(Title of the model, part, signal) -> score."""
        scores = {}
        for model in self.models:
            for part in PARTS:
                for name in self.fit.errors:
                    pairs = self._pairs(model, part, name)
                    if pairs:
                        scores[model.title, part, name] = score_of(pairs)
        return scores

    def _pairs(self, model: FittedModel, part: str, name: str) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return measured and simulated values of the compared samples of each window."""
        pairs = []
        for fit_window, signals in zip(self.fit.parts[part], model.simulated[part], strict=True):
            if signals is None or name not in signals:
                return []
            compared = fit_window.window.times >= fit_window.window.times[0] + self.fit.settling - 1e-9
            pairs.append((fit_window.window.measured[name][compared], signals[name][compared]))
        return pairs

    def loss(self, model: FittedModel, part: str) -> float:
        """Return the mean square of differences over expected ones; infinite if a run failed."""
        own = [(self.scores.get((model.title, part, name)), error) for name, error in self.fit.errors.items()]
        return float(
            np.mean([math.inf if score is None else (score.rms / error) ** 2 for score, error in own])
        )

    @property
    def verdict(self) -> str:
        """Whether the scenario's model is better than the single track, in words."""
        part = self.fit.deciding
        if self.single_track is None:
            return f"no single track beside it: {self.without}"
        own, other = self.loss(self.scenario, part), self.loss(self.single_track, part)
        of = "mean square of differences, each over the expected"
        seen = f"on {PARTS[part]} windows: {of}, {own:.3g} against {other:.3g}"
        return f"{'' if own < other else 'not '}better than a single track with Fiala tyres {seen}"

    @property
    def data(self) -> dict[str, Any]:
        """All numbers, as JSON-ready data."""
        of = self.fit.measurement
        return {
            "title": self.fit.spec.title,
            "measurement": {
                "car": of.car, "source": of.source, "licence": of.licence, "date": of.date,
                "sha256": of.sha256,
            },
            "verdict": self.verdict,
            "models": {model.title: self._of_model(model) for model in self.models},
        }  # fmt: skip

    def _of_model(self, model: FittedModel) -> dict[str, Any]:
        fitted, intervals = model.estimate, model.estimate.intervals()
        return {
            "parameters": {
                parameter.name: {
                    "value": fitted.values[parameter.name], "interval": intervals[parameter.name],
                    "start": parameter.start, "low": parameter.low, "high": parameter.high,
                    "prior": parameter.prior, "unit": parameter.unit,
                    "at_bound": parameter.name in fitted.at_bound,
                }
                for parameter in model.parameters
            },
            "confidence": CONFIDENCE,
            "pieces": fitted.pieces,
            "condition": fitted.identifiability.condition,
            "weakest": fitted.identifiability.weakest,
            "correlations": fitted.correlated(),
            "sets": fitted.sets,
            "loss": fitted.loss,
            "ended": fitted.message,
            "scores": {
                part: {
                    name: vars(self.scores[model.title, part, name])
                    for name in self.fit.errors
                    if (model.title, part, name) in self.scores
                }
                for part in PARTS
            },
            "windows": {
                part: {
                    name: [score_of([pair]).rms for pair in self._pairs(model, part, name)]
                    for name in self.fit.errors
                }
                for part in PARTS
            },
        }  # fmt: skip


def score_of(pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> Score:
    """Return the score of (measured, simulated) values of windows."""
    differences = np.concatenate([simulated - measured for measured, simulated in pairs])
    spread = np.concatenate([measured - measured.mean() for measured, _ in pairs])
    length = float(np.linalg.norm(spread))
    fit = 100.0 * (1.0 - float(np.linalg.norm(differences)) / length) if length else -math.inf
    return Score(float(np.sqrt(np.mean(differences**2))), float(np.abs(differences).max()), fit)


def make_fit(
    fit: LoadedFit,
    *,
    planner: Planner,
    workers: int | None = None,
    fmus: Path | None = None,
    folder: Path | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> FitResult:
    """Fit the scenario and the single track, and simulate all windows with both.

    Args:
        fit: as loaded.
        planner: makes the plans.
        workers: number of processes; None: one per core.
        fmus: folder of the FMUs.
        folder: keeps what sets of values gave until the fit has ended, so that it goes on if interrupted.
        say: called with a line of progress after every set of runs.

    Raises:
        ScenarioError: the fit cannot be made: a run of the start values fails, or the parameters cannot be
            identified.
        Interrupted: Ctrl-C; sets of values that are finished are kept in the folder.
    """
    with Pool(workers, preload=NEEDED) as pool:
        training, held = (
            ScenarioModel(fit, windows, planner=planner, pool=pool, fmus=fmus)
            for windows in fit.parts.values()
        )
        parameters = free_parameters(fit, training)
        own = _fitted(fit, training, parameters, say, folder)
        values = own.estimate.values
        simulated = {"training": own.estimate.simulated, "held_out": held([values])[0]}
    scenario = replace(own, simulated=_shown(fit, values, simulated))
    if folder:
        shutil.rmtree(folder, ignore_errors=True)
    try:
        single = _single_track(fit, training, parameters, say)
    except ValueError as error:
        return FitResult(fit, scenario, None, str(error))
    return FitResult(fit, scenario, single, "")


def _fitted(
    fit: LoadedFit,
    model: ScenarioModel,
    parameters: Sequence[Parameter],
    say: Callable[[str], None],
    known: Path | None,
) -> FittedModel:
    windows = [fit_window.window for fit_window in fit.training]
    residuals = Residuals(
        model, windows, parameters, fit.errors,
        settling=fit.settling, say=say, folder=known, identity=model.identity,
    )  # fmt: skip
    try:
        fitted = estimate(residuals, most_sets=fit.spec.most_sets)
    except NotIdentifiable as error:
        condition = error.identifiability.condition
        raise ScenarioError(
            f"{fit.path}: {error}: condition {condition:.2g}; fix one of them, give it a prior, or compare "
            "more signals or other manoeuvres",
            code="fit-not-identifiable",
        ) from None
    except StartFailed as error:
        raise ScenarioError(
            f"{fit.path}: the run of the start values in {error} fails: {model.failure or 'it ended early'}",
            code="fit-start",
        ) from None
    return FittedModel(model.base.title or "scenario", parameters, fitted, {})


def _shown(
    fit: LoadedFit, values: Mapping[str, float], simulated: Mapping[str, Sequence[Simulated]]
) -> dict[str, Sequence[Simulated]]:
    """Return simulated signals with the delays and offsets of the measurement."""

    def as_seen(fit_window: FitWindow, signals: Simulated) -> Simulated:
        times = fit_window.window.times
        return signals and {
            name: as_measured(times, x, *delay_and_offset(values, name)) for name, x in signals.items()
        }

    return {
        part: [as_seen(window, signals) for window, signals in zip(fit.parts[part], several, strict=True)]
        for part, several in simulated.items()
    }


def _single_track(
    fit: LoadedFit, model: ScenarioModel, parameters: Sequence[Parameter], say: Callable[[str], None]
) -> FittedModel:
    """Fit the single track to the same windows.

    Raises:
        ValueError: it cannot be made from what is measured, or not be fitted.
    """
    errors = {name: error for name, error in fit.errors.items() if name in OF_SINGLE_TRACK}
    if not errors:
        raise ValueError("none of its signals is compared")
    assert model.plant is not None
    known = dict(fit.measurement.vehicle)
    wanted = ("mass", "cg_to_front_axle", "cg_to_rear_axle")
    car = [known.get(name, model.plant.parameter(name)) for name in wanted]
    if not all(isinstance(value, (int, float)) for value in car):
        raise ValueError("the plant has no mass, or no distances of its axles")
    mass, front, rear = map(float, car)  # type: ignore[arg-type]
    own = [
        Parameter(name, start, 0.2 * start, 5.0 * start, unit=UNITS[name])
        for name, start in typical_values(mass, front, rear).items()
    ]
    steering = {"steer_angle", "steering_wheel_angle"}
    for parameter in parameters:
        _, _, rest = parameter.name.partition(".")
        signal, _, of = rest.rpartition(".")
        if parameter.name.startswith(f"{MEASURED}."):
            if signal in steering:
                ratio = _ratio(fit, model) if signal != "steer_angle" and of == "offset" else 1.0
                own.append(
                    replace(parameter, name=f"steer_angle.{of}", start=parameter.start / ratio,
                            low=parameter.low / ratio, high=parameter.high / ratio, prior=None)
                )  # fmt: skip
            elif parameter.kind != "run" and signal in errors:
                own.append(parameter)
    filtered = {}
    for part, windows in fit.parts.items():
        inputs = [_inputs(fit, model, fit_window) for fit_window in windows]
        filtered[part] = _Filtered(fit, SingleTrack(inputs, mass, front, rear))
    training = [fit_window.window for fit_window in fit.training]
    residuals = Residuals(filtered["training"], training, own, errors, settling=fit.settling, say=say)
    fitted = estimate(residuals, most_sets=fit.spec.most_sets)
    simulated = {part: single_track([fitted.values])[0] for part, single_track in filtered.items()}
    return FittedModel("single track with Fiala tyres", own, fitted, _shown(fit, fitted.values, simulated))


@dataclass(frozen=True)
class _Filtered:
    """The single track, filtered like the measurement."""

    fit: LoadedFit
    model: SingleTrack

    def __call__(self, sets: Sequence[Mapping[str, float]]) -> list[list[Simulated]]:
        low_pass = self.fit.measurement.filter
        responses = self.model(sets)
        if low_pass is None:
            return responses
        rates = [1.0 / float(w.window.times[1] - w.window.times[0]) for w in self.model.windows]
        return [
            [
                signals and {name: low_pass(x, rate) for name, x in signals.items()}
                for signals, rate in zip(several, rates, strict=True)
            ]
            for several in responses
        ]


def _inputs(fit: LoadedFit, model: ScenarioModel, fit_window: FitWindow) -> SingleTrackWindow:
    """Return a window with the inputs of the single track.

    Raises:
        ValueError: steering or speed is not measured.
    """
    times = fit_window.window.times
    raw = fit_window.raw.between(float(times[0]) - MARGIN, float(times[-1]) + MARGIN)
    if "steer_angle" in raw.signals:
        steer_angle = raw.signals["steer_angle"]
    elif "steering_wheel_angle" in raw.signals:
        steer_angle = raw.signals["steering_wheel_angle"] / _ratio(fit, model)
    else:
        raise ValueError("no steering angle is measured")
    if "velocity_x" not in raw.signals:
        raise ValueError("velocity_x is not measured")
    start = start_states(fit_window.filtered, float(times[0]))
    sideways = start["initial_speed"] * math.sin(start.get("initial_sideslip", 0.0))
    states = sideways, start.get("initial_yaw_rate", 0.0)
    return SingleTrackWindow(fit_window.window, raw.time, steer_angle, raw.signals["velocity_x"], states)


def _ratio(fit: LoadedFit, model: ScenarioModel) -> float:
    """Return the ratio of hand wheel to road wheels.

    Raises:
        ValueError: neither the measurement nor the scenario has it.
    """
    known = fit.measurement.vehicle.get("steering_ratio")
    ratios = (instance.parameter("steering_ratio") for instance in model.base.instances)
    ratio = known or next((float(value) for value in ratios if isinstance(value, (int, float))), None)
    if ratio is None:
        raise ValueError("the steering ratio is unknown")
    return ratio


def free_parameters(fit: LoadedFit, model: ScenarioModel) -> list[Parameter]:
    """Return the free parameters in SI.

    Raises:
        ScenarioError: a target or a range is wrong; lists all errors.
    """
    document = yaml_lines.read(fit.path, what="fit file")
    followed = set(model.followed.values())
    free = []
    for name, spec in fit.spec.free.items():
        try:
            free.append(_parameter(name, spec, fit, model, followed))
        except ValueError as error:  # noqa: PERF203 - all are reported
            document.report(("free", name), str(error), code_of(error))
    document.raise_errors()
    return free


def _parameter(
    name: str, spec: FreeSpec, fit: LoadedFit, model: ScenarioModel, followed: set[str]
) -> Parameter:
    kind, signal, start, unit, relative = "run", "", None, None, False
    if name.startswith(f"{MEASURED}."):
        _, signal, *rest = [*name.split("."), ""]
        if rest[:1] not in (["delay"], ["offset"]) or signal not in {*fit.errors, *followed}:
            known = [f"{MEASURED}.{name}.offset" for name in (*fit.errors, *sorted(followed))]
            guess = hint(name, known, lead="known are")
            raise ValueError(f"must be delay or offset of a signal that is compared or followed{guess}")
        unit = "s" if rest[0] == "delay" else SIGNALS[signal].unit
        start, kind, relative = 0.0, "run" if signal in followed else rest[0], True
    else:
        start, unit, relative = _value_of(Target.parse(name), model)
    if spec.start is not None:
        start = number_in(spec.start, unit, relative=relative)
    low, high = (number_in(bound, unit, relative=relative) for bound in (spec.low, spec.high))
    if start is None:
        raise ValueError("'start' is missing: the scenario gives no single value")
    if not low < start < high:
        raise ValueError(f"start {start:g} must lie between low {low:g} and high {high:g}")
    prior = None
    if spec.prior is not None:
        mean = number_in(spec.prior.mean, unit, relative=relative)
        prior = mean, number_in(spec.prior.deviation, unit, relative=True)
        if not prior[1] > 0.0:
            raise ValueError("prior: its deviation must be above 0")
    return Parameter(name, start, low, high, kind, signal, prior, unit or "1")  # type: ignore[arg-type]


def _value_of(target: Target, model: ScenarioModel) -> tuple[float | None, str | None, bool]:
    """Return the scenario's value of a target and its unit, None where it has none; and if it is relative.

    Raises:
        ValueError: nothing in the scenario takes it.
    """
    name = target.variable
    if target.kind == "fact":
        given = model.planner.load(model.fit.scenario).friction if name == "friction" else None
        return (given.value if given and isinstance(given.value, float) else None), FACTS[name].unit, False
    having = [
        instance
        for instance in model.base.instances
        if name in instance.fmu.variables and target.instance in ("", instance.name)
    ]
    if target.kind == "vehicle_parameter" and not having and name in CAR:
        return None, CAR[name].unit, False
    if target.kind == "input":
        return None, None, False
    if target.kind not in ("parameter", "vehicle_parameter") or not having:
        raise ValueError(f"{target}: nothing in the scenario takes it")
    value = having[0].parameter(name)
    number = float(value) if isinstance(value, (int, float)) else None
    return number, having[0].fmu.variables[name].unit, having[0].fmu.variables[name].relative
