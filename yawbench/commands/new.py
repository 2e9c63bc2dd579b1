"""`yawbench new`: templates for files of your own."""

from __future__ import annotations

import importlib.util
import keyword
import os
import re
import shlex
import shutil
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath, PurePosixPath
from typing import Annotated, Any, Literal

import typer

from yawbench.commands.schema import schema_text
from yawbench.foundation.errors import ScenarioError
from yawbench.foundation.messages import listed

from .options import completing
from .terminal_progress import say


def check_name(name: str, *, role: str, taken: Iterable[str]) -> None:
    """Raise ScenarioError if `name` cannot be the name of a component.

    Args:
        name: of the file, without the role in front.
        role: of the component, such as "controller".
        taken: names of existing FMUs.
    """
    if name.startswith(f"{role}_") and name != f"{role}_":
        raise ScenarioError(
            f"{name!r}: omit {role!r}, which is added to the FMU's name: {_plain(name, role)!r}",
            code="name-invalid",
        )
    if not re.fullmatch(r"[a-z][a-z0-9_]{0,49}", name) or keyword.iskeyword(name):
        suggestion = _plain(name, role)
        usable = re.fullmatch(r"[a-z][a-z0-9_]{0,49}", suggestion) and not keyword.iskeyword(suggestion)
        guess = f"; for example {suggestion!r}" if usable else ""
        raise ScenarioError(
            f"{name!r} cannot name a {role}: use up to 50 lower-case letters, digits and _, "
            f"starting with a letter, and no keyword of Python{guess}",
            code="name-invalid",
        )
    if f"{role}_{name}" in taken:
        raise ScenarioError(
            f"the {role} {name!r} exists already; choose another name",
            code="file-exists",
        )


def _plain(name: str, role: str) -> str:
    """Return a valid name similar to `name`: MyIdea-2 -> my_idea_2."""
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name)
    return re.sub(r"[^a-z0-9]+", "_", words.lower()).strip("_").removeprefix(f"{role}_")


def class_name(name: str) -> str:
    """Return the name of a class: my_idea -> MyIdea."""
    return "".join(part.capitalize() for part in name.split("_"))


def title(name: str) -> str:
    """Return a name as words: my_idea -> My idea."""
    return name.replace("_", " ").strip().capitalize()


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
"""Instance -> FMU and its other lines in a scenario: paper A's run at 25 m/s."""
MORE = {"road": ("road_patchwork", "")}
"""Instances that this run does not have."""
ROLES = ("controller", "driver", "reference", "tyre", "plant", "road")
"""Roles that have templates."""
KINDS = (*ROLES, "vehicle", "scenario", "study", "sweep", "exercise")
"""All kinds of templates."""
LAW = {"gain": 20000.0, "integral_gain": 50000.0, "limit": 5000.0}
"""Gains and limit of the controller [N.m.s/rad, N.m/rad, N.m]; chosen: they hold paper A's car."""
VEHICLES = PurePosixPath("scenarios/vehicles")
SCHEMAS = PurePosixPath("scenarios/schemas")


@dataclass(frozen=True)
class NewFiles:
    """New files by their paths relative to the project folder, and which of them to run, build and test."""

    files: dict[PurePosixPath, str]
    main: PurePosixPath  # the file to run: a scenario, a study, a sweep
    source: PurePosixPath | None = None  # of a component: the Python file, or the folder of the C files
    test: PurePosixPath | None = None


