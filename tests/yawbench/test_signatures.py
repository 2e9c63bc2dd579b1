"""Public signatures: types in place of `Any`, and classes that are public themselves."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import get_args

import pytest

import yawbench as yb
from yawbench import types
from yawbench.orchestrator.fault_kinds import KINDS, FaultName
from yawbench.proving_ground.standard_tests import TESTS, TestName

ANYTHING = {
    "Controller.output.u": "a named tuple with the fields that the controller's inputs name",
    "Run.record.return": "JSON of any depth, whose definition is the schema of run.json",
    "parameter.return": "a field of a dataclass of any type, as dataclasses.field returns it",
    "Evaluation.as_data.return": "JSON, as it is written to evaluation.json",
    "Fit.data.return": "JSON, as it is written to fit.json",
    "Validation.as_data.return": "JSON, as it is written to validation.json",
    "Verdict.as_data.return": "the same JSON",
    "Plan.scenario": "the scenario file as it was run: JSON of any depth",
    "Plan.__init__.scenario": "the same JSON",
    "Diagnostic.record.return": "JSON, as it is written to run.json",
    "Diagnostic.of.record": "the same JSON",
}
"""Parameters and return values annotated with Any, and why."""


def functions(module: ModuleType) -> Iterator[tuple[str, Callable[..., object]]]:
    """Yield the public functions, methods and properties of a module, by name."""
    for name in module.__all__:
        public = getattr(module, name)
        if not isinstance(public, type):
            if inspect.isfunction(public):
                yield name, public
            continue
        for member, value in vars(public).items():
            made = getattr(value, "fget", None) or getattr(value, "func", None) or value
            made = getattr(made, "__func__", made)
            if inspect.isfunction(made) and (
                not member.startswith("_") or member in ("__init__", "__getitem__")
            ):
                yield f"{name}.{member}", made


def annotations(module: ModuleType = yb) -> dict[str, str]:
    """Return the annotations of public functions and fields of a module, as the source has them."""
    notes = {
        f"{name}.{parameter}": note if isinstance(note, str) else inspect.formatannotation(note)
        for name, function in functions(module)
        for parameter, note in function.__annotations__.items()
        if not parameter.startswith("_")
    }
    for name in module.__all__:
        fields = getattr(getattr(module, name), "__annotations__", {})
        notes |= {f"{name}.{field}": str(note) for field, note in fields.items() if not field.startswith("_")}
    return notes


def has(word: str, annotation: str) -> bool:
    return re.search(rf"\b{word}\b", annotation) is not None


def test_no_public_signature_has_any_but_for_values_that_may_be_anything():
    found = {name for name, annotation in annotations().items() if has("Any", annotation)}
    assert found == set(ANYTHING)


def test_literals_name_all_kinds_of_faults_and_all_standard_tests():
    assert get_args(FaultName) == (*KINDS,)
    assert get_args(TestName) == (*TESTS,)


FOREIGN = {
    "Any",
    "CrossPlot",  # stands with its wing
    "Callable",
    "Collection",
    "DataFrame",
    "Dataset",
    "Figure",
    "ForwardRef",
    "Fraction",
    "Iterable",
    "Literal",
    "Mapping",
    "None",
    "Path",
    "Sequence",
    "StateSpace",
}
"""Types of the standard library, NumPy, pandas, xarray, Matplotlib and python-control."""
IN_FILES = "RunRecord."
"""Fields of records are those of run.json, whose parts have no methods of interest."""


@pytest.mark.parametrize("module", [yb, types])
def test_public_signatures_name_only_what_is_exported(module):
    notes = {key: note for key, note in annotations(module).items() if not key.startswith(IN_FILES)}
    named = {word for note in notes.values() for word in re.findall(r"\b[A-Z]\w+", note)}
    assert named - FOREIGN - {*yb.__all__} - {*types.__all__} == set()


def test_every_exported_type_occurs_in_a_public_signature():
    notes = " ".join([*annotations(yb).values(), *annotations(types).values()])
    assert {name for name in types.__all__ if not re.search(rf"\b{name}\b", notes)} <= ALIASED


ALIASED: set[str] = set()
"""Types that occur in other aliases alone."""
