"""What there is to begin with: a unit of any role, a car, a scenario, a study, a sweep, each ready to run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, Literal

from ..errors import ScenarioError
from ..wording import listed
from .names import class_name, title

Language = Literal["python", "c"]

UNITS = {
    "driver": ("driver_sine", ", parameters: {amplitude: 0.0325, frequency: 0.2, start_time: 1.0}"),
    "reference": ("reference_steady_state", ""),
    "controller": ("controller_fnn", ", step_size: 0.002"),
    "allocator": ("allocator_load_proportional", ", step_size: 0.002"),
    "wheel_control": ("wheel_control_direct", ", step_size: 0.002"),
    "plant": ("plant_seven_dof", ""),
    "tyre": ("tyre_dugoff", ""),
}
"""Unit -> FMU and what else a scenario says of it: paper A's run at 25 m/s."""
MORE = {"road": ("road_patchwork", "")}
"""Units which that run does without."""
ROLES = ("controller", "driver", "reference", "tyre", "plant", "road")
"""Units that can be begun with."""
KINDS = (*ROLES, "vehicle", "scenario", "study", "sweep")
"""All that can be begun with."""
LAW = {"gain": 20000.0, "integral_gain": 50000.0, "limit": 5000.0}
"""Gains and limit of the controller [N.m.s/rad, N.m/rad, N.m]; chosen: they hold paper A's car."""
VEHICLES = PurePosixPath("scenarios/vehicles")


@dataclass(frozen=True)
class Beginning:
    """Files to begin with, relative to the folder of the project, and which of them are what."""

    files: dict[PurePosixPath, str]
    main: PurePosixPath  # what is run: a scenario, a study, a sweep
    source: PurePosixPath | None = None  # of a unit: the Python file, or the folder of the C files
    test: PurePosixPath | None = None


def begin(kind: str, name: str, language: Language = "python", *, in_checkout: bool) -> Beginning:
    """Return the files of a beginning.

    In a checkout of yawbench a unit stands among its own, elsewhere in folders such as `controllers` and
    `tests`. Scenarios always stand in `scenarios`.
    """
    scenario = PurePosixPath("scenarios", name, "25mps.yaml")
    shipped = "../vehicles/in_wheel_motor_car.yaml" if in_checkout else ""
    facts: dict[str, Any] = {
        "name": name,
        "title": title(name),
        "scenario": scenario.name,
        "vehicle": f"../vehicles/{name}.yaml" if kind == "vehicle" else shipped,
        "source_words": "the run of paper A (Yuan, Chen, Huang, Shi) at 25 m/s",
        "units": [(unit, *UNITS[unit]) for unit in UNITS],
    }
    if kind in ROLES:
        return _unit(kind, name, language, in_checkout, scenario, facts)
    templates = {scenario: "scenario.yaml.j2"}
    main = scenario
    if kind == "vehicle":
        templates[VEHICLES / f"{name}.yaml"] = "vehicle.yaml.j2"
    elif kind != "scenario":
        main = scenario.with_name(f"{kind}.yaml")
        templates[main] = f"{kind}.yaml.j2"
    return Beginning(_rendered(templates, facts), main)


def _unit(
    role: str,
    name: str,
    language: Language,
    in_checkout: bool,
    scenario: PurePosixPath,
    facts: dict[str, Any],
) -> Beginning:
    """Return the source of a unit, its test and a scenario that uses it."""
    home = PurePosixPath("components" if in_checkout else "", f"{role}s")
    source = home / (f"{name}.py" if language == "python" else name)
    test = PurePosixPath("tests/components" if in_checkout else "tests", f"test_{name}.py")
    own = {"driver": ""}.get(role, (UNITS | MORE)[role][1])  # its parameters are its own
    facts |= {
        "role": role,
        "fmu": f"{role}_{name}",
        "class_name": class_name(name),
        "components": "." if in_checkout else "components",
        "source": source,
        "levels": len(test.parts) - 1,
        "source_words": f"{facts['source_words']}, with a {role} of your own",
        "units": [(unit, *fmu) for unit, fmu in (UNITS | {role: (f"{role}_{name}", own)}).items()],
        **LAW,
    }
    templates = {scenario: "scenario.yaml.j2"}
    templates[test] = "test_controller.py.j2" if role == "controller" else "test_unit.py.j2"
    if language == "python":
        templates[source] = f"{role}.py.j2"
    else:
        templates[source / f"{name}.c"] = "controller.c.j2"
        templates[source / "modelDescription.xml"] = "modelDescription.xml.j2"
    return Beginning(_rendered(templates, facts), scenario, source, test)


def _rendered(templates: dict[PurePosixPath, str], facts: dict[str, Any]) -> dict[PurePosixPath, str]:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("orchestrator.scaffold")
    environment = Environment(
        loader=loader, undefined=StrictUndefined, keep_trailing_newline=True, trim_blocks=True
    )
    return {path: environment.get_template(name).render(facts) for path, name in sorted(templates.items())}


def write_new(files: dict[PurePosixPath, str], folder: Path, *, also: Iterable[PurePosixPath] = ()) -> None:
    """Write files below `folder`; none if one of them, or of the places `also`, exists.

    Raises:
        ScenarioError: names what exists.
    """
    there = [str(path) for path in dict.fromkeys((*files, *also)) if (folder / path).exists()]
    if there:
        verb = "exists" if len(there) == 1 else "exist"
        raise ScenarioError(
            f"{folder}: {listed(there)} {verb} already; nothing is overwritten, nothing written"
        )
    for path, text in files.items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        with target.open("x", encoding="utf-8", newline="\n") as file:
            file.write(text)
