"""An FMU of anybody is shown, checked, run alone and drawn; what it says is heard."""

from __future__ import annotations

import sys
import zipfile

import pytest

from tests.command_line import status_of
from tests.orchestrator.foreign_fmus import mostly_together, write_fmu
from tests.refusals import each_mentions, mentions
from yawbench.orchestrator.results.reader import load_results

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="compiles for Linux")
EXPERIMENT = '<DefaultExperiment startTime="1" stopTime="3" stepSize="0.25"/><ModelVariables>'

TIMES = "stop_time: 1\nstep_size: 0.5\n"


@pytest.fixture
def alone(library, tmp_path, capsys, monkeypatch):
    """Write an FMU and call a command with it, which ends with this status; return all that was printed."""
    monkeypatch.chdir(tmp_path)

    def call(command, *more, status=0, experiment=EXPERIMENT, guid="{good}"):
        write_fmu(
            tmp_path / "other.fmu", library, "Real", "Integer", guid=guid,
            change=lambda xml: xml.replace("<ModelVariables>", experiment),
        )  # fmt: skip
        given = status_of(command, "other.fmu", *more)
        printed = "".join(capsys.readouterr())
        assert given == status, printed
        return printed

    return call


def test_it_runs_over_its_default_experiment_with_its_start_values(alone, tmp_path):
    alone("run", "--out", "out")
    results = load_results(tmp_path / "out")
    assert results.time.tolist() == [1.0 + 0.25 * k for k in range(9)]
    constants = results.record.fmus["other"].constants
    assert set(results["other.Real_out"]) == {2.0 * float(constants["Real_in"])}
    assert set(results["other.Integer_out"]) == {2 * int(constants["Integer_in"])}
    alone("run", "--out", "out", "--set", "inputs.Real_in=0.5", "--set", "stop_time=1.5")
    results = load_results(tmp_path / "out")
    assert (results.time[-1], results["other.Real_out"][-1]) == (1.5, 1.0)


@pytest.mark.parametrize(("stated", "step"), [('stopTime="3"', 0.006), ('stopTime="3" stepSize="0.7"', 0.7)])
def test_what_the_default_experiment_leaves_open(alone, tmp_path, stated, step):
    alone("run", "--out", "out", experiment=f"<DefaultExperiment {stated}/><ModelVariables>")
    times = load_results(tmp_path / "out").time
    assert (times[1], times[-1]) == (step, round(3 / step) * step)


def test_without_a_stop_time_it_asks_for_what_it_needs(alone):
    said = alone("run", status=2, experiment="<DefaultExperiment/><ModelVariables>")
    assert each_mentions(said, ("other.fmu", "--set stop_time="), ("other.fmu", "--set step_size="))


def test_it_is_shown_checked_and_drawn(alone, tmp_path):
    shown = alone("show")
    for line in (("Real_in", "input", "Real"), ("Integer_out", "output", "Integer"), ("answer", "0 to 4")):
        assert mentions(shown, *line)
    assert mentions(shown, "stop time", "3 s")
    assert "Wired by" not in shown
    assert mentions(alone("check"), "2 s", "8 steps", "250 ms")
    alone("plot")
    assert [*(tmp_path / "results").glob("**/overview.svg")]


def test_show_names_the_inputs_that_would_stay_unconnected_and_what_becomes_of_them(
    library, tmp_path, capsys
):
    def shown(name="other.fmu", **change):
        write_fmu(tmp_path / name, library, "Real", "Boolean", **change)
        assert status_of("show", tmp_path / name) == 0
        return capsys.readouterr().out.partition("Wired to nothing")[2].partition("\n\nThey")[0]

    foreign = shown(change=lambda xml: xml.replace('<Real start="0"', '<Real unit="K" start="0.75"'))
    assert mentions(foreign, "Real_in", "K", "start value, 0.75")
    assert mentions(foreign, "Boolean_in", "start value")
    assert not any("Real_out" in line for line in foreign.splitlines())
    assert mentions(shown("controller_other.fmu"), "Real_in", "refused")
    resembling = shown(change=lambda xml: xml.replace('"Real_in"', '"YawRateIn"').replace(
        '<Real start', '<Real unit="rad/s" start'
    ))  # fmt: skip
    assert not any("YawRateIn" in line for line in resembling.splitlines())


def test_show_says_why_an_fmu_cannot_run_here(library, tmp_path, capsys):
    path = write_fmu(tmp_path / "other.fmu", library, "Real")
    with zipfile.ZipFile(path) as archive:
        description = archive.read("modelDescription.xml").decode()
    wired = description.replace('name="Real_in"', 'name="steer_angle"').replace(
        "<Real start", '<Real unit="deg" start'
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", wired.replace('"Real_out"', '"YawRateOut"'))
        archive.write(library, "binaries/win64/foreign.dll")
    assert status_of("show", path) == 0
    out = capsys.readouterr().out
    assert mentions(out, "note", "binaries/linux64/foreign.so", "win64")
    assert mentions(out, "steer_angle", "input", "driver")
    assert status_of("show", tmp_path / "none.fmu") == 2
    (tmp_path / "text.fmu").write_text("no archive")
    assert status_of("show", tmp_path / "text.fmu") == 2


def test_an_unconnected_input_of_a_foreign_fmu_keeps_its_start_value_and_a_note_says_so(
    library, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    start = {"change": lambda xml: xml.replace('<Real start="0"', '<Real start="0.75"')}
    write_fmu(tmp_path / "other.fmu", library, "Real", **start)
    (tmp_path / "one.yaml").write_text(f"{TIMES}units: {{a: {{fmu: ./other.fmu}}}}\n")
    assert status_of("run", "one.yaml", "--out", "out") == 0
    assert mentions(capsys.readouterr().err, "note", "a", "Real_in = 0.75", "start value")
    assert set(load_results(tmp_path / "out")["a.Real_out"]) == {1.5}


def test_an_input_that_an_output_resembles_is_an_error(library, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_fmu(tmp_path / "a.fmu", library, "Real", change=lambda xml: xml.replace("Real_out", "yaw_rate"))
    write_fmu(tmp_path / "b.fmu", library, "Real", change=lambda xml: xml.replace("Real_in", "YawRate"))
    (tmp_path / "two.yaml").write_text(f"{TIMES}units: {{a: {{fmu: ./a.fmu}}, b: {{fmu: ./b.fmu}}}}\n")
    assert status_of("run", "two.yaml", "--out", "out") == 2
    assert mentions(capsys.readouterr().err, "b.YawRate", "a.yaw_rate")


@mostly_together
def test_log_shows_levels_and_categories(alone, isolate):
    def said(level, **keys):
        return alone("run", "--out", "o", "--log", level, *isolate, guid="{chatty}", **keys)

    everything = said("info")
    assert everything.count("OK: other at t = ") == 8
    assert mentions(everything, "t = 1.25 s", "[steps]", "at 1.25")
    assert "OK:" not in said("warning")
    assert "OK:" not in said("info:other")
    assert "OK:" in said("info:steps")
    assert mentions(said("loud", status=2), "--log loud", "error", "warning", "info")
