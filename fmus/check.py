"""Checks of newly built FMUs: valid model description, loading, parameter values, reference results.

FMUs are loaded in a separate process, shared by all FMUs of a build, because an FMU may crash its process or
change its state.
"""

from __future__ import annotations

import atexit
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

from yawbench.foundation.fork_server import die_with_parent, how_it_ended, python

_checker: subprocess.Popen[str] | None = None


def defects(fmu: Path, *modules: str) -> list[str]:
    """Return the defects of an FMU with the Python modules `modules`, empty if there are none.

    It is validated and loaded once; its parameters must have the values in its model description.
    """
    answer = _ask("defects", fmu, *modules)
    return [f"does not load: its process {answer}"] if isinstance(answer, str) else answer


def reference_files(fmu: Path, *modules: str) -> dict[str, str]:
    """Return an FMU's reference result as path in the archive -> text, empty if its run fails.

    The run fails, for instance, without a binary for this platform.
    """
    answer = _ask("reference_files", fmu, *modules)
    return {} if isinstance(answer, str) else answer


def _ask(what: str, *arguments: object) -> Any:
    """Return the answer to a request, or a text with the exit status if the process died."""
    global _checker
    if _checker is None or _checker.poll() is not None:
        _checker = subprocess.Popen(
            python(__name__), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        atexit.register(_end, _checker)
    try:
        print(json.dumps([what, *map(str, arguments)]), file=_checker.stdin, flush=True)
        answer = _checker.stdout.readline()  # type: ignore[union-attr]
    except BrokenPipeError:
        answer = ""
    return json.loads(answer) if answer else how_it_ended(_checker.wait())


def _end(checker: subprocess.Popen[str]) -> None:
    checker.kill()
    checker.communicate()


def main() -> None:
    """Answer requests until stdin is closed; output of FMUs goes to stderr."""
    die_with_parent()  # the pipe may not close: other processes may have inherited it
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends this process
    answers: IO[str] = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    answering = {"defects": _defects, "reference_files": _reference_files}
    for line in sys.stdin:
        what, *arguments = json.loads(line)
        print(json.dumps(answering[what](*arguments)), file=answers, flush=True)


def _reference_files(fmu: str, *modules: str) -> dict[str, str]:
    from .reference_result import reference_result
    from .staging import isolated_modules

    try:
        with isolated_modules(*modules):
            return reference_result(Path(fmu))
    except Exception:  # the FMU's own, or fmpy's
        return {}


def _defects(fmu: str, *modules: str) -> list[str]:
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
        instance = instantiate_fmu(folder, description, "CoSimulation", logger=log)
        instance.setupExperiment()
        getters: dict[str, tuple[Callable[..., Any], Callable[..., Any]]] = {
            "Real": (instance.getReal, float),
            "Integer": (instance.getInteger, int),
            "Boolean": (instance.getBoolean, lambda text: text == "true"),
            "String": (lambda vr: [text.decode() for text in instance.getString(vr)], str),
        }
        for v in description.modelVariables:
            if v.causality == "parameter":
                getter, convert = getters[v.type]
                value = getter([v.valueReference])[0]
                if value != convert(v.start):
                    wrong.append(f"parameter {v.name} is {value!r}, but {v.start} in its model description")
        instance.freeInstance()
    except Exception as error:
        return [f"does not load: {messages[0] if messages else error}"]
    return wrong + [f"logs when loaded: {message}" for message in messages[:1]]
