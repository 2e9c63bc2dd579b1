"""`yawbench show`: what an FMU is, what would be wired to it, and what this master does not do with it."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from xml.etree import ElementTree

import typer

from yawbench.commands import json_and_latex
from yawbench.foundation.errors import Diagnostic, ModelDescriptionError
from yawbench.foundation.messages import fold, listed, printable

from .json_and_latex import tabular
from .options import RunOptions, takes
from .output import print_tables

if TYPE_CHECKING:
    from yawbench.fmus.fmu import Fmu, Variable
    from yawbench.studies.tables import Cell, Table

Shown = Annotated[str, typer.Argument(help="FMU: path of an archive, or a name in fmus/.", metavar="FMU")]
CAPABILITIES = {
    "canHandleVariableCommunicationStepSize": "steps of any length",
    "fixedInternalStepSize": "fixed internal step",
    "canGetAndSetFMUState": "state saved and restored",
    "canSerializeFMUState": "state written to a file",
    "canInterpolateInputs": "interpolates inputs (set at the beginning of a step here)",
    "maxOutputDerivativeOrder": "derivatives of outputs (not read here)",
    "providesDirectionalDerivatives": "directional derivatives (not used here)",
    "canRunAsynchronuously": "asynchronous steps (not used here)",
    "hasEventMode": "event mode",
    "canReturnEarlyAfterIntermediateUpdate": "early return",
    "canBeInstantiatedOnlyOncePerProcess": "one instance per process",
    "needsExecutionTool": "needs the tool that exported it",
}
"""Attribute of FMI 2.0 and 3.0 -> its words."""
FORMER = {"canGetAndSetFMUState": "canGetAndSetFMUstate", "canSerializeFMUState": "canSerializeFMUstate"}
"""Attribute -> its name in FMI 2.0, where it differs."""
_OF_WHEEL = re.compile(r", (front|rear) (left|right)$")
"""What the descriptions of a signal of four wheels differ by."""
CAUSALITIES = (
    "input", "output", "parameter", "structuralParameter", "calculatedParameter", "local", "independent"
)  # fmt: skip


@tabular
@takes("fmus", "no_build")
def show(fmu: Shown, options: RunOptions) -> None:
    """Show an FMU: its variables, capabilities and times, and what would be wired to it.

    Inputs and outputs that the signals of this bench fit are listed with the roles at the other end. Says
    what this master does not do with the FMU. `yawbench run X.fmu` runs it alone, its inputs at their start
    values.
    """
    opened, problems = _opened(fmu, options)
    root = ElementTree.fromstring(_description(opened))
    tables = [_about(opened, root), _capabilities(opened, root), _variables(opened), *_wiring(opened)]
    notes = [*problems, *opened.violations]
    limits = [f"{name} {why}" for name, why in opened.refused.items()]
    if opened.lacking:
        limits.append(f"its library does not export {listed(opened.lacking)}")
    json_and_latex.note(notes)
    print_tables(table for table in tables if table.rows)
    for line in [*map(str, notes), *limits]:
        if json_and_latex.form() == "text":
            print(printable(f"not done here: {line}" if line in limits else f"note: {line}"))


def _opened(name: str, options: RunOptions) -> tuple[Fmu, Sequence[Diagnostic]]:
    """Return an FMU, and why it cannot be run.

    Raises:
        ModelDescriptionError: its description cannot be read.
    """
    from yawbench.fmus.description import describe
    from yawbench.fmus.fmu import is_path
    from yawbench.fmus.opener import Opener, find_fmu, find_folder
    from yawbench.fmus.zip_members import members

    opener = Opener(build=options.build)
    here = Path("here")
    if is_path(name):
        path = opener.bring(Path(name).absolute())
    else:
        folder = options.fmus or find_folder(here, opener=opener)
        path = find_fmu(name, scenario=here, fmus=folder, opener=opener)
    try:
        return opener.open(path, validate=False), ()
    except ModelDescriptionError as problem:
        try:  # one for another platform can be shown
            raw = path.read_bytes()
            with zipfile.ZipFile(io.BytesIO(raw)) as archive:
                files = {member: archive.read(info) for member, info in members(archive).items()}
            return describe(files, raw, path), problem.diagnostics
        except (ModelDescriptionError, OSError, ValueError, zipfile.BadZipFile):
            raise problem from None


def _description(fmu: Fmu) -> bytes:
    if fmu.directory != fmu.path:
        return (fmu.directory / "modelDescription.xml").read_bytes()
    with zipfile.ZipFile(fmu.path) as archive:
        return archive.read("modelDescription.xml")


def _about(fmu: Fmu, root: ElementTree.Element) -> Table:
    from yawbench.studies.tables import Table

    stated = [
        ("FMI", f"{root.get('fmiVersion')}, co-simulation"), ("model", root.get("modelName", "")),
        ("description", fmu.description), ("made by", fmu.generation_tool),
        ("author", root.get("author", "")), ("version", root.get("version", "")), ("role", fmu.role),
    ]  # fmt: skip
    experiment = root.find("DefaultExperiment")
    times = {} if experiment is None else experiment.attrib
    words = {"startTime": "start time", "stopTime": "stop time", "stepSize": "step", "tolerance": "tolerance"}
    stated += [
        (word, times[key] if key == "tolerance" else f"{times[key]} s")
        for key, word in words.items()
        if key in times
    ]
    categories = [e.get("name", "") for e in root.iterfind("LogCategories/Category")]
    stated.append(("log categories", ", ".join(categories)))
    return Table(str(fmu.path), ["", "as stated"], [row for row in stated if row[1]])


def _capabilities(fmu: Fmu, root: ElementTree.Element) -> Table:
    from yawbench.studies.tables import Table

    kind = root.find("CoSimulation")
    stated = {} if kind is None else kind.attrib
    rows = []
    for name, words in CAPABILITIES.items():
        value = stated.get(name) or stated.get(FORMER.get(name, ""))
        if value not in (None, "false", "0"):
            rows.append((words, {"true": "yes", "1": "yes"}.get(str(value), str(value))))
    return Table("Capabilities", ["", "as stated"], rows)


def _variables(fmu: Fmu) -> Table:
    from yawbench.studies.tables import Table

    headings = ["name", "causality", "type", "unit", "start", "range", "description"]
    rows: list[Sequence[Cell]] = []
    for causality in CAUSALITIES:
        alike: dict[tuple[str, ...], list[str]] = {}
        for variable in fmu.of(causality):
            cells = (
                causality, variable.fmi_type, variable.unit or "", _text(variable.start), _range(variable),
                _OF_WHEEL.sub("", variable.description),
            )  # fmt: skip
            alike.setdefault(cells, []).append(variable.name)
        rows += [(name, *cells) for cells, names in alike.items() for name in fold(names)]
    return Table("Variables", headings, rows)


def _text(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else "" if value is None else str(value)


def _range(variable: Variable) -> str:
    if variable.items or variable.choices:
        return ", ".join(variable.items or variable.choices or ())
    ends = [_text(end) for end in (variable.minimum, variable.maximum)]
    return " to ".join(end or "…" for end in ends) if any(ends) else ""


def _wiring(fmu: Fmu) -> Iterator[Table]:
    """Yield what equal names would connect, what a connection could, and which inputs nothing here does."""
    from yawbench.orchestrator.wiring.connections import conversion_between
    from yawbench.studies.tables import Table
    from yawbench.vocabulary.signals import SIGNALS

    equal: dict[tuple[str, str, str], list[str]] = {}
    near: dict[tuple[str, str], list[str]] = {}
    alone: dict[tuple[str, str], list[str]] = {}
    for variable in (*fmu.of("input"), *fmu.of("output")):
        number = variable.type in ("Real", "Integer")
        name = _signal(variable.name)
        if number and name in SIGNALS:
            scale = conversion_between(_as_signal(variable, name), variable)
            how = "units differ: refused" if scale is None else ""
            if scale not in (None, (1.0, 0.0)):
                how = f"converted, {SIGNALS[name].unit} and {variable.unit}"
            ends = _ends(name, variable.causality)
            if ends:
                equal.setdefault((variable.causality, ends, how), []).append(variable.name)
        elif guess := _alike(variable) if number else "":
            near.setdefault((variable.causality, guess), []).append(variable.name)
        elif variable.causality == "input":
            alone.setdefault(_unconnected(fmu, variable), []).append(variable.name)
    rows = [(name, *cells) for cells, names in equal.items() for name in fold(names)]
    yield Table("Wired by equal names", ["name", "causality", "to instances of the roles", "remark"], rows)
    others = [(name, *cells) for cells, names in near.items() for name in fold(names)]
    yield Table(
        "Wired by a connection alone", ["name", "causality", "signals that it resembles"], others,
        ["Name one under 'connections' of the scenario if it is meant."],
    )  # fmt: skip
    yield Table(
        "Wired to nothing of this bench", ["input", "unit", "without a source"],
        [(name, *cells) for cells, names in alone.items() for name in fold(names)],
        ["They resemble no signal: an output of the same name, 'connections' or 'inputs' of the scenario "
         "reach them."],
    )  # fmt: skip


def _unconnected(fmu: Fmu, variable: Variable) -> tuple[str, str]:
    """Return the unit of an input, and what becomes of it where it has no source."""
    from yawbench.vocabulary.roles import role_in

    may = variable.optional or not (fmu.role or role_in(fmu.name))
    stays = f"stays at its start value, {_text(variable.start)}"
    return variable.unit or "", stays if may and variable.start is not None else "refused: needs one"


def _signal(name: str) -> str:
    """Return a variable's name as the dictionary of signals has it, that of a wheel with a *."""
    from yawbench.vocabulary.wheels import WHEELS

    stem, _, wheel = name.rpartition("_")
    return f"{stem}_*" if wheel in WHEELS else name


