"""Loads scenarios: reads the file, with its vehicle and tyre files, applies overrides, and validates it."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from yawbench.foundation.errors import Diagnostic, Location, ScenarioError
from yawbench.foundation.messages import hint, listed
from yawbench.foundation.safe_files import reads

from ..plan import Override
from . import like, overrides, quantities, schema_validation, yaml_lines
from .catalogue import ARCHIVES, FMU, beside
from .schema import Connection, LoadedScenario, PropertyFile, ScenarioSpec, Vehicle, endpoint
from .yaml_lines import Document, KeyPath, mapping

STEPS = 1_000_000_000
"""Maximum number of steps of a run. Chosen: about as many as a computer makes in a day."""

__all__ = ["Connection", "LoadedScenario", "ScenarioSpec", "load_scenario"]


@reads("scenario file", ScenarioError)
def load_scenario(
    path: Path | str,
    *,
    changes: Sequence[Override] = (),
    data: dict[str, Any] | None = None,
    read: Callable[..., Document] = like.read,
    read_tyre: Callable[[str], PropertyFile] | None = None,
    validate: bool = True,
) -> LoadedScenario:
    """Read a scenario file, an SSP archive, or an FMU alone.

    Args:
        path: the YAML file, the FMU, or the archive; of an archive with variants also `system.ssp/other.ssd`.
        changes: overrides of the file; see `overrides`.
        data: its content, if there is no such file: messages name `path`.
        read: reads a file, called like `like.read`; the returned document is modified.
        read_tyre: reads a tyre property file; None: the scenario must not name any.
        validate: False: accept FMUs with invalid model descriptions.

    Raises:
        ScenarioError: with all errors of the file, its vehicle file and the overrides.
    """
    other = _other_reader(Path(path))
    if data is not None:
        document = Document(Path(path), data=data)
    else:
        document = other.read(Path(path)) if other else read(Path(path), what="scenario file")
    wanted = changes if isinstance(document.data, dict) else ()
    overrides.apply_vehicle(document, wanted)
    vehicle_document = _read_vehicle(document, read)
    replaced, effective = overrides.apply_changes(document, vehicle_document, wanted)
    replaced = _swapped_by_likeness(document) | replaced
    if other and isinstance(document.data, dict) and (missing := _missing_times(document, other.LACKS)):
        raise ScenarioError(document.sorted_errors() + missing)
    if not validate:
        overrides.leave_unvalidated(document)

    file = schema_validation.validate(ScenarioSpec, document)
    vehicle = schema_validation.validate(Vehicle, vehicle_document)
    if isinstance(document.data, dict):
        _check_time_grid(document)
        _check_instance_names(document)
    if file is not None and vehicle is not None:
        file, vehicle, effective = overrides.with_values(file, vehicle, effective)
    tyres = _read_tyres(file, vehicle, document, vehicle_document, read_tyre or _unread)
    errors = document.sorted_errors() + vehicle_document.sorted_errors()
    if errors or file is None or vehicle is None:
        raise ScenarioError(errors)
    return LoadedScenario.model_construct(
        **dict(file),
        document=document,
        vehicle_document=vehicle_document,
        vehicle_file=vehicle,
        tyre_files=tyres,
        replaced=replaced,
        changes=effective,
        explicit=other is not None,
    )


def _swapped_by_likeness(document: Document) -> dict[str, str]:
    """Return instance -> its FMU in the file that this one is like, where it has another one here."""
    first, instances = document.origin(), mapping(document.data, "units") if document.like else {}
    before = {name: yaml_lines.at(first.data, ("units", name, "fmu")) for name in instances}
    return {
        name: fmu
        for name, fmu in before.items()
        if isinstance(fmu, str) and fmu != yaml_lines.at(instances, (name, "fmu"))
    }


def _other_reader(path: Path) -> Any:
    """Return the module that reads what is not a scenario file, None if it is one."""
    if path.suffix.lower() in ARCHIVES:
        from . import ssp_read  # lxml takes long to import, and scenario files do not need it

        return ssp_read
    if path.suffix.lower() == FMU:
        from . import fmu_alone

        return fmu_alone
    return None


def _missing_times(document: Document, lacks: str) -> list[Diagnostic]:
    """Return an error for each time that neither what is not a scenario file nor an option gives."""
    return [
        Diagnostic(
            "key-missing",
            f"{lacks} no {words}: give one in s, such as --set {name}={such_as}",
            location=Location(document.path),
        )
        for name, words, such_as in (
            ("stop_time", "stop time", 10),
            ("step_size", "communication step", 0.001),
        )
        if name not in document.data
    ]


def _read_vehicle(document: Document, read: Callable[..., Document]) -> Document:
    name = yaml_lines.at(document.data, ("vehicle",))
    if not isinstance(name, str):
        return Document(document.path, data={})
    vehicle = beside(document.path, name, "a vehicle file")
    if vehicle != Path(os.path.normpath(document.path.parent / name)):  # as a path from here on
        document.data = yaml_lines.put(document.data, ("vehicle",), str(vehicle))
    if not os.path.exists(vehicle):
        (missing,) = read(vehicle, what="vehicle file").errors
        document.report(("vehicle",), str(missing), missing.code)
        return Document(vehicle, data={})
    return read(vehicle, what="vehicle file")


def _unread(path: str) -> PropertyFile:
    raise ScenarioError(f"{path}: nothing here reads such files", code="file-unreadable")


def _read_tyres(
    scenario: ScenarioSpec | None,
    vehicle: Vehicle | None,
    document: Document,
    vehicle_document: Document,
    read: Callable[[str], PropertyFile],
) -> dict[str, PropertyFile]:
    """Return the tyre property file of each axle; report its errors and note its warnings."""
    if scenario is None or vehicle is None:
        return {}
    named, where = (scenario.tyres, document) if scenario.tyres else (vehicle.tyres, vehicle_document)
    files: dict[str, PropertyFile] = {}
    for name in dict.fromkeys((named or {}).values()):
        try:
            file = read(os.path.normpath(where.path.parent / name))
        except ScenarioError as error:
            for diagnostic in error.diagnostics:
                where.report(("tyres",), str(diagnostic), diagnostic.code)
            continue
        document.notes.extend(file.warnings)
        files |= {axle: file for axle, written in (named or {}).items() if written == name}
    return {axle: files[axle] for axle in named or {} if axle in files}


def _check_time_grid(document: Document) -> None:
    """Report every time that is not an integer multiple of the communication step."""
    data, exact = document.data, quantities.exact_text
    step, stop = _seconds(data.get("step_size")), _seconds(data.get("stop_time"))
    if step is None:
        return
    start = _read(quantities.instant, data.get("start_time", 0)) or Fraction(0)
    if stop is not None:
        steps, wrong = (stop - start) / step, ""
        if stop <= start:
            wrong = f"must be after start_time, {float(start):.12g} s (got {float(stop):.12g} s)"
        elif steps > STEPS:
            wrong = f"a run has at most {STEPS:,} steps (this would have {float(steps):.3g})"
        if wrong:
            document.report(("stop_time",), wrong, "time-grid-invalid")
            return
    times: list[tuple[KeyPath, object, Fraction]] = []  # key, time, and whence it counts
    if stop is not None:
        times.append((("stop_time",), stop - start, start))
    for name, instance in mapping(data, "units").items():
        own = yaml_lines.at(instance, ("step_size",))
        times.append((("units", name, "step_size"), own, Fraction(0)))
    for key, value, begin in times:
        time = _seconds(value)
        if time is None or time % step == 0:
            continue
        below = time // step * step
        change = document.override(("step_size",))
        origin = f" ({change})" if change else ""
        allowed = [f"{exact(t + begin)} s" for t in (below, below + step) if t > 0]
        after = f" from {exact(begin)} s on" if begin else ""
        meant = _unrounded(step)
        fraction = f"; did you mean step_size: {meant} s?" if meant and time % meant == 0 else ""
        document.report(
            key,
            f"{exact(time)} s{after} is not an integer multiple of the communication step "
            f"{exact(step)} s{origin}; nearest allowed: {listed(allowed, last='or')}{fraction}",
            "time-grid-invalid",
        )


def _unrounded(step: Fraction) -> Fraction | None:
    """Return the fraction 1/n that a step with at least three digits rounds: 1/30 for 0.0333."""
    meant = Fraction(1, max(1, round(1 / step)))
    digits = len(f"{float(step):.12e}".partition("e")[0].replace(".", "").rstrip("0"))
    rounds = digits >= 3 and float(f"{float(meant):.{digits}g}") == float(f"{float(step):.{digits}g}")
    return meant if rounds and meant != step else None


def _seconds(value: object) -> Fraction | None:
    return _read(quantities.seconds, value)


def _read(parse: Callable[[object], Fraction], value: object) -> Fraction | None:
    try:
        return parse(value)
    except ValueError:
        return None


def _check_instance_names(document: Document) -> None:
    """Report every instance that is named in `connections` or `record` but does not exist."""
    data = document.data
    instances = data.get("units")
    if not isinstance(instances, dict):
        return
    named: list[tuple[KeyPath, object]] = []
    connections, record = data.get("connections"), data.get("record")
    for i, connection in enumerate(connections if isinstance(connections, list) else ()):
        if isinstance(connection, dict):
            named += [(("connections", i, end), connection.get(end)) for end in ("from", "to")]
    named += [(("record", i), item) for i, item in enumerate(record if isinstance(record, list) else ())]
    for key, value in named:
        for instance in _instances_in(value):
            if instance not in instances and not (instance == "*" and key[0] == "record"):
                document.report(
                    key,
                    f"there is no instance {instance!r}{hint(instance, instances, lead='instances')}",
                    "instance-unknown",
                )


def _instances_in(value: object) -> list[str]:
    """Return the instances that an end of a connection names; none if it is malformed."""
    if isinstance(value, list):
        return [name for name in value if isinstance(name, str)]
    try:
        return [endpoint(value).instance]
    except ValueError:
        return []