def begin(kind: str, name: str, language: Language = "python", *, in_checkout: bool) -> NewFiles:
    """Return the files of a template.

    In a checkout of yawbench a component goes to the project's own components, elsewhere to folders such as
    `controllers` and `tests`. Scenarios always go to `scenarios`.
    """
    scenario = PurePosixPath("scenarios", name, "25mps.yaml")
    shipped = "../vehicles/in_wheel_motor_car.yaml" if in_checkout else ""
    facts: dict[str, Any] = {
        "name": name,
        "title": title(name),
        "scenario": scenario.name,
        "vehicle": f"../vehicles/{name}.yaml" if kind == "vehicle" else shipped,
        "source_words": "the run of paper A (Yuan, Chen, Huang, Shi) at 25 m/s",
        "units": [(instance, *UNITS[instance]) for instance in UNITS],
    }
    if kind in ROLES:
        return _unit(kind, name, language, in_checkout, scenario, facts)
    if kind == "exercise":
        return _exercise(name, in_checkout, scenario, facts)
    templates = {scenario: "scenario.yaml.j2"}
    main = scenario
    if kind == "vehicle":
        templates[VEHICLES / f"{name}.yaml"] = "vehicle.yaml.j2"
    elif kind != "scenario":
        main = scenario.with_name(f"{kind}.yaml")
        templates[main] = f"{kind}.yaml.j2"
    return NewFiles(_rendered(templates, facts), main)


def _exercise(name: str, in_checkout: bool, scenario: PurePosixPath, facts: dict[str, Any]) -> NewFiles:
    """Return an exercise: a controller without its law, tests, a study that judges it, marking, the task."""
    unit = _unit("controller", name, "python", in_checkout, scenario, facts)
    assert unit.source and unit.test
    facts |= {"test": unit.test, "scenario_path": scenario, "components": "yawbench.components"}
    home, study = PurePosixPath("exercises", name), scenario.with_name("exercise.yaml")
    own = {
        unit.source: "exercise_controller.py.j2",
        unit.test: "exercise_test.py.j2",
        study: "exercise_study.yaml.j2",
        home / "mark.py": "exercise_mark.py.j2",
    }
    files = unit.files | _rendered(own, facts)
    builds = _builds(files, "controller", unit.source, in_checkout, PurePosixPath())
    facts["builds"] = [shlex.join(("yawbench", "build", *arguments)) for arguments in builds]
    files |= _rendered({home / "README.md": "exercise.md.j2"}, facts)
    return NewFiles(files, study, unit.source, unit.test)


def _other(role: str, source: PurePosixPath | None) -> str:
    """Return the FMU that a new unit is compared with; "" for files without a unit."""
    return "controller_off" if role == "controller" else (UNITS | MORE)[role][0] if source else ""


def _builds(
    files: Mapping[PurePosixPath, str],
    role: str,
    source: PurePosixPath | None,
    in_checkout: bool,
    folder: PurePath,
) -> list[list[str]]:
    """Return the arguments of each `yawbench build` of what new files in a folder need.

    Outside a checkout only the FMUs that they use are built, which takes seconds instead of minutes.
    """
    from yawbench.fmus.build import find_recipes

    if in_checkout:
        return [[]]
    written = " ".join(files.values())
    used = {name for name in find_recipes() if re.search(rf"\b{name}\b", written)}
    out = ["--out", str(folder / "fmus")]
    own = [[str(folder / source), *out]] if source else []
    return [[*sorted({*used, *filter(None, [_other(role, source)])}), *out], *own]


def _unit(
    role: str,
    name: str,
    language: Language,
    in_checkout: bool,
    scenario: PurePosixPath,
    facts: dict[str, Any],
) -> NewFiles:
    """Return the source of a component, its test and a scenario that uses it."""
    home = PurePosixPath("components" if in_checkout else "", f"{role}s")
    source = home / (f"{name}.py" if language == "python" else name)
    test = PurePosixPath("tests/components" if in_checkout else "tests", f"test_{name}.py")
    own = {"driver": ""}.get(role, (UNITS | MORE)[role][1])  # a new driver has parameters of its own
    facts |= {
        "role": role,
        "fmu": f"{role}_{name}",
        "class_name": class_name(name),
        "components": "." if in_checkout else "yawbench.components",
        "source": source,
        "levels": len(test.parts) - 1,
        "source_words": f"{facts['source_words']}, with a {role} of your own",
        "units": [(instance, *fmu) for instance, fmu in (UNITS | {role: (f"{role}_{name}", own)}).items()],
        **LAW,
    }
    templates = {scenario: "scenario.yaml.j2"}
    templates[test] = "test_controller.py.j2" if role == "controller" else "test_unit.py.j2"
    if language == "python":
        templates[source] = f"{role}.py.j2"
    else:
        templates[source / f"{name}.c"] = "controller.c.j2"
        templates[source / "modelDescription.xml"] = "modelDescription.xml.j2"
    return NewFiles(_rendered(templates, facts), scenario, source, test)


