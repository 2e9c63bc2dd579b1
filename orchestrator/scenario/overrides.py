"""Overrides: values that replace those of a scenario.

    --swap INSTANCE=FMU                  the FMU of an instance
    --set INSTANCE.PARAMETER=VALUE       a parameter of an instance
    --set vehicle.mass=1200              a parameter of the vehicle file, for all instances
    --set inputs.friction*=0.3           a constant
    --set friction=0.3, speed=...        a fact (see `vocabulary.facts`)
    --set stop_time=2, step_size=..., algorithm=...     the run
    --set INSTANCE.step_size=0.01        the step of an instance
    --set INSTANCE.validate=false        accept an FMU with an invalid model description
    --set tyres=my.tir                   the tyre property file; also `tyres.front`, `tyres.rear`
    --fault 'sensor.yaw_rate: freeze from 2 s'          the faults of a signal; `none` removes them

Studies and sweeps have the same targets, `faults.sensor.yaw_rate` for faults, and also `vehicle`, the vehicle
file itself. What a scenario consists of (FMUs, files, times, settings) is replaced before the scenario is
validated, and its document stores which override did so; a value or fault replaces one of the validated
scenario (`with_values`). Messages name the override instead of a line. `changed` has them in words.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from yawbench.fmus.fmu import Value, is_path
from yawbench.foundation.errors import Diagnostic, Location, ScenarioError
from yawbench.foundation.messages import closest, hint, listed
from yawbench.vocabulary.facts import FACTS

from ..fault_kinds import WORDS, FaultList
from ..plan import VARIED, Given, Override, OverrideOrigin, ValueOrigin, ValueSource
from ..signal_names import FAULTS, INPUTS, OF_RUN, TYRES, VEHICLE, Target
from . import yaml_lines
from .fault_schema import FaultSpec, location_of, parse_faults, read_line
from .quantities import instant, seconds
from .schema import ScenarioSpec, Vehicle, key_of, plain_value
from .yaml_lines import Document, KeyPath, at, mapping, put


def read_changes(
    swaps: Iterable[str] = (), settings: Iterable[str] = (), faults: Iterable[str] = ()
) -> tuple[Override, ...]:
    """Parse the overrides given as command-line options.

    Args:
        swaps: `unit=fmu`, as given to --swap; a path is relative to the working directory. An FMU may bring
            parameters along, `unit=fmu:parameter=value`.
        settings: `instance.parameter=value`, as given to --set.
        faults: `location: kind ...`, as given to --fault (see `fault_schema`); those of a location add up.

    Raises:
        ScenarioError: with all malformed options.
    """
    changes: list[Override] = []
    errors: list[str | Diagnostic] = []
    for text in swaps:
        instance, equals, fmu = (part.strip() for part in text.partition("="))
        if instance and equals and fmu:
            changes += swap_of(instance, fmu, "--swap")
        else:
            errors.append(f"--swap {text}: write --swap INSTANCE=FMU")
    for text in settings:
        name, equals, raw = (part.strip() for part in text.partition("="))
        target = _settable(name) if equals else None
        if target is not None:
            value = os.path.abspath(raw) if target.kind == "tyres" else yaml_lines.scalar(raw)
            try:
                changes.append(setting(target, value, "--set"))
            except ScenarioError as error:
                errors += error.diagnostics
        else:
            others = listed((*OF_RUN, *FACTS), last="or")
            likely = closest(name, [*OF_RUN, *FACTS])
            meant = f"; did you mean {likely}?" if likely else ""
            errors.append(f"--set {text}: write --set INSTANCE.PARAMETER=VALUE, or {others}=VALUE{meant}")
    at: dict[Target, FaultList] = {}
    for text in faults:
        location, colon, line = (part.strip() for part in text.partition(":"))
        if not (location and colon and line):
            errors.append(f"--fault {text}: write --fault 'INSTANCE.OUTPUT: KIND VALUE from TIME until TIME'")
            continue
        try:
            faults_there = faults_at(location, line, "--fault")
        except ScenarioError as error:
            errors += error.diagnostics
            continue
        at[faults_there.target] = FaultList((*at.get(faults_there.target, ()), *faults_there.faults))
    changes += [Override(target, fault_list, "--fault") for target, fault_list in at.items()]
    if errors:
        raise ScenarioError(errors, code="option-invalid")
    return tuple(changes)


def _settable(text: str) -> Target | None:
    """Return the target of `--set`, None if it is malformed or for another option."""
    try:
        target = Target.parse(text)
    except ValueError:
        return None
    return None if target.kind in ("fmu", "vehicle_file") else target


def setting(target: Target, value: Value, origin: OverrideOrigin) -> Override:
    """Return the override of a target; faults are parsed from their line.

    Raises:
        ScenarioError: nothing can have such a value, or there is no such kind of fault.
    """
    if target.kind == "faults":
        return faults_at(target.variable, str(value), origin)
    change = Override(target, value, origin)
    try:
        if target.is_time:
            (instant if target.variable == "start_time" else seconds)(value)
        elif key_of(target):
            plain_value(value)
    except ValueError as error:
        raise ScenarioError(
            Diagnostic("value-invalid", str(error), location=Location(target=str(change)))
        ) from None
    return change


def faults_at(place: str, stated: str | Mapping[str, Value], origin: OverrideOrigin) -> Override:
    """Return the override of the faults of a location: all in one line, or one with its options as in a file.

    Raises:
        ScenarioError: there is no such location or kind, or it takes something else.
    """
    line = stated
    if not isinstance(stated, str):
        named = [f"{name} {stated[name]}" for name in WORDS if name in stated]
        line = " ".join([*(str(stated[name]) for name in ("kind", "value") if name in stated), *named])
    where = str(Override(Target("faults", variable=place), str(line), origin))
    try:
        location = location_of(place)
        items = read_line(stated) if isinstance(stated, str) else [stated]
    except ValueError as error:
        raise ScenarioError(
            Diagnostic("fault-invalid", str(error), location=Location(target=where))
        ) from None
    faults = parse_faults(location, items, where)
    return Override(Target("faults", variable=str(location)), faults, origin)


def changes_of(
    swaps: Mapping[str, str], settings: Mapping[Target, Value], folder: Path, origin: OverrideOrigin
) -> list[Override]:
    """Return the overrides in a file of a folder: instance -> FMU (see `swap_of`) and target -> value."""
    changes = [
        setting(target, str(folder / str(value)) if target.kind == "tyres" else value, origin)
        for target, value in settings.items()
    ]
    for instance, text in swaps.items():
        fmu, *brought = swap_of(instance, text, origin)
        path = str(folder / str(fmu.value)) if is_path(str(fmu.value)) else fmu.value
        changes += [replace(fmu, value=path), *brought]
    return changes


def changes_of_run(spec: Any, origin: OverrideOrigin) -> list[Override]:
    """Return the overrides in the fields `stop_time`, `step_size` and `algorithm` of a specification."""
    fields = [(name, getattr(spec, name, None)) for name in OF_RUN]
    return [
        Override.of(name, float(value) if isinstance(value, Fraction) else value, origin)
        for name, value in fields
        if value is not None
    ]


def swap_of(instance: str, text: str, origin: OverrideOrigin) -> list[Override]:
    """Parse `fmu:parameter=value:parameter=value` for an instance into overrides, its FMU first."""
    match = re.fullmatch(r"(.*?)((?::\w+=[^:]*)*)", text, re.DOTALL)
    assert match is not None
    parameters = (part.partition("=") for part in match[2].split(":")[1:])
    brought = [
        Override(Target.of_instance(instance, name), yaml_lines.scalar(value), origin)
        for name, _, value in parameters
    ]
    return [Override(Target.of_instance(instance), match[1], origin), *brought]


def apply_changes(
    document: Document, vehicle: Document, changes: Iterable[Override]
) -> tuple[dict[str, str], tuple[Override, ...]]:
    """Apply overrides of what a scenario consists of (FMUs, files, times), and report what cannot be.

    Those of values are left to `with_values`. Of several overrides of a target, the last one wins.

    Returns:
        swapped instance -> its FMU in the file; the overrides that make a difference, and those of values.
    """
    replaced: dict[str, str] = {}
    effective: list[Override] = []
    instances = mapping(document.data, "units")
    for change in {change.target: change for change in changes}.values():
        kind, holder, name = change.target.kind, change.target.instance, change.target.variable
        spec = instances.get(holder)
        differs = True
        if kind == "run":
            differs = _put(document, (name,), change)
        elif kind == "tyres":
            differs = _put_tyres(document, vehicle, change)
        elif not holder:
            pass  # see `apply_vehicle` and `with_values`
        elif not isinstance(spec, dict):
            known = (*instances, VEHICLE, INPUTS) if name else instances
            sentence = f"the scenario has no instance {holder!r}{hint(holder, known, lead='it has')}"
            document.add(Diagnostic("instance-unknown", sentence, location=Location(target=str(change))))
            continue
        elif kind == "fmu":
            if isinstance(spec.get("fmu"), str):
                replaced[holder] = spec["fmu"]
            differs = _swap(document, holder, change)
        elif kind == "setting":
            differs = _put(document, ("units", holder, name), change)
        effective += [change] if differs else []
    return replaced, tuple(effective)


def _given(change: Override, value: Any, replaces: Given[Any] | None = None) -> Given[Any]:
    """Return a value that an override gives in place of another."""
    origin = ValueOrigin(change.origin, source=ValueSource(VARIED, change.origin))
    return Given(value, origin, Location(target=str(change)), replaces)


def with_values(
    scenario: ScenarioSpec, vehicle: Vehicle, changes: Iterable[Override]
) -> tuple[ScenarioSpec, Vehicle, tuple[Override, ...]]:
    """Return a scenario and its vehicle with the values that overrides give, and those that differ."""
    effective: list[Override] = []
    for change in changes:
        if change.faulty:
            there = [one for one in scenario.faults if str(one.value.on) == change.faulty]
            effective += [change] if [one.value.fault for one in there] != [*change.faults] else []
            items = [{"on": change.faulty, **fault.item} for fault in change.faults]
            own = [_given(change, FaultSpec.model_validate(item)) for item in items]
            others = [one for one in scenario.faults if one not in there]
            scenario = scenario.model_copy(update={FAULTS: [*others, *own]})
            continue
        key = key_of(change.target)
        of_vehicle = change.target.kind == "vehicle_parameter"
        before = at(vehicle if of_vehicle else scenario, key)
        given = _given(change, change.value, before)
        if not key or before is None or _differ(before.value, given.value):
            effective.append(change)
        if key and of_vehicle:
            vehicle = put(vehicle, key, given)
        elif key:
            scenario = put(scenario, key, given)
    return scenario, vehicle, tuple(effective)


def apply_vehicle(document: Document, changes: Iterable[Override]) -> None:
    """Apply overrides of the vehicle file, relative to the working directory."""
    for change in changes:
        if change.target.kind == "vehicle_file":
            _put(document, (VEHICLE,), change, os.path.abspath(str(change.value)))


def _put_tyres(document: Document, vehicle: Document, change: Override) -> bool:
    """Override tyre property files, relative to the working directory; return whether they differ."""
    file = os.path.abspath(str(change.value))
    axle = change.target.variable
    holder = next((d for d in (document, vehicle) if at(d.data, (TYRES,))), document)
    before = at(holder.data, (TYRES,))
    named = before if isinstance(before, dict) else {"front": before, "rear": before}
    named = {key: os.path.abspath(holder.path.parent / str(name)) for key, name in named.items() if name}
    after = {"front": file, "rear": file} if not axle else named | {axle: file}
    _put(document, (TYRES,), change, after)
    return after != named


def leave_unvalidated(document: Document) -> None:
    """Let every instance use its FMU even if the model description is invalid."""
    for name in mapping(document.data, "units"):
        document.data = put(document.data, ("units", name, "validate"), False)


def _swap(document: Document, instance: str, change: Override) -> bool:
    """Replace the FMU of an instance; return whether it differs."""
    fmu = str(change.value)
    key: KeyPath = ("units", instance, "fmu")
    before = document.data["units"][instance].get("fmu")
    if is_path(fmu):
        fmu = os.path.abspath(fmu)
        own = isinstance(before, str) and os.path.abspath(document.path.parent / before)
        return _put(document, key, change, fmu) and fmu != own
    return _put(document, key, change, fmu)


def _put(document: Document, key: KeyPath, change: Override, value: Any = None) -> bool:
    """Set the value at a key, by default that of the override; return whether it differs from before."""
    value = change.value if value is None else value
    before, document.data = at(document.data, key), put(document.data, key, value)
    document.overrides[key] = change
    return _differ(before, value)


def _differ(before: Any, after: Any) -> bool:
    return before != after or isinstance(before, bool) != isinstance(after, bool)


def changed(changes: Iterable[Override]) -> str:
    """Return overrides in words, `controller_off for controller, inputs.friction* = 0.3`; "" for none."""
    return ", ".join(map(_in_words, changes))


def _in_words(change: Override) -> str:
    value, target = change.value, change.target
    if change.faulty:
        return f"{change.faulty}: {value}"
    if change.swaps:
        return f"{fmu_of(change)} for {target}"
    if target.kind == "vehicle_file":
        return f"vehicle file {Path(str(value)).name}"
    if target.names_file:
        return f"{target} = {Path(str(value)).name}"
    seconds = " s" if target.is_time and not isinstance(value, str) else ""
    return f"{target} = {value_in_words(change.plain)}{seconds}"


def value_in_words(value: Value) -> str:
    """Return a value as in names of folders and in words, rounded."""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def fmu_of(swap: Override) -> str:
    """Return the name of the FMU that a swap inserts."""
    name = str(swap.value)
    return Path(name).stem if name.lower().endswith(".fmu") else name


def with_changes(title: str, changes: Iterable[Override]) -> str:
    """Return a title in one line, followed by the overrides."""
    return with_words(title, changed(changes))


def with_words(title: str, words: str) -> str:
    """Return a title in one line, followed by overrides in words."""
    return f"{title} (changed: {words})" if words and title else f"changed: {words}" if words else title
