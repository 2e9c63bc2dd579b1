"""The JSON Schemas of YAML files: they accept what the program accepts, and refuse what it refuses."""

from __future__ import annotations

import copy
import functools
import inspect
import itertools
import random
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from tests.command_line import status_of
from yawbench.commands.new import begin
from yawbench.commands.schema import kinds, model_of, schema_of, schema_text
from yawbench.measured_cars import fit_file as fit
from yawbench.measurements import measurement
from yawbench.orchestrator.scenario import yaml_lines
from yawbench.orchestrator.scenario.catalogue import kind_of
from yawbench.orchestrator.scenario.schema_validation import validate
from yawbench.orchestrator.scenario.yaml_lines import Document
from yawbench.ranking import ranking, threats

SCENARIOS = Path(__file__).parents[2] / "scenarios"
KIND = {
    "a scenario": "scenario", "a vehicle file": "vehicle", "a study file": "experiment",
    "a sweep file": "experiment", "a tuning file": "experiment", "a ranking file": "ranking",
    "a file of entries": "entries", "a threat file": "threats", "a file of bands": "bands",
}  # fmt: skip
FILES = {path: KIND[kind_of(path)] for path in sorted(SCENARIOS.rglob("*.yaml"))}
VALIDATORS = {kind: jsonschema.Draft7Validator(schema_of(kind)) for kind in kinds()}

MEASUREMENT = {"files": ["a.csv"], "signals": {"yaw_rate": {"column": "Gyro", "unit": "deg/s"}}}
FIT = {
    "title": "A fit", "scenario": "s.yaml", "measured": "m.yaml", "compared": {"yaw_rate": "0.1 deg/s"},
    "training": [{"begin": 0, "end": "30 s"}], "free": {"vehicle.mass": {"low": 1000, "high": 2000}},
}  # fmt: skip


@functools.cache
def data_of(path: Path) -> Any:
    """Return the content of a YAML file."""
    document = yaml_lines.read(path, what="file")
    assert not document.errors
    return document.data


def problems(kind: str, data: Any) -> list[str]:
    """Return what the schema of a kind finds wrong."""
    return [f"{list(error.absolute_path)}: {error.message}" for error in VALIDATORS[kind].iter_errors(data)]


def accepted(kind: str, data: Any) -> bool:
    """Return whether the model of a kind accepts the data."""
    document = Document(Path("file.yaml"), data=copy.deepcopy(data))
    return validate(model_of(kind), document) is not None and not document.errors


@pytest.mark.parametrize("kind", kinds())
def test_the_schemas_in_the_package_are_those_of_the_models(kind):
    jsonschema.Draft7Validator.check_schema(schema_of(kind))
    file = SCENARIOS / "schemas" / f"{kind}.json"
    written = file.read_text(encoding="utf-8")
    assert written == schema_text(kind), "python -m docs.generate writes them anew"


SOME = {path for kind in {*KIND.values()} for path in [one for one in FILES if FILES[one] == kind][::5]}
"""Files of every kind, for the first tier."""


@pytest.mark.parametrize(
    "files", [SOME, pytest.param(FILES, marks=pytest.mark.exhaustive)], ids=["some", "all"]
)
def test_every_file_of_the_project_is_valid(files):
    assert {FILES[path] for path in files} == {*KIND.values()}
    wrong = {str(path): found for path in files if (found := problems(FILES[path], data_of(path)))}
    assert wrong == {}


@pytest.mark.parametrize(
    ("kind", "module"),
    [("measurement", measurement), ("fit", fit), ("ranking", ranking), ("threats", threats)],
)
def test_examples_in_the_reference_are_valid(kind, module, tmp_path):
    _, _, after = inspect.getdoc(module).partition("\n\n")
    lines = itertools.takewhile(lambda line: line.startswith("    "), after.splitlines())
    example = tmp_path / "example.yaml"
    example.write_text(textwrap.dedent("\n".join(lines)) + "\n")
    assert problems(kind, data_of(example)) == []


@pytest.mark.parametrize("kind", ["scenario", "study", "sweep", "vehicle", "controller"])
def test_new_files_are_valid_and_name_their_schema(kind, tmp_path):
    for path, text in begin(kind, "idea", in_checkout=True).files.items():
        if path.suffix != ".yaml":
            continue
        first, _, _ = text.partition("\n")
        named = first.removeprefix("# yaml-language-server: $schema=../schemas/").removesuffix(".json")
        (tmp_path / path.name).write_text(text)
        assert named in kinds()
        assert problems(named, data_of(tmp_path / path.name)) == []


def test_the_command_lists_the_kinds_and_prints_a_schema(capsys):
    status_of("schema")
    assert capsys.readouterr().out.split() == [*kinds()]
    for name, kind in {"fit": "fit", "sweep": "experiment"}.items():
        status_of("schema", name)
        assert capsys.readouterr().out == schema_text(kind)


