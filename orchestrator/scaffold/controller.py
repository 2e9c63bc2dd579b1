"""A controller to begin with: its source in Python or C, its test, a scenario that uses it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, Literal

from ..errors import ScenarioError
from ..wording import listed
from .names import class_name, title

Language = Literal["python", "c"]

DEFAULTS = {"gain": 20000.0, "integral_gain": 50000.0, "limit": 5000.0}
"""Gains and limit of the law to begin with [N.m.s/rad, N.m/rad, N.m]; chosen: they hold paper A's car."""


@dataclass(frozen=True)
class Layout:
    """Where the files of a controller go, relative to the folder of the project."""

    source: PurePosixPath  # the Python file, or the folder of the C files
    test: PurePosixPath
    scenario: PurePosixPath
    in_checkout: bool


def layout(name: str, language: Language, *, in_checkout: bool) -> Layout:
    """Return where the files of the controller `name` go.

    In a checkout of yawbench they stand among its own, elsewhere in folders `controllers`, `tests`
    and `scenarios`.
    """
    home = PurePosixPath("components/controllers" if in_checkout else "controllers")
    return Layout(
        source=home / (f"{name}.py" if language == "python" else name),
        test=PurePosixPath("tests/components" if in_checkout else "tests") / f"test_{name}.py",
        scenario=PurePosixPath("scenarios") / name / "25mps.yaml",
        in_checkout=in_checkout,
    )


def controller_files(name: str, language: Language, places: Layout) -> dict[PurePosixPath, str]:
    """Return path -> text of every file of the controller `name`."""
    facts: dict[str, Any] = {
        "name": name,
        "fmu": f"controller_{name}",
        "title": title(name),
        "class_name": class_name(name),
        "components": "." if places.in_checkout else "components",
        "source": places.source,
        "levels": len(places.test.parts) - 1,
        "vehicle": "../vehicles/in_wheel_motor_car.yaml" if places.in_checkout else "",
        **DEFAULTS,
    }
    templates = {places.test: "test_controller.py.j2", places.scenario: "scenario.yaml.j2"}
    if language == "python":
        templates[places.source] = "controller.py.j2"
    else:
        templates[places.source / f"{name}.c"] = "controller.c.j2"
        templates[places.source / "modelDescription.xml"] = "modelDescription.xml.j2"
    return {path: _render(template, facts) for path, template in sorted(templates.items())}


def _render(template: str, facts: dict[str, Any]) -> str:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("orchestrator.scaffold")
    environment = Environment(loader=loader, undefined=StrictUndefined, keep_trailing_newline=True)
    return environment.get_template(template).render(facts)


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
