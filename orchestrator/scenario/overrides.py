"""What the command line changes in a scenario before it is validated.

`--swap unit=fmu` replaces a unit's FMU; `--set unit.parameter=value` gives a parameter. Two names
that no unit may have stand for more: `--set vehicle.mass=1200` changes the parameter set that all
units share, `--set inputs.friction*=0.3` a constant. `--set stop_time=2`, `step_size` and `algorithm`
change the run, `--set unit.step_size=0.01` the step of a unit. Whatever is changed this way remembers its
option, so that later messages name the option in place of a line.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from ..wording import hint, listed
from . import yaml_lines
from .yaml_lines import Document

RESERVED = ("vehicle", "inputs")
"""Words that `--set` understands in place of a unit."""
OF_RUN = ("stop_time", "step_size", "algorithm")
"""What `--set` gives without a unit."""


def is_path(fmu: str) -> bool:
    """Return whether `fmu` is a path of an archive, not a name in the folder of FMUs."""
    return fmu.lower().endswith(".fmu") or "/" in fmu or "\\" in fmu


def _swaps(document: Document, swaps: Iterable[str]) -> Iterator[tuple[str, str, str]]:
    """Yield option, unit and FMU of every --swap; report those that are none.

    Paths are relative to the working directory.
    """
    for text in swaps:
        option = f"--swap {text}"
        unit, equals, fmu = (part.strip() for part in text.partition("="))
        if unit and equals and fmu:
            yield option, unit, os.path.abspath(fmu) if is_path(fmu) else fmu
        else:
            document.problems.append((0, f"{option}: write --swap UNIT=FMU"))


def _settings(document: Document, settings: Iterable[str]) -> Iterator[tuple[str, str, str, Any]]:
    """Yield option, holder, name and value of every --set of a parameter; give the run what is meant for it.

    Those that are none are reported.
    """
    for text in settings:
        option = f"--set {text}"
        target, equals, raw = (part.strip() for part in text.partition("="))
        holder, dot, name = target.partition(".")
        value = yaml_lines.scalar(raw)
        if target in OF_RUN and equals:
            _give(document, target, value, option)
        elif holder and dot and name and equals:
            yield option, holder, name, value
        else:
            sentence = f"write --set UNIT.PARAMETER=VALUE, or {listed(OF_RUN, last='or')}=VALUE"
            document.problems.append((0, f"{option}: {sentence}"))


def apply_swaps(document: Document, swaps: Iterable[str]) -> dict[str, str]:
    """Replace FMUs; return the replaced one of each unit."""
    replaced: dict[str, str] = {}
    units = _mapping(document.data, "units")
    for option, unit, fmu in _swaps(document, swaps):
        spec = units.get(unit)
        if not isinstance(spec, dict):
            sentence = f"{option}: the scenario has no unit {unit!r}"
            document.problems.append((0, sentence + hint(unit, units, lead="it has")))
            continue
        if isinstance(spec.get("fmu"), str):
            replaced.setdefault(unit, spec["fmu"])
        spec["fmu"] = fmu
        document.overrides[("units", unit, "fmu")] = option
    return replaced


def apply_settings(document: Document, vehicle: Document, settings: Iterable[str]) -> None:
    """Set parameters of units, of the vehicle, and constants of inputs."""
    units = _mapping(document.data, "units")
    for option, unit, name, value in _settings(document, settings):
        if unit == "vehicle":
            _put(vehicle, (), "parameters", name, value, option)
        elif unit == "inputs":
            _put(document, (), "inputs", name, value, option)
        elif isinstance(units.get(unit), dict) and name == "step_size":
            units[unit][name] = value
            document.overrides[("units", unit, name)] = option
        elif isinstance(units.get(unit), dict):
            _put(document, ("units", unit), "parameters", name, value, option)
        else:
            sentence = f"{option}: the scenario has no unit {unit!r}"
            document.problems.append((0, sentence + hint(unit, (*units, *RESERVED), lead="it has")))


def apply_to_all_runs(document: Document, swaps: Iterable[str], settings: Iterable[str]) -> None:
    """Enter options into the `swap` and `set` of a file that has many runs of a scenario."""
    for option, unit, fmu in _swaps(document, swaps):
        _put(document, (), "swap", unit, fmu, option)
    for option, holder, name, value in _settings(document, settings):
        _put(document, (), "set", f"{holder}.{name}", value, option)


def apply_values(document: Document, values: Mapping[str, Any]) -> None:
    """Set top-level keys, such as step_size, where the value is not None."""
    for name, value in values.items():
        if value is not None:
            _give(document, name, value, f"{name} = {value}")


def _give(document: Document, name: str, value: Any, option: str) -> None:
    if isinstance(document.data, dict):
        document.data[name] = value
        document.overrides[(name,)] = option


def _put(document: Document, above: tuple[str, ...], group: str, name: str, value: Any, option: str) -> None:
    holder = document.data
    for part in above:
        holder = _mapping(holder, part)
    if isinstance(holder, dict) and holder.get(group) is None:
        holder[group] = {}
    members = _mapping(holder, group)
    members[name] = value
    key = (*above, group, name)
    document.overrides[key] = option


def _mapping(data: Any, name: str) -> dict[str, Any]:
    """Return data[name] if both are mappings, else an empty one: the schema will say what is wrong."""
    inner = data.get(name) if isinstance(data, dict) else None
    return inner if isinstance(inner, dict) else {}
