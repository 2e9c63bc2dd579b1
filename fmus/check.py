"""Is an FMU that has just been built right: its model description, and does it load?"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.model_description import ModelDescription
from fmpy.validation import validate_fmu

from .staging import apart


def defects(fmu: Path, *modules: str) -> list[str]:
    """Return what is wrong with an FMU whose Python modules are called `modules`; best is nothing.

    It is validated, loaded once, and its parameters must have the values that its model
    description says.
    """
    found = [f"model description: {problem}" for problem in validate_fmu(str(fmu))]
    if found or fmpy.platform not in fmpy.supported_platforms(str(fmu)):
        return found
    description = fmpy.read_model_description(str(fmu))
    with tempfile.TemporaryDirectory(prefix="yawbench_") as folder, apart(*modules):
        fmpy.extract(str(fmu), folder)
        return _load(description, folder)


def _load(description: ModelDescription, folder: str) -> list[str]:
    messages: list[str] = []

    def log(environment: Any, name: bytes, status: int, category: bytes, message: bytes) -> None:
        if status >= 3:
            messages.append(message.decode(errors="replace").replace("%%", "%"))

    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(log)
    wrong: list[str] = []
    try:
        unit = FMU2Slave(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=description.modelName,
        )
        unit.instantiate(callbacks=callbacks)
        unit.setupExperiment()
        getters: dict[str, tuple[Callable, Callable]] = {
            "Real": (unit.getReal, float),
            "Integer": (unit.getInteger, int),
            "Boolean": (unit.getBoolean, lambda text: text == "true"),
            "String": (lambda vr: [text.decode() for text in unit.getString(vr)], str),
        }
        for v in description.modelVariables:
            if v.causality == "parameter":
                getter, convert = getters[v.type]
                value = getter([v.valueReference])[0]
                if value != convert(v.start):
                    wrong.append(f"parameter {v.name} is {value!r}, its model description says {v.start}")
        unit.freeInstance()
    except Exception as error:
        return [f"does not load: {messages[0] if messages else error}"]
    return wrong + [f"logs when loaded: {message}" for message in messages[:1]]
