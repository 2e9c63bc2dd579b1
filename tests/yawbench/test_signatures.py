"""What the public signatures say: types in place of `Any`, and classes that are public themselves."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from typing import get_args

import yawbench as yb
from orchestrator.evaluation.standard_tests import TESTS, TestName
from orchestrator.fault_kinds import KINDS, FaultName

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


def functions() -> Iterator[tuple[str, Callable[..., object]]]:
    """Yield the public functions, methods and properties, by name."""
    for name in yb.__all__:
        public = getattr(yb, name)
        if not isinstance(public, type):
            yield name, public
            continue
        for member, value in vars(public).items():
            made = getattr(value, "fget", None) or getattr(value, "func", None) or value
            made = getattr(made, "__func__", made)
            if inspect.isfunction(made) and (
                not member.startswith("_") or member in ("__init__", "__getitem__")
            ):
                yield f"{name}.{member}", made


def annotations() -> dict[str, str]:
    """Return the annotations of public functions and fields, as the source has them."""
    found = {
        f"{name}.{one}": note if isinstance(note, str) else inspect.formatannotation(note)
        for name, function in functions()
        for one, note in function.__annotations__.items()
    }
    for name in yb.__all__:
        fields = vars(getattr(yb, name)).get("__annotations__", {})
        found |= {f"{name}.{one}": note for one, note in fields.items()}
    return found


def has(word: str, annotation: str) -> bool:
    return re.search(rf"\b{word}\b", annotation) is not None


def test_no_public_signature_has_any_but_for_values_that_may_be_anything():
    found = {name for name, annotation in annotations().items() if has("Any", annotation)}
    assert found == set(ANYTHING)


INSIDE = {
    "ControllerLike",
    "CrossPlot",
    "Design",
    "ExperimentResult",
    "FitResult",
    "FaultList",
    "FaultName",
    "FaultySignal",
    "Instance",
    "LoadedScenario",
    "Messages",
    "Numbers",
    "PythonComponent",
    "Ranked",
    "RankingResult",
    "Relation",
    "Results",
    "Severity",
    "SignalName",
    "Status",
    "Target",
    "TestName",
    "TunedLaw",
    "Value",
    "VariableSpec",
    "Wire",
}
"""Private types in public signatures: what public classes are made of, and names of unions."""


def test_literals_name_all_kinds_of_faults_and_all_standard_tests():
    assert get_args(FaultName) == (*KINDS,)
    assert get_args(TestName) == (*TESTS,)


def test_public_signatures_name_only_what_is_exported():
    foreign = {
        "Any",
        "Callable",
        "Fraction",
        "DataFrame",
        "Dataset",
        "Figure",
        "Iterable",
        "Literal",
        "Mapping",
        "None",
        "Path",
        "Sequence",
        "StateSpace",
    }
    named = {word for note in annotations().values() for word in re.findall(r"\b[A-Z]\w+", note)}
    assert named - foreign - set(yb.__all__) == INSIDE
