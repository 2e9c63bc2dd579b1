"""FMUs that declare a fixed step, run with that one and with others."""

from __future__ import annotations

import shlex
import sys
import zipfile
from pathlib import Path

import pytest

from tests.cars import load_scenario, make_plan
from tests.changed import changed
from tests.command_line import status_of
from tests.conftest import compiled
from tests.fmus.fake_fmus import make_fmu, model_description
from yawbench.fmus.description import binary_of
from yawbench.foundation.errors import Diagnostic
from yawbench.orchestrator.results.reader import load_results

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


SOURCE = """
#include <stdlib.h>
void* fmi2Instantiate(const char*n,int k,const char*g,const char*r,const void*c,int v,int l) {
  return calloc(1,8);
}
void fmi2FreeInstance(double*m){ free(m); }
int fmi2SetupExperiment(double*m,int a,double b,double c,int d,double e){ return 0; }
int fmi2EnterInitializationMode(double*m){ return 0; }
int fmi2ExitInitializationMode(double*m){ return 0; }
int fmi2Terminate(double*m){ return 0; }
int fmi2SetReal(double*m,const unsigned*r,size_t n,const double*v){ return 0; }
int fmi2GetReal(double*m,const unsigned*r,size_t n,double*v){ for(size_t i=0;i<n;i++) v[i]=*m; return 0; }
int fmi2DoStep(double*m,double t,double h,int x){ *m+=0.01*(int)(h/0.01+1e-9); return 0; }
"""


@pytest.mark.skipif(sys.platform != "linux", reason="compiles for Linux")
def test_check_and_run_warn_and_the_proposal_gives_the_right_numbers(tmp_path, capsys):
    (tmp_path / "g.c").write_text(SOURCE)
    fmi2(tmp_path)
    with zipfile.ZipFile(tmp_path / "g.fmu") as archive:
        xml = archive.read("modelDescription.xml")
    with zipfile.ZipFile(tmp_path / "g.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", xml)
        archive.write(compiled(tmp_path / "g.c", tmp_path / "g.so"), binary_of(2, "g"))
    (tmp_path / "s.yaml").write_text("stop_time: 0.1\nstep_size: 0.001\nunits: {one: {fmu: ./g.fmu}}\n")

    def command(*arguments: str) -> str:
        assert status_of(arguments[0], tmp_path / "s.yaml", *arguments[1:]) == 0
        return "".join(capsys.readouterr())

    assert "one.step_size=0.01" in command("check")
    out = tmp_path / "out"
    assert "one.step_size=0.01" in command("run", "--out", str(out))
    assert load_results(out)["one.y"][-1] == 0.0
    assert "declares" not in command("run", "--out", str(out), "--set", "one.step_size=0.01")
    assert load_results(out)["one.y"][-1] == pytest.approx(0.1)
