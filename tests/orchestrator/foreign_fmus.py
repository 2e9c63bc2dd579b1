"""FMUs in C from elsewhere: archives, scenarios of two of them, and the marks of tests of isolated runs."""

from __future__ import annotations

import zipfile

import fmpy
import pytest

INPUT, OUTPUT, ANSWER = 1000001, 4000000000, 7
STARTS = {"Real": "0", "Integer": "0", "Boolean": "false", "String": "", "Enumeration": "1"}
MODES = """
<TypeDefinitions><SimpleType name="Mode"><Enumeration>
  <Item name="dry" value="1"/><Item name="wet" value="2"/><Item name="ice" value="4"/>
</Enumeration></SimpleType></TypeDefinitions>"""

SCENARIO = """
title: Two strangers
stop_time: 0.5
step_size: 0.05
inputs: {constants}
units:
  a: {{fmu: ./foreign.fmu}}
  b: {{fmu: ./foreign.fmu, parameters: {{answer: {answer}}}{more}}}
{record}
connections:
{connections}
"""
KINDS = {"Real": 0.75, "Integer": -21, "Boolean": "true", "String": "größer"}

together_and_apart = pytest.mark.parametrize("isolate", [[], ["--isolate"]], ids=["together", "apart"])
mostly_together = pytest.mark.parametrize(
    "isolate", [[], pytest.param(["--isolate"], marks=pytest.mark.exhaustive)], ids=["together", "apart"]
)


def description(*kinds, guid, more=""):
    """Return a model description without optional capabilities, with large and sparse references."""
    variables = [
        f'<ScalarVariable name="answer" valueReference="{ANSWER}" causality="parameter"'
        ' variability="tunable"><Integer start="0" min="0" max="4"/></ScalarVariable>'
    ]
    for kind in kinds:
        change = "" if kind == "Real" else ' variability="discrete"'
        mode = ' declaredType="Mode"' if kind == "Enumeration" else ""
        variables += [
            f'<ScalarVariable name="{kind}_in" valueReference="{INPUT}" causality="input"{change}>'
            f'<{kind}{mode} start="{STARTS[kind]}"/></ScalarVariable>',
            f'<ScalarVariable name="{kind}_out" valueReference="{OUTPUT}" causality="output"{change}>'
            f"<{kind}{mode}/></ScalarVariable>",
        ]
    outputs = "".join(f'<Unknown index="{3 + 2 * i}" dependencies="{2 + 2 * i}"/>' for i in range(len(kinds)))
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<fmiModelDescription fmiVersion="2.0" modelName="foreign" guid="{guid}">'
        f'<CoSimulation modelIdentifier="foreign"/>{more}{MODES if "Enumeration" in kinds else ""}'
        f"<ModelVariables>{''.join(variables)}</ModelVariables>"
        f"<ModelStructure><Outputs>{outputs}</Outputs><InitialUnknowns>{outputs}</InitialUnknowns>"
        "</ModelStructure></fmiModelDescription>"
    )


def write_fmu(path, binary, *kinds, guid="{good}", change=lambda xml: xml):
    """Write an FMU with an input and an output of each kind; return its path."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", change(description(*kinds, guid=guid)))
        archive.write(binary, f"binaries/{fmpy.platform}/foreign.so")
    return path
