"""Diagnostics: their codes, which one page of the documentation lists, and what a record of them keeps."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path

import pytest

from tests.refusals import mentions
from yawbench.foundation import errors
from yawbench.foundation.errors import (
    Diagnostic,
    Location,
    ScenarioError,
    SimulationError,
    text_of,
    warnings_in,
)

ROOT = Path(__file__).parents[2]
CODE = re.compile(r"[a-z]+(-[a-z]+)*")
MAKERS = {
    "Diagnostic",
    "PlausibilityCheck",
    "code_of",
    "fail",
    "note",
    "report",
    "_report",
    "_warning",
    "_diagnostics",
    "Problem",
}
"""Functions that take a code, beside the errors."""
NAMES = {"code", "default_code", "DIFFERENCES"}
"""Names that codes are assigned to."""


def texts_in(nodes) -> set[str]:
    found = (one for node in nodes for one in ast.walk(node) if isinstance(one, ast.Constant))
    return {one.value for one in found if isinstance(one.value, str) and CODE.fullmatch(one.value)}


def codes_of(tree: ast.AST) -> set[str]:
    """Return the codes in a module: arguments of what makes diagnostics, and values of the names of codes."""
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            given = [key.value for key in node.keywords if key.arg == "code"]
            if name in MAKERS or name.endswith("Error"):
                given += [one for one in node.args if isinstance(one, ast.Constant) and "-" in str(one.value)]
            if name == "EventKind" and any(key.arg == "warning" for key in node.keywords):
                given += [node.args[0]]
            found |= texts_in(given)
        elif isinstance(node, ast.Assign) and {getattr(to, "id", "") for to in node.targets} & NAMES:
            values = node.value.values if isinstance(node.value, ast.Dict) else [node.value]
            found |= texts_in(value for value in values if value is not None)
        elif isinstance(node, ast.arguments):
            positional = [*node.posonlyargs, *node.args]
            takers = [*positional[len(positional) - len(node.defaults) :], *node.kwonlyargs]
            pairs = zip(takers, [*node.defaults, *node.kw_defaults], strict=True)
            found |= texts_in(value for one, value in pairs if one.arg == "code" and value is not None)
    return found - {"error", "warning", "info"}


def test_the_page_lists_every_code_and_no_other():
    page = (ROOT / "docs/diagnostics.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ((?:`[a-z-]+`(?:, )?)+) \|", page, re.MULTILINE)
    listed = [code for row in rows for code in re.findall(r"`([a-z-]+)`", row)]
    fields = {"code", "message", "severity", "location", "value"}
    files = [
        file
        for part in ("foundation", "fmus", "orchestrator", "yawbench")
        for file in (ROOT / part).rglob("*.py")
    ]
    used = set().union(*(codes_of(ast.parse(file.read_text(encoding="utf-8"))) for file in files))
    assert len(set(listed)) == len(listed)
    assert set(listed) - fields == used - {errors.YawbenchError.default_code}


WHERE = Location(Path("a.yaml"), 3, "units.plant", "plant", "plant.yaw_rate", 1.5)


@pytest.mark.parametrize(
    "one",
    [
        Diagnostic("key-unknown", "unknown key", location=WHERE),
        Diagnostic(
            "car-spins", "the car spins", "warning", Location(signal="plant.sideslip", time=0.5), 90.0
        ),
        Diagnostic("note", "as before", "info"),
    ],
)
def test_a_record_of_a_diagnostic_gives_it_back(one):
    assert Diagnostic.of(json.loads(json.dumps(one.record()))) == one


def test_a_text_begins_with_file_line_and_target_and_can_be_printed():
    assert mentions(str(Diagnostic("x", "must be\x1b 1", location=WHERE)), "a.yaml:3", "units.plant", "1")
    assert str(Diagnostic("x", "lost", location=Location(instance="plant", time=2.0))) == "lost"
    assert text_of([Diagnostic("x", "a"), Diagnostic("y", "b", location=Location(target="k"))]) == "a; k: b"


def test_of_warnings_of_a_time_the_earliest_of_each_code_is_kept():
    late, early = (
        Diagnostic("wheel-lifts", w, "warning", Location(time=t)) for w, t in (("fl", 2.0), ("rr", 1.0))
    )
    values = [Diagnostic("values-differ", name, "warning") for name in ("mass", "friction", "mass")]
    note = Diagnostic("unit-missing", "no unit", "info")
    assert warnings_in([*values, note, late, early]) == (*values[:2], early)


def test_an_error_has_the_code_of_its_class_or_of_the_place_where_it_is_raised():
    assert ScenarioError("wrong").code == ScenarioError.default_code
    assert ScenarioError("wrong", code="axis-unknown").code == "axis-unknown"
    several = ScenarioError([Diagnostic("key-unknown", "one"), "two"])
    assert [one.code for one in several.diagnostics] == ["key-unknown", ScenarioError.default_code]
    failed = SimulationError("plant: lost", instance="plant", time=0.5)
    assert failed.diagnostics[0].location == Location(instance="plant", time=0.5)
