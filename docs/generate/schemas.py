"""The references of scenario and experiment files, from the schemas that read them."""

from __future__ import annotations

import inspect
import typing
from fractions import Fraction
from pathlib import Path
from types import NoneType
from typing import Any, Literal

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from yawbench.orchestrator.fault_kinds import KINDS, FaultLocation
from yawbench.orchestrator.scenario import schema as scenario
from yawbench.orchestrator.signal_names import SignalName, Target
from yawbench.ranking import ranking as ranking
from yawbench.ranking import threats as threats
from yawbench.studies import schema as experiment
from yawbench.studies.expression import Expression
from yawbench.studies.load_experiment import ExperimentFile

from .text import NOTE, cell, code, docstring, table

EXAMPLE = Path(__file__).resolve().parents[2] / "scenarios" / "fnn_sideslip" / "25mps.yaml"


def scenario_page() -> str:
    """Return the page of scenario files and vehicle files."""
    example = (
        f"## An example\n\n`scenarios/fnn_sideslip/25mps.yaml`:\n\n```yaml\n{EXAMPLE.read_text('utf-8')}```"
    )
    page = _page("Scenario files", scenario, [scenario.ScenarioSpec, scenario.Vehicle], example)
    kinds = [(code(name), cell(kind.does), code(kind.unit or "")) for name, kind in KINDS.items()]
    meaning = "Of a signal x, whose unit is {x}."
    return "\n\n".join([
        page, "## Kinds of faults", cell(meaning), table(("kind", "effect", "unit"), kinds)
    ])  # fmt: skip


def experiment_page() -> str:
    """Return the page of studies and sweeps."""
    return _page("Study and sweep files", experiment, [ExperimentFile])


def ranking_page() -> str:
    """Return the page of rankings."""
    return _page("Ranking files", ranking, [ranking.RankingSpec])


def threats_page() -> str:
    """Return the page of threat files."""
    return _page("Threat files", threats, [threats.ThreatsSpec])


def _page(heading: str, module: Any, roots: list[type[BaseModel]], more: str = "") -> str:
    parts = [f"# {heading}", NOTE, docstring(inspect.getdoc(module) or "")]
    models = reachable(roots)
    parts += [more] if more else []
    for model in models:
        parts += [f"## {title(model)}", cell(inspect.getdoc(model) or ""), _fields(model, models)]
    return "\n\n".join(parts)


def title(model: type[BaseModel]) -> str:
    """Return the heading under which a model's keys are told."""
    return model.__name__.removesuffix("Spec")


def reachable(models: list[type[BaseModel]]) -> list[type[BaseModel]]:
    """Return the models and all that their fields are made of, in the order met."""
    found = list(models)
    for model in found:
        for field in model.model_fields.values():
            found += [inner for inner in _models_in(field.annotation) if inner not in found]
    return found


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return list(dict.fromkeys(m for arm in typing.get_args(annotation) for m in _models_in(arm)))


def _fields(model: type[BaseModel], models: list[type[BaseModel]]) -> str:
    rows = []
    for name, field in model.model_fields.items():
        kind = _kind(field.annotation, models)
        rows.append((code(field.alias or name), kind, _default(field), cell(field.description or "")))
    return table(("key", "kind", "default", "meaning"), rows)


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "**required**"
    value = field.get_default(call_default_factory=True)
    if value is None or value in ("", {}, []):
        return ""
    if isinstance(value, (list, tuple)):
        return ", ".join(code(str(item)) for item in value)
    return code(str(value))


_WORDS = {
    str: "text",
    Expression: "text",
    int: "whole number",
    float: "number",
    bool: "true or false",
    Fraction: "time: s, or with its unit",
}


def _kind(annotation: Any, models: list[type[BaseModel]]) -> str:
    """Return a type in words, with links to the models."""
    origin, arms = typing.get_origin(annotation), typing.get_args(annotation)
    if annotation in models:
        return f"[{title(annotation)}](#{title(annotation).lower()})"
    if annotation is Target:
        return "text: target of an override"
    if annotation is SignalName:
        return "text: instance.variable"
    if annotation is FaultLocation:
        return "text: instance.variable, instance.output -> instance"
    if origin is typing.Annotated:
        return _kind(arms[0], models)
    if origin is Literal:
        return " or ".join(code(str(arm)) for arm in arms)
    if origin is dict:
        return f"mapping: name → {_kind(arms[1], models)}"
    if origin in (list, set):
        return f"list of {_kind(arms[0], models)}"
    if origin is tuple:
        return "[" + ", ".join(_kind(arm, models) for arm in arms) + "]"
    if arms:
        words = dict.fromkeys(_kind(arm, models) for arm in arms if arm is not NoneType)
        if "number" in words:
            words.pop("whole number", None)
        return " or ".join(words)
    return _WORDS.get(annotation, "any value")
