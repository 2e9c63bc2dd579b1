"""Checks of newly built FMUs: valid model description, loading, parameter values, reference results.

FMUs are loaded in a separate process, shared by all FMUs of a build, because an FMU may crash its process or
change its state.
"""

from __future__ import annotations

import atexit
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from yawbench.foundation.processes import ProcessLost, Worker

_checker: Worker | None = None


def defects(fmu: Path, *modules: str) -> list[str]:
    """Return the defects of an FMU with the Python modules `modules`, empty if there are none.

    It is validated and loaded once; its parameters must have the values in its model description.
    """
    answer = _ask(_defects, fmu, *modules)
    return [f"does not load: its process {answer}"] if isinstance(answer, str) else answer


def reference_files(fmu: Path, *modules: str) -> dict[str, str]:
    """Return an FMU's reference result as path in the archive -> text, empty if its run fails.

    The run fails, for instance, without a binary for this platform.
    """
    answer = _ask(_reference_files, fmu, *modules)
    return {} if isinstance(answer, str) else answer


def _ask(function: Callable[..., Any], *arguments: object) -> Any:
    """Return what a function returns in the other process, or a text that says how that died."""
    global _checker
    if _checker is None:
        _checker = Worker(())
        atexit.register(_checker.close, kill=True)
    try:
        _checker.give(function, [*map(str, arguments)])
        value, error = _checker.answer()
    except ProcessLost as lost:
        _checker = None
        return str(lost)
    if error is not None:
        raise error
    return value


def _reference_files(fmu: str, *modules: str) -> dict[str, str]:
    os.dup2(2, 1)  # output of FMUs goes to stderr
    from .reference_result import reference_result
    from .staging import isolated_modules

    try:
        with isolated_modules(*modules):
            return reference_result(Path(fmu))
    except Exception:  # the FMU's own, or fmpy's
        return {}


def _defects(fmu: str, *modules: str) -> list[str]:
    os.dup2(2, 1)  # output of FMUs goes to stderr
    import fmpy
    from fmpy.validation import validate_fmu

    from .staging import isolated_modules

    defects = [f"model description: {problem}" for problem in validate_fmu(fmu)]
    if defects or fmpy.platform not in fmpy.supported_platforms(fmu):
        return defects
    description = fmpy.read_model_description(fmu)
    with tempfile.TemporaryDirectory(prefix="yawbench_") as folder, isolated_modules(*modules):
        fmpy.extract(fmu, folder)
        return _load(description, folder)


def _load(description: Any, folder: str) -> list[str]:
    from fmpy import instantiate_fmu

    messages: list[str] = []

    def log(environment: Any, name: bytes, status: int, category: bytes, message: bytes) -> None:
        if status >= 3:
            messages.append(message.decode(errors="replace"))

    wrong: list[str] = []
    try:
        modern = description.fmiVersion != "2.0"
        instance = instantiate_fmu(folder, description, "CoSimulation", logger=log)
        if not modern:
            instance.setupExperiment()
        convert: dict[str, Callable[[str], Any]] = {
            "Boolean": lambda text: text == "true",
            "String": str,
            "Real": float,
            "Float64": float,
        }
        names = {"Enumeration": "Int64" if modern else "Integer"}
        for v in description.modelVariables:
            if v.causality == "parameter":
                value = getattr(instance, f"get{names.get(v.type, v.type)}")([v.valueReference])[0]
                value = value.decode() if isinstance(value, bytes) else value
                if value != convert.get(v.type, int)(v.start):
                    wrong.append(f"parameter {v.name} is {value!r}, but {v.start} in its model description")
        instance.freeInstance()
    except Exception as error:
        return [f"does not load: {messages[0] if messages else error}"]
    return wrong + [f"logs when loaded: {message}" for message in messages[:1]]