def _as_signal(variable: Variable, signal: str) -> Variable:
    """Return a variable with the unit that the dictionary gives a signal."""
    from dataclasses import replace

    from yawbench.vocabulary.signals import SIGNALS

    return replace(variable, unit=SIGNALS[signal].unit, definition=None, relative=False)


def _ends(signal: str, causality: str) -> str:
    """Return the roles of which every FMU has the other end of a signal."""
    from yawbench.vocabulary.roles import ROLES

    having = [
        role.name for role in ROLES.values()
        if signal in (role.outputs if causality == "input" else role.inputs)
    ]  # fmt: skip
    return ", ".join(having) or ("any that has it" if causality == "input" else "any that takes it")


def _alike(variable: Variable) -> str:
    """Return the signals of this bench that a variable resembles most, "" if none."""
    from yawbench.orchestrator.signal_names import alike
    from yawbench.orchestrator.wiring.connections import conversion_between
    from yawbench.vocabulary.signals import SIGNALS, SYMBOLS

    shared = {
        name: alike(name, variable.name, SYMBOLS)
        for name in SIGNALS
        if conversion_between(_as_signal(variable, name), variable) is not None
    }
    most = max(shared.values(), default=0)
    best: Iterable[str] = [name for name, words in shared.items() if words == most > 0]
    return ", ".join([*best][:3])