MISSING = object()
A = "fnn_sideslip"
BROKEN: list[tuple[str | dict[str, Any], tuple[str | int, ...], Any]] = [
    (f"{A}/25mps", ("stop_time",), MISSING),
    (f"{A}/25mps", ("stop_time",), 0),
    (f"{A}/25mps", ("stop_time",), "8 km"),
    (f"{A}/25mps", ("stop_time",), "-1/30 s"),
    (f"{A}/25mps", ("start_time",), "soon"),
    (f"{A}/25mps", ("algorithm",), "newton"),
    (f"{A}/25mps", ("frictoin",), 0.5),
    (f"{A}/25mps", ("units", "plant", "fmu"), MISSING),
    (f"{A}/25mps", ("units", "plant", "parameters"), {"mass": {"of": 1100}}),
    (f"{A}/25mps", ("units", "plant", "tolerance"), 1),
    (f"{A}/25mps", ("units", "plant", "validate"), "no"),
    (f"{A}/25mps", ("units", "my plant"), {"fmu": "plant_seven_dof"}),
    (f"{A}/25mps", ("units", "vehicle"), {"fmu": "plant_seven_dof"}),
    (f"{A}/25mps", ("connections", 0, "to"), "plant"),
    (f"{A}/25mps", ("connections", 0, "from"), []),
    (f"{A}/25mps", ("record",), ["plant.*_*"]),
    (f"{A}/25mps", ("tyres",), {"front": "a.tir"}),
    (f"{A}/25mps", ("inputs",), {"steer_angle": {"column": "delta"}}),
    (f"{A}/25mps", ("inputs",), {"steer_angle": {"file": "a.csv", "interpolation": "cubic"}}),
    (f"{A}/25mps", ("faults",), [{"on": "yaw_rate", "kind": "freeze"}]),
    (f"{A}/25mps", ("faults",), [{"on": "plant.yaw_rate", "kind": "frozen"}]),
    (f"{A}/25mps", ("faults",), [{"on": "plant.yaw_rate", "kind": "freeze", "value": 1}]),
    (f"{A}/25mps", ("faults",), [{"on": "plant.yaw_rate", "kind": "dropout"}]),
    (f"{A}/25mps", ("faults",), [{"on": "plant.yaw_rate", "kind": "dropout", "share": "150 m"}]),
    ("vehicles/van", ("parameters", "mass"), {"kg": 1100}),
    (f"{A}/study", ("runs",), MISSING),
    (f"{A}/study", ("scenario",), "25mps.yaml"),
    (f"{A}/study", ("metrics", "another"), {"metric": "pek(sideslip)"}),
    (f"{A}/study", ("metrics", "another"), {"metric": "peak(sideslip)", "window": [1]}),
    (f"{A}/study", ("claims", 0, "holds_if"), []),
    (f"{A}/study", ("claims", 0, "holds_if", 0, "equals"), 3),
    (f"{A}/study", ("figures", 0, "kind"), "pie"),
    (f"{A}/sweep", ("axes", "speed", "values"), []),
    (f"{A}/sweep", ("axes", "speed", "vary"), ["plant."]),
    ("proving_ground/tuned", ("entries",), {"a": {"title": "A", "fmu": "f"}}),
    ("proving_ground/threats", ("threats", "amplitude", "easy"), -45),
    (MEASUREMENT, ("signals",), {"yaw_rat": "Gyro"}),
    (MEASUREMENT, ("signals", "yaw_rate", "delay"), 20),
    (FIT, ("settling",), "1 m"),
    ("bands/steady_state", ("over",), "lateral acceleration"),
    ("bands/steady_state", ("bands", "yaw_rate"), {"offset": 1}),
]  # fmt: skip
"""A case of each rule that is written twice, for the program and for the schema; of the others, a few."""


def changed(data: Any, place: tuple[str | int, ...], value: Any) -> Any:
    """Return data with a value changed, added or removed."""
    made = copy.deepcopy(data)
    holder = made
    for part in place[:-1]:
        holder = holder[part]
    if value is MISSING:
        del holder[place[-1]]
    else:
        holder[place[-1]] = value
    return made


@pytest.mark.parametrize(
    ("source", "place", "value"),
    BROKEN,
    ids=[f"{i}-{'.'.join(map(str, place))}" for i, (_, place, _) in enumerate(BROKEN)],
)
def test_what_the_program_refuses_the_schema_refuses(source, place, value):
    if isinstance(source, str):
        path = SCENARIOS / f"{source}.yaml"
        kind, data = FILES[path], data_of(path)
    else:
        kind, data = "measurement" if source is MEASUREMENT else "fit", source
    assert accepted(kind, data)
    assert problems(kind, data) == []
    broken = changed(data, place, value)
    assert not accepted(kind, broken)
    assert problems(kind, broken) != []


VALUES = (
    None, True, 0, -1, 1, 2.5, 0.5, 1e12, "", "x", "5 %", "90 km/h", "1/30 s", "1/30", "5 ms", "-3 ms",
    "a.b", "a.*", "*.a", "plant.yaw_rate", "peak(sideslip)", " peak(a) ", [], ["a"], [1, 2], [2, 1], {},
    {"a": "b"}, {"a": 1}, {"a": {}}, "freeze", "bias", ["a.b"], "linear", "grid", "1 to 3 s",
)  # fmt: skip
NUMBERS = {"friction", "speed"}
"""Keys whose text the program refuses only when it knows the FMUs; so are those below `parameters`."""


def places_in(data: Any, place: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Yield the places of all values."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        yield (*place, key)
        yield from places_in(value, (*place, key))


@pytest.mark.parametrize(
    "files", [SOME, pytest.param(FILES, marks=pytest.mark.exhaustive)], ids=["some", "all"]
)
def test_what_the_schema_refuses_the_program_refuses(files):
    random_ = random.Random(28)
    smaller = [path for path in FILES if path in files and path.stat().st_size < 6000]
    contents = {path: data_of(path) for path in smaller}
    refused = 0
    for _ in range(600):
        path = random_.choice(smaller)
        place = random_.choice(list(places_in(contents[path])))
        if NUMBERS & {*place} or "parameters" in place:
            continue
        broken = changed(contents[path], place, random_.choice((MISSING, *VALUES)))
        if found := problems(FILES[path], broken):
            refused += 1
            assert not accepted(FILES[path], broken), (path, place, found)
    assert refused > 100
