"""Reads one FMU as a scenario: that FMU alone, its inputs at their start values, over its experiment."""

from __future__ import annotations

import re
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from yawbench.fmus.fmu import Fmu

from ..signal_names import RESERVED
from .quantities import exact_text, instant, seconds
from .yaml_lines import Document

LACKS = "its default experiment has"
"""What messages say of a time that is not there."""
INTERVALS = 500
"""Communication steps of a run whose FMU names none. Chosen: what OpenModelica and FMPy take."""


def read(path: Path) -> Document:
    """Return the document of an FMU; times that its default experiment does not give are missing.

    Raises:
        ModelDescriptionError: the archive cannot be read, or its description cannot be used.
    """
    from yawbench.fmus.archive import open_fmu  # slow to import, and scenario files do not need it

    fmu = open_fmu(path, validate=False)  # the plan refuses what is wrong with it
    experiment = experiment_of(fmu)
    start = experiment.get("start_time", Fraction(0))
    stop, step = experiment.get("stop_time"), experiment.get("step_size")
    if stop is not None and stop > start:
        step = step or (stop - start) / INTERVALS
        experiment["stop_time"] = start + max(1, round((stop - start) / step)) * step
    if step is not None:
        experiment["step_size"] = step
    name = re.sub(r"\W", "_", path.stem, flags=re.ASCII)
    if not re.match("[A-Za-z_]", name) or name in RESERVED:
        name = f"fmu_{name}"
    data: dict[str, Any] = {
        "title": fmu.name,
        **{key: f"{exact_text(time)} s" for key, time in experiment.items()},
    }
    data["units"] = {name: {"fmu": str(path.absolute())}}
    return Document(path, data=data)


def experiment_of(fmu: Fmu) -> dict[str, Fraction]:
    """Return the times [s] of an FMU's default experiment, as keys of a scenario; a fixed step is first."""
    element = ElementTree.parse(fmu.directory / "modelDescription.xml").find("DefaultExperiment")
    stated: dict[str, Any] = {} if element is None else dict(element.attrib)
    stated |= {} if fmu.fixed_step is None else {"stepSize": repr(fmu.fixed_step)}
    times: dict[str, Fraction] = {}
    for key, attribute in (("start_time", "startTime"), ("stop_time", "stopTime"), ("step_size", "stepSize")):
        with suppress(ValueError):  # none, or not a time
            number = float(stated.get(attribute, "nan"))
            times[key] = (instant if key == "start_time" else seconds)(number)
    return times