def _rendered(templates: dict[PurePosixPath, str], facts: dict[str, Any]) -> dict[PurePosixPath, str]:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("yawbench.commands")
    environment = Environment(
        loader=loader, undefined=StrictUndefined, keep_trailing_newline=True, trim_blocks=True
    )
    files = {path: environment.get_template(name).render(facts) for path, name in sorted(templates.items())}
    for path in [path for path in files if path.suffix == ".yaml"]:
        files[path] = _with_schema(path, files[path])
    return files


def _with_schema(path: PurePosixPath, text: str) -> str:
    """Return a YAML file that names its schema to editors."""
    return f"# yaml-language-server: $schema=../schemas/{_schema_kind(path)}.json\n{text}"


def write_new(files: dict[PurePosixPath, str], folder: Path, *, also: Iterable[PurePosixPath] = ()) -> None:
    """Write files below `folder`; none if one of them, or of the paths `also`, exists.

    Raises:
        ScenarioError: names what exists.
    """
    there = [str(path) for path in dict.fromkeys((*files, *also)) if (folder / path).exists()]
    if there:
        verb = "exists" if len(there) == 1 else "exist"
        raise ScenarioError(
            f"{folder}: {listed(there)} {verb} already; nothing was written",
            code="file-exists",
        )
    for path, text in files.items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        with target.open("x", encoding="utf-8", newline="\n") as file:
            try:
                file.write(text)
                file.flush()
            except OSError:  # a full disk
                target.unlink()
                raise


def write_schemas(files: Iterable[PurePosixPath], folder: Path) -> None:
    """Write the JSON Schemas that YAML files below `folder` name in their first line."""
    from yawbench.foundation.safe_files import write_whole

    for path in files:
        if path.suffix == ".yaml":
            kind = _schema_kind(path)
            write_whole(folder / SCHEMAS / f"{kind}.json", schema_text(kind))


def _schema_kind(path: PurePosixPath) -> str:
    """Return the kind of a new YAML file, in the words of `kinds`."""
    return {"study": "experiment", "sweep": "experiment", "exercise": "experiment"}.get(
        path.stem, "vehicle" if path.parent == VEHICLES else "scenario"
    )


NewKind = Literal[KINDS]  # type: ignore[valid-type]
NewKindArgument = Annotated[NewKind, typer.Argument(help="Kind of template.", metavar="KIND")]
NewName = Annotated[str, typer.Argument(help="Name: lower-case letters, digits and _.", metavar="NAME")]
Written = Annotated[Literal["python", "c"], typer.Option("--language", help="Language of a controller.")]
Project = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="DIR",
        help="Project folder. Default: the current checkout, else the working directory.",
    ),
]


From = Annotated[
    str | None,
    typer.Option(
        "--from",
        metavar="SCENARIO",
        help="Of a scenario: copy this one, a file or a name in scenarios/.",
        autocompletion=completing("a scenario"),
    ),
]


def new(
    kind: NewKindArgument,
    name: NewName,
    language: Written = "python",
    out: Project = None,
    source: From = None,
) -> None:
    """Write a working template to start from.

    KIND is a component (controller, driver, reference, tyre, plant, road), written with a test and a
    scenario that uses it; a vehicle with a scenario; a scenario, with --from a copy of another, whose files
    are still found; a study or sweep of a scenario; or an exercise: a controller without its law, tests, a
    study that judges it, a script that marks, the task. The
    commands to run next are printed. In a checkout of yawbench the files go beside its own, where
    `yawbench build` finds them; elsewhere into folders controllers, tests, scenarios and so on. Existing
    files are never overwritten.
    """
    from yawbench.fmus.build import COMPONENTS, find_recipes

    role = "controller" if kind == "exercise" else kind
    check_name(name, role=role, taken=set(find_recipes()))
    if language == "c" and kind != "controller":
        raise ScenarioError("--language c: only available for controllers", code="name-invalid")
    if source is not None and kind != "scenario":
        raise ScenarioError("--from: only available for scenarios", code="option-invalid")
    root = COMPONENTS.parent
    checkout = root if (root / "scenarios").is_dir() else None  # None: installed without them
    here = checkout is not None and Path.cwd().resolve().is_relative_to(checkout)
    folder = out or (checkout if checkout is not None and here else Path())
    in_checkout = folder.resolve() == checkout
    if source is None:
        beginning = begin(kind, name, language, in_checkout=in_checkout)
    else:
        beginning = _copy(source, name, folder)
    also = [beginning.source] if beginning.source else []
    write_new(beginning.files, folder, also=also)
    write_schemas(beginning.files, folder)
    for path in beginning.files:
        say(f"wrote {_shown(folder / path)}")
    say("Next:")
    for command in _next(kind, name, beginning, folder, in_checkout):
        print(shlex.join(command))


