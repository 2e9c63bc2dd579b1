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
