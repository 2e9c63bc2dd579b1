"""Model descriptions of the FMUs that `models3.c` makes, and their archives."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path

from fmpy.fmi3 import FMU3Slave

from yawbench.fmus.description import INTEGERS, binary_of

HERE = Path(__file__).parent
TYPES = ("Float64", "Float32", *INTEGERS, "Boolean")
"""In the order of the value references: an input, then its output, from 1 on."""


def stubs() -> str:
    """Return C code of the functions that fmpy wants to exist and `models3.c` does not have."""
    source = (HERE / "models3.c").read_text(encoding="utf-8")
    written = set(re.findall(r"\bfmi3(\w+)\(", source)) | set(re.findall(r"ALWAYS_OK\((\w+)\)", source))
    written |= {f"{verb}{kind}" for verb in ("Set", "Get") for kind in (*TYPES, "String")}
    wanted = {name.removeprefix("fmi3") for name in dir(FMU3Slave) if name.startswith("fmi3")}
    return "".join(f"int fmi3{name}(void) {{ return 3; }}\n" for name in sorted(wanted - written))


def variable(
    kind: str, name: str, reference: int, causality: str, inner: str = "", **attributes: object
) -> str:
    """Return the element of a variable."""
    more = "".join(f' {key}="{value}"' for key, value in attributes.items())
    return (
        f'<{kind} name="{name}" valueReference="{reference}" causality="{causality}"{more}>{inner}</{kind}>'
    )


def pair(kind: str, reference: int) -> list[str]:
    """Return the input and the output of one type."""
    if kind == "String":
        given = variable(kind, f"{kind}_in", reference, "input", '<Start value="none"/>')
    else:
        alias = '<Alias name="x"/>' if kind == "Float64" else ""
        start = "false" if kind == "Boolean" else 0
        given = variable(kind, f"{kind}_in", reference, "input", alias, start=start)
    return [given, variable(kind, f"{kind}_out", reference + 1, "output")]


def _state(name: str, reference: int, start: float) -> str:
    return variable("Float64", name, reference, "output", start=start, initial="exact")


def _parameter(name: str, reference: int, start: float, **attributes: object) -> str:
    return variable("Float64", name, reference, "parameter", start=start, **attributes)


_VECTOR = '<Dimension start="2"/>'
_SIZED = '<Dimension valueReference="40"/>'
_EVERY = [one for i, kind in enumerate(TYPES) for one in pair(kind, 1 + 2 * i)]
MODELS: dict[str, list[str]] = {
    "Dahlquist": [_state("x", 31, 1), _parameter("k", 33, 1, unit="1/s")],
    "VanDerPol": [_state("x0", 31, 2), _state("x1", 32, 0), _parameter("mu", 33, 1)],
    "BouncingBall": [
        _state("h", 31, 1),
        _state("v", 32, 0),
        _parameter("g", 33, -9.81),
        _parameter("e", 34, 0.7),
    ],
    "Stair": [variable("Int32", "counter", 35, "output")],
    "Every": [
        *_EVERY,
        *pair("String", 23),
        variable("Enumeration", "mode_in", 25, "input", declaredType="Mode", start=1),
        variable("Enumeration", "mode_out", 26, "output", declaredType="Mode"),
        variable("Binary", "raw", 27, "input", '<Start value="00"/>'),
        '<Clock name="tick" valueReference="28" causality="input" intervalVariability="triggered"/>',
        variable("Float64", "ticked", 29, "local", clocks=28),
    ],
    "Matrix": [
        variable("UInt64", "n", 40, "structuralParameter", start=2),
        variable("Float64", "A", 41, "parameter", _SIZED + _SIZED, start="1 0 0 1"),
        variable("Float64", "u", 42, "input", _VECTOR + '<Alias name="force"/>', start="0 0"),
        variable("Float64", "y", 43, "output", _SIZED + '<Alias name="result"/>'),
    ],
    "Sized": [
        variable("UInt64", "m", 50, "structuralParameter", start=3, min=1),
        variable("Float64", "v", 51, "input", '<Dimension valueReference="50"/>', start="1 2 3"),
        variable("Float64", "w", 52, "output", '<Dimension valueReference="50"/>'),
        variable("Float64", "k", 53, "parameter", start=1, variability="tunable"),
    ],
    "Early": [_state("x", 31, 1), _state("gone", 32, 0)],
    "Stuck": [_state("x", 31, 1)],
    "Deaf": [_state("x", 31, 1), _parameter("k", 33, 1, unit="1/s")],
    "Refusing": [_state("x", 31, 1)],
}
"""Model -> its variables."""
FOLLOWS = {52: "51", 43: "42", 26: "25", 24: "23"} | {2 + 2 * i: str(1 + 2 * i) for i in range(len(TYPES))}
"""Reference of an output -> those of the inputs that it follows."""


def description(model: str, interface: str = "CoSimulation") -> str:
    """Return a model description of FMI 3.0."""
    outputs = [
        int(r) for v in MODELS[model] for r in re.findall(r'valueReference="(\d+)" causality="output"', v)
    ]
    calculated = [r for r in outputs if r not in (31, 32)]
    unknowns = "".join(f'<Output valueReference="{r}" dependencies="{FOLLOWS.get(r, "")}"/>' for r in outputs)
    unknowns += "".join(f'<InitialUnknown valueReference="{r}"/>' for r in calculated)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<fmiModelDescription fmiVersion="3.0" modelName="{model}" instantiationToken="{model}">'
        f'<{interface} modelIdentifier="models3"/>'
        '<UnitDefinitions><Unit name="1/s"><BaseUnit s="-1"/></Unit></UnitDefinitions>'
        '<TypeDefinitions><EnumerationType name="Mode"><Item name="dry" value="1"/>'
        '<Item name="wet" value="4"/></EnumerationType></TypeDefinitions>'
        '<DefaultExperiment tolerance="1e-5"/>'
        '<ModelVariables><Float64 name="time" valueReference="0" causality="independent"'
        f' variability="continuous"/>{"".join(MODELS[model])}</ModelVariables>'
        f"<ModelStructure>{unknowns}</ModelStructure></fmiModelDescription>"
    )


def make_fmu(folder: Path, model: str, library: Path, **options: str) -> Path:
    """Write the FMU of a model."""
    path = folder / f"{model}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description(model, **options))
        archive.writestr("resources/about.txt", model)
        archive.write(library, binary_of(3, "models3"))
    return path