def _copy(source: str, name: str, folder: Path) -> NewFiles:
    """Return a copy of a scenario, in which the files that it names are still found.

    Raises:
        ScenarioError: there is no such scenario, or it is no YAML file.
    """
    from yawbench.foundation.safe_files import TEXT, read_bytes
    from yawbench.orchestrator.scenario import catalogue, yaml_lines

    file = catalogue.find(source, "a scenario")
    if file.suffix not in catalogue.YAML:
        raise ScenarioError(f"--from {source}: is no scenario file", code="option-invalid")
    document = yaml_lines.read(file, what="scenario file")
    document.raise_errors()
    path = PurePosixPath("scenarios", name, file.name)
    text = read_bytes(file, largest=TEXT).decode("utf-8-sig")
    text = re.sub(r"\A# yaml-language-server: .*\n", "", text)
    for written in sorted({*_texts(document.data)}, key=len, reverse=True):
        if Path(written).suffix and (found := file.parent / written).is_file():
            there = Path(os.path.relpath(found.resolve(), (folder / path).parent.resolve())).as_posix()
            text = re.sub(rf"(?<![\w./-]){re.escape(written)}(?![\w./-])", there.replace("\\", r"\\"), text)
    return NewFiles({path: _with_schema(path, text)}, path)


def _texts(data: Any) -> Iterable[str]:
    """Yield the texts in the values of a document."""
    if isinstance(data, str):
        yield data
    for inner in data.values() if isinstance(data, dict) else data if isinstance(data, list) else ():
        yield from _texts(inner)


def _next(kind: str, name: str, begun: NewFiles, folder: Path, in_checkout: bool) -> list[list[str]]:
    """Return the commands that build, test and run the new files."""
    yawbench, python = _program("yawbench"), _program("python")
    role = "controller" if kind == "exercise" else kind
    builds = _builds(begun.files, role, begun.source, in_checkout, _shown(folder))
    commands = [[yawbench, "build", *arguments] for arguments in builds]
    if begun.test:
        if importlib.util.find_spec("pytest") is None:
            commands.append([python, "-m", "pip", "install", "pytest"])
        commands.append([python, "-m", "pytest", str(_shown(folder / begun.test))])
    main = str(_shown(folder / begun.main))
    command = {"study": "study", "sweep": "sweep", "exercise": "study"}.get(kind, "run")
    commands.append([yawbench, command, main])
    if kind == "exercise":
        commands.append([python, str(_shown(folder / "exercises" / name / "mark.py"))])
    elif begun.source:
        commands.append(
            [yawbench, "compare", main, "--swap", f"{kind}={_other(role, begun.source)},{kind}_{name}"]
        )
    return commands


def _shown(path: Path) -> Path:
    """Return a path relative to the working directory where possible."""
    relative = Path(os.path.relpath(path))
    return path.absolute() if relative.parts[:1] == ("..",) else relative


def _program(name: str) -> str:
    """Return the command that calls a program of this environment from the working directory."""
    ours = Path(sys.executable).with_name(name)
    path = shutil.which(name)
    if not ours.exists() or (path is not None and os.path.samefile(path, ours)):
        return name
    return str(_shown(ours))
