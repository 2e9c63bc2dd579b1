"""FMUs that declare a fixed step, run with that one and with others."""

from __future__ import annotations

import shlex
import zipfile
from pathlib import Path

import pytest

from tests.cars import load_scenario, make_plan
from tests.changed import changed
from tests.command_line import status_of
from tests.fmus.fake_fmus import make_fmu, model_description
from tests.refusals import mentions
from yawbench.fmus.description import binary_of
from yawbench.foundation.errors import Diagnostic

pytestmark = pytest.mark.usefixtures("common_cache")

PLAIN = "<CoSimulation "


def fmi2(folder: Path, attributes: str = "", experiment: str = 'stepSize="0.01"') -> None:
    xml = model_description("g", outputs=["y"]).replace(PLAIN, f"{PLAIN}{attributes} ")
    make_fmu(
        folder / "g.fmu",
        xml=xml.replace("<ModelVariables>", f"<DefaultExperiment {experiment}/><ModelVariables>"),
    )


def fmi3(folder: Path, attributes: str = "", experiment: str = "") -> None:
    xml = (
        '<fmiModelDescription fmiVersion="3.0" modelName="g" instantiationToken="g">'
        f'<CoSimulation modelIdentifier="g" {attributes}/><DefaultExperiment {experiment}/>'
        '<ModelVariables><Float64 name="time" valueReference="0" causality="independent"/>'
        '<Float64 name="y" valueReference="1" causality="output"/></ModelVariables><ModelStructure>'
        '<Output valueReference="1"/><InitialUnknown valueReference="1"/></ModelStructure>'
        "</fmiModelDescription>"
    )
    with zipfile.ZipFile(folder / "g.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", xml)
        archive.writestr(binary_of(3, "g"), b"")


def said(folder: Path, *settings: str, step: str = "0.001", own: str = "") -> list[Diagnostic]:
    """Return the warnings about the step of the only instance."""
    more = f", step_size: {own}" if own else ""
    (folder / "s.yaml").write_text(
        f"stop_time: 0.6\nstep_size: {step}\nunits: {{one: {{fmu: ./g.fmu{more}}}}}\n"
    )
    plan = make_plan(load_scenario(folder / "s.yaml", changes=changed(settings=settings)))
    return [d for d in plan.diagnostics if d.code == "instance-step-differs"]


PARTICULAR = 'canHandleVariableCommunicationStepSize="false"'


@pytest.mark.parametrize("attributes", ["", PARTICULAR])
def test_another_step_than_an_fmu_declares_is_a_warning_with_both(attributes, tmp_path):
    fmi2(tmp_path, attributes)
    (warning,) = said(tmp_path)
    assert (warning.severity, warning.location.signal, warning.value) == ("warning", "one.step_size", 0.001)
    assert "0.001 s" in warning.message
    assert "0.01 s" in warning.message


@pytest.mark.parametrize(
    ("write", "attributes", "experiment", "step", "own"),
    [
        (fmi2, PARTICULAR.replace("false", "true"), 'stepSize="0.01"', "0.001", ""),
        (fmi2, "", 'stopTime="1"', "0.001", ""),
        (fmi2, "", 'stepSize="0.01"', "1/100", ""),
        (fmi2, "", 'stepSize="0.01"', "0.005", "10 ms"),
        (fmi2, "", 'stepSize="0.0333333333"', "1/30", ""),  # rounded in the description
        (fmi3, "", 'stepSize="0.01"', "0.01", ""),
        (fmi3, 'fixedInternalStepSize="1e-2"', "", "0.01", ""),
        (fmi3, 'fixedInternalStepSize="1e-2"', "", "0.1", ""),
    ],
)
def test_a_step_that_an_fmu_takes_is_no_warning(write, attributes, experiment, step, own, tmp_path):
    write(tmp_path, attributes, experiment)
    assert not said(tmp_path, step=step, own=own)


@pytest.mark.parametrize(
    ("step", "own"),
    [("0.001", ""), ("0.02", ""), ("0.004", ""), ("0.002", "0.004"), ("0.03", "0.06"), ("0.002", "0.02")],
)
def test_what_the_warning_proposes_gives_the_declared_step(step, own, tmp_path):
    fmi2(tmp_path)
    (warning,) = said(tmp_path, step=step, own=own)
    proposed = shlex.split(warning.message.partition("'")[2].partition("'")[0])
    assert proposed[::2] == ["--set"] * (len(proposed) // 2)
    assert not said(tmp_path, *proposed[1::2], step=step, own=own)


@pytest.mark.parametrize(
    ("write", "attributes", "experiment", "step", "named"),
    [
        (fmi2, "", 'stepSize="0.0123457"', "0.001", "0.0123457 s"),
        (fmi3, "", 'stepSize="0.01"', "0.001", "0.01 s"),
        (fmi3, 'fixedInternalStepSize="0.01"', "", "0.015", "0.01 s"),
        (fmi3, f'fixedInternalStepSize="0.01" {PARTICULAR}', "", "0.005", "0.01 s"),
    ],
)
def test_another_step_is_a_warning_too(write, attributes, experiment, step, named, tmp_path):
    write(tmp_path, attributes, experiment)
    (warning,) = said(tmp_path, step=step)
    assert named in warning.message
    assert f"{step} s" in warning.message


def test_check_says_what_to_set(tmp_path, capsys):
    fmi2(tmp_path)
    assert said(tmp_path)
    assert status_of("check", tmp_path / "s.yaml") == 0
    assert mentions(capsys.readouterr().err, "note", "0.001 s", "one.step_size=0.01")
