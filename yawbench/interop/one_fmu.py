"""One FMU of a scenario: its units, wires and values in a container FMU, by fmu-manipulation-toolbox.

The container steps all units with one step from the same exchanged values, as the algorithm `jacobi` does. It
has no gain, offset or delay on a wire, and reads texts without spaces only; a scenario that needs these is
refused, so no value is lost on the way. The outputs that the scenario records are its outputs, and the
parameters of its units its parameters, both named `instance.variable`; constants of inputs stay inside.
"""

from __future__ import annotations

import logging
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

from yawbench.fmus.archive import read_archive
from yawbench.fmus.fmu import Variable
from yawbench.foundation.errors import ResultsError
from yawbench.foundation.messages import fold, listed
from yawbench.foundation.safe_files import write_whole
from yawbench.orchestrator.plan import Instance, Plan
from yawbench.orchestrator.signal_names import SignalName

PACKAGE = "fmu-manipulation-toolbox"
INSIDE = "inside"
"""Begins the names of what is exchanged between the units, which are local variables of the container."""


def write_one_fmu(plan: Plan, path: Path, *, named: bool = False) -> list[str]:
    """Write a plan as one FMU of FMI 2.0 for co-simulation.

    Args:
        plan: the run; its algorithm is replaced by `jacobi`, and the steps of instances by that of all.
        path: of the FMU.
        named: as in `write_whole`.

    Returns:
        notes on what is different in it.

    Raises:
        ResultsError: the package is missing, the scenario cannot be expressed, or the FMU cannot be written.
        ModelDescriptionError: an FMU no longer exists.
    """
    try:
        from fmu_manipulation_toolbox.container import FMUContainer
    except ImportError:
        raise ResultsError(
            f"{path}: {PACKAGE} is not installed: pip install 'yawbench[interop]'", code="package-missing"
        ) from None
    if refused := list(_refused(plan)):
        sentences = [f"{path}: this FMU cannot contain {what}" for what in refused]
        raise ResultsError(sentences, code="container-unsupported")
    logging.getLogger("fmu_manipulation_toolbox").setLevel(logging.CRITICAL)  # it names every port
    with tempfile.TemporaryDirectory(prefix="yawbench-") as folder:
        container = FMUContainer(re.sub(r"\W", "_", path.stem), folder)
        files = {instance.name: f"{INSIDE}.{instance.name}.fmu" for instance in plan.instances}
        for instance in plan.instances:
            Path(folder, files[instance.name]).write_bytes(read_archive(instance.fmu.path))
            container.get_fmu(files[instance.name])
            for name, value in _values(instance).items():
                container.add_start_value(files[instance.name], name, value)
            for parameter in _parameters(instance):
                exposed = f"{instance.name}.{parameter.name}"
                container.add_input(exposed, files[instance.name], parameter.name)
        for wire in plan.wires:
            container.add_link(files[wire.source], wire.output, files[wire.target], wire.input)
        for signal in _outputs(plan):
            container.add_output(files[signal.instance], signal.variable, str(signal))
        container.start_time, container.stop_time = plan.time(0), plan.time(plan.n_steps)
        container.make_fmu(path.name, float(plan.step))
        try:
            write_whole(path, Path(folder, path.name).read_bytes(), named=named)
        except OSError as error:
            raise ResultsError(
                f"{path}: cannot write this FMU: {error.strerror or error}", code="results-unwritable"
            ) from None
    return list(_notes(plan))


def _refused(plan: Plan) -> Iterator[str]:
    """Yield what a plan has that a container cannot express."""
    if ends := [f"{wire.target}.{wire.input}" for wire in plan.wires if wire.delayed]:
        yield f"the delay of {listed(fold(ends))}"
    if ends := [f"{w.source}.{w.output} to {w.target}.{w.input}" for w in plan.wires if w.converts]:
        yield f"the conversion, gain or offset from {listed(ends)}"
    if series := [f"{instance.name}.{name}" for instance in plan.instances for name in instance.series]:
        yield f"the time series of {listed(fold(series))}"
    if newer := [instance.name for instance in plan.instances if instance.fmu.fmi > 2]:
        yield f"FMUs of FMI 3.0, as that of {listed(newer)}"
    for instance in plan.instances:
        for name, text in _values(instance).items():
            if instance.fmu.variables[name].ref.type == "String" and len(text.split()) != 1:
                yield f"the text of {instance.name}.{name}, which is empty or has spaces"


def _values(instance: Instance) -> dict[str, str]:
    """Return the values of an instance as the container's file has them, without texts of the FMU's own."""
    values = {}
    for name, value in {**instance.parameters, **instance.constants}.items():
        variable = instance.fmu.variables[name]
        if variable.ref.type != "String" or value != variable.start:
            encoded = variable.encoded(value)
            values[name] = str(encoded).lower() if isinstance(encoded, bool) else str(encoded)
    return values


def _parameters(instance: Instance) -> list[Variable]:
    """Return the parameters of an instance that the container has; texts stay as they are."""
    return [v for v in instance.fmu.of("parameter") if v.ref.type != "String"]


def _outputs(plan: Plan) -> list[SignalName]:
    """Return the recorded outputs, which are those of the container."""
    of = {instance.name: instance.fmu.variables for instance in plan.instances}
    return [name for name in plan.record if of[name.instance][name.variable].causality == "output"]


def _notes(plan: Plan) -> Iterator[str]:
    """Yield what is different in the container."""
    if plan.algorithm != "jacobi":
        yield f"the units are coupled by jacobi instead of {plan.algorithm}"
    if slow := [instance.name for instance in plan.instances if instance.period > 1]:
        yield f"there is one step for all units: the steps of {listed(slow)} are omitted"
    if others := [str(name) for name in plan.record if name not in _outputs(plan)]:
        yield f"only outputs are outputs of the FMU: {listed(fold(others))} are omitted"
    if plan.start:
        yield f"hosts have to begin at {plan.time(0):.9g} s, as its default experiment does"
