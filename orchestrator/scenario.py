"""Reading a scenario file: options applied, validated, every problem reported in one go."""

from __future__ import annotations

import os
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from . import overrides, quantities, yaml_lines
from .errors import ScenarioError
from .plan import Algorithm
from .scenario_schema import Connection, Endpoint, Scenario, UnitSpec, Vehicle, endpoint, short
from .wording import closest, hint, listed
from .yaml_lines import Document, Key

__all__ = ["Connection", "Endpoint", "Scenario", "UnitSpec", "Vehicle", "load_scenario"]


def load_scenario(
    path: Path | str,
    *,
    swaps: Sequence[str] = (),
    settings: Sequence[str] = (),
    stop_time: Fraction | float | str | None = None,
    step_size: Fraction | float | str | None = None,
    algorithm: Algorithm | None = None,
) -> Scenario:
    """Read a scenario file.

    Args:
        path: the YAML file.
        swaps: `unit=fmu`, as given to --swap.
        settings: `unit.parameter=value`, as given to --set.
        stop_time, step_size: in place of the file's [s].
        algorithm: in place of the file's.

    Raises:
        ScenarioError: with everything that is wrong with the file, its vehicle file, the options.
    """
    document = yaml_lines.read(Path(path), what="scenario file")
    vehicle_document = _read_vehicle(document)
    replaced = overrides.apply_swaps(document, swaps) if document.data is not None else {}
    if document.data is not None:
        overrides.apply_settings(document, vehicle_document, settings)
    values = {"stop_time": stop_time, "step_size": step_size, "algorithm": algorithm}
    overrides.apply_values(document, values)

    scenario = _validate(Scenario, document)
    vehicle = _validate(Vehicle, vehicle_document)
    if isinstance(document.data, dict):
        _check_time_grid(document)
        _check_unit_names(document)
    problems = document.sentences() + vehicle_document.sentences()
    if problems or scenario is None or vehicle is None:
        raise ScenarioError(problems)
    scenario._document, scenario._vehicle_document = document, vehicle_document
    scenario._vehicle, scenario._replaced = vehicle, replaced
    return scenario


def _read_vehicle(document: Document) -> Document:
    name = document.data.get("vehicle") if isinstance(document.data, dict) else None
    if not isinstance(name, str):
        return Document(document.path, data={})
    vehicle = Path(os.path.normpath(document.path.parent / name))
    if not vehicle.exists():
        missing = yaml_lines.read(vehicle, what="vehicle file").problems[0][1]
        document.report(("vehicle",), missing)
        return Document(vehicle, data={})
    return yaml_lines.read(vehicle, what="vehicle file")


def _validate(model: type[Any], document: Document) -> Any:
    """Return the validated model, or None with the problems noted in the document."""
    if document.data is None:
        return None
    try:
        return model.model_validate(document.data)
    except ValidationError as errors:
        for error in errors.errors(include_url=False):
            key: Key = tuple(part for part in error["loc"] if part != "[key]")
            _report(model, document, key, error)
    return None


def _report(model: type[BaseModel], document: Document, key: Key, error: Any) -> None:
    kind, given = error["type"], error["input"]
    if kind == "missing":
        document.report(key[:-1], f"{str(key[-1])!r} is missing")
    elif kind == "extra_forbidden":
        allowed = _keys(model, key)
        likely = closest(str(key[-1]), allowed)
        guess = f"did you mean {likely!r}? " if likely else ""
        document.report(key, f"unknown key; {guess}allowed here: {listed(allowed)}")
    elif kind == "literal_error":
        document.report(key, f"must be {error['ctx']['expected']} (got {short(given)})")
    elif kind == "value_error":
        document.report(key, str(error["ctx"]["error"]))
    elif kind in _MUST_BE:
        document.report(key, f"must be {_MUST_BE[kind]} (got {short(given)})")
    else:
        document.report(key, f"{error['msg']} (got {short(given)})")


_MUST_BE = {
    "string_type": "text",
    "string_too_short": "text",
    "dict_type": "a mapping",
    "model_type": "a mapping",
    "list_type": "a list",
    "too_short": "a mapping of at least one unit",
}


def _keys(model: type[BaseModel], key: Key) -> list[str]:
    """Return the keys allowed where `key` stands."""
    inner: type[BaseModel] = model
    if len(key) > 1:
        inner = UnitSpec if key[0] == "units" else Connection
    return [field.alias or name for name, field in inner.model_fields.items()]


def _check_time_grid(document: Document) -> None:
    """Report every time that is no integer multiple of the communication step."""
    data = document.data
    step = _seconds(data.get("step_size"))
    if step is None:
        return
    times: list[tuple[Key, object]] = [(("stop_time",), data.get("stop_time"))]
    units = data.get("units")
    for name, unit in units.items() if isinstance(units, dict) else ():
        if isinstance(unit, dict):
            times.append((("units", name, "step_size"), unit.get("step_size")))
    for key, value in times:
        time = _seconds(value)
        if time is None or time % step == 0:
            continue
        below = time // step * step
        option = document.override(("step_size",))
        origin = f" ({option})" if option else ""
        nearest = listed([f"{float(t):.12g} s" for t in (below, below + step) if t > 0], last="or")
        document.report(
            key,
            f"{float(time):.12g} s is no integer multiple of the communication step "
            f"{float(step):.12g} s{origin}; nearest allowed: {nearest}",
        )


def _seconds(value: object) -> Fraction | None:
    try:
        return quantities.seconds(value)
    except ValueError:
        return None


def _check_unit_names(document: Document) -> None:
    """Report every unit that is named in a connection or a record but does not exist."""
    data = document.data
    units = data.get("units")
    if not isinstance(units, dict):
        return
    named: list[tuple[Key, object]] = []
    connections, record = data.get("connections"), data.get("record")
    for i, connection in enumerate(connections if isinstance(connections, list) else ()):
        if isinstance(connection, dict):
            named += [(("connections", i, end), connection.get(end)) for end in ("from", "to")]
    named += [(("record", i), item) for i, item in enumerate(record if isinstance(record, list) else ())]
    for key, value in named:
        try:
            unit = endpoint(value).unit
        except ValueError:
            continue
        if unit not in units and not (unit == "*" and key[0] == "record"):
            document.report(key, f"there is no unit {unit!r}{hint(unit, units, lead='units')}")
