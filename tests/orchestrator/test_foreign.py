"""FMUs in C from elsewhere, from the archive through the command line to the results, also isolated."""

from __future__ import annotations

import sys
import zipfile

import fmpy
import pytest

from tests.cars import load_scenario, make_plan
from tests.command_line import status_of
from tests.refusals import mentions
from yawbench.cli import main
from yawbench.metrics.expressions import evaluate, metric
from yawbench.orchestrator.master import child_run
from yawbench.orchestrator.results.freshness import staleness
from yawbench.orchestrator.results.reader import load_results

INPUT, OUTPUT, ANSWER = 1000001, 4000000000, 7
WORDS = {1: "warning", 2: "discard", 3: "error", 4: "fatal"}
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
  a: {{fmu: ./{fmu}}}
  b: {{fmu: ./{fmu}, parameters: {{answer: {answer}}}{more}}}
{record}
connections:
{connections}
"""
KINDS = {"Real": 0.75, "Integer": -21, "Boolean": "true", "String": "größer"}

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="compiles for Linux")


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


@pytest.fixture
def run(library, tmp_path, capsys):
    """Run two units of an FMU, the second fed by the first; return status, words and results."""

    def go(
        *arguments, answer=0, given=KINDS, guid="{good}", scale="", record="",
        binary=library, change=lambda xml: xml, more="",
    ):  # fmt: skip
        write_fmu(tmp_path / "foreign.fmu", binary, *given, guid=guid, change=change)
        comma = ", " if scale else ""
        constants = ", ".join(f"a.{kind}_in: {value}" for kind, value in given.items())
        (tmp_path / "two.yaml").write_text(
            SCENARIO.format(
                constants=f"{{{constants}}}",
                fmu="foreign.fmu",
                answer=answer,
                more=more,
                record=record,
                connections="\n".join(
                    f"  - {{from: a.{kind}_out, to: b.{kind}_in{comma}{scale}}}" for kind in given
                ),
            ),
            encoding="utf-8",
        )
        out = tmp_path / "out"
        with pytest.raises(SystemExit) as exit_:
            main(["run", str(tmp_path / "two.yaml"), "--out", str(out), *arguments])
        said = capsys.readouterr().err
        results = load_results(out) if (out / "run.json").exists() else None
        return exit_.value.code or 0, said, results

    return go


together_and_apart = pytest.mark.parametrize("isolate", [[], ["--isolate"]], ids=["together", "apart"])
mostly_together = pytest.mark.parametrize(
    "isolate", [[], pytest.param(["--isolate"], marks=pytest.mark.exhaustive)], ids=["together", "apart"]
)


@together_and_apart
def test_all_types_pass_through_without_optional_capabilities(run, isolate):
    status, said, results = run(*isolate)
    assert status == 0, said
    assert {name: column[-1] for name, column in results.columns.items()} == {
        "a.Real_out": 1.5,
        "a.Integer_out": -42,
        "a.Boolean_out": 0,
        "b.Real_out": 3.0,
        "b.Integer_out": -84,
        "b.Boolean_out": 1,
    }  # fmt: skip; text is not recorded, see below


@mostly_together
def test_enumerations_are_wired_and_given_by_name(run, isolate):
    status, said, results = run(*isolate, given={"Enumeration": "dry"})
    assert status == 0, said
    assert set(results["a.Enumeration_out"]) == {2}
    assert set(results["b.Enumeration_out"]) == {4}
    status, said, _ = run(*isolate, given={"Enumeration": "snow"})
    assert status == 2
    assert mentions(said, "dry", "wet", "ice")


@pytest.mark.parametrize("answer", [2, 3, 4], ids=WORDS.get)
def test_a_step_that_fails_apart_is_a_sentence_and_the_results_so_far(run, answer):
    status, said, results = run("--isolate", answer=answer)
    assert status == 1
    assert mentions(said, "b:", "0.25 s", "3", "99.5%")
    assert results.record.status == "failed"
    assert results.time[-1] == 0.25
    assert results.record.error.inputs == {
        "Real_in": 1.5, "Integer_in": -42, "Boolean_in": False, "String_in": "<größer>",
    }  # fmt: skip


@mostly_together
def test_a_warning_is_said_and_the_run_goes_on(run, isolate):
    status, said, results = run(*isolate, answer=1)
    assert status == 0
    assert mentions(said, "3", "99.5%", "valve", "gedacht")
    assert results.time[-1] == 0.5


def test_a_tunable_parameter_is_given_as_any_other(run):
    assert run("--set", "b.answer=3")[0] == 1  # it reaches the FMU, which then fails
    assert run("--set", "b.answer=3", "--set", "b.answer=0")[0] == 0
    status, said, _ = run("--set", "b.answer=5")
    assert status == 2
    assert "--set b.answer=5" in said
    assert "4" in said


@mostly_together
def test_a_parameter_reaches_an_fmu_that_resets_when_the_experiment_is_set_up(run, isolate):
    assert run(*isolate, answer=3, guid="{reset}")[0] == 1  # as told, it fails
    status, said, results = run(*isolate, answer=1, guid="{reset}")
    assert status == 0
    assert "valve 3 of b" in said
    assert results.record.fmus["b"].parameters == {"answer": 1}


@mostly_together
def test_a_parameter_that_does_not_take_ends_the_run(run, isolate):
    status, said, results = run(*isolate, answer=2, guid="{deaf}")
    assert status == 1
    assert mentions(said, "b:", "0", "2", "answer")
    assert results.record.status == "failed"
    assert results.record.error.instance == "b"


@mostly_together
def test_a_parameter_that_cannot_be_read_back_is_a_warning(run, isolate):
    status, said, results = run(*isolate, answer=1, guid="{mute}")
    assert status == 0
    assert mentions(said, "0 s", "whether", "answer")
    assert results.time[-1] == 0.5


@mostly_together
@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel", "extrapolated"])
@pytest.mark.sampled(2)
def test_gain_and_offset_reach_units_that_declare_no_units_of_measurement(run, isolate, algorithm):
    """Both units double what they get."""
    status, said, results = run(
        *isolate,
        "--set",
        f"algorithm={algorithm}",
        given={"Real": 0.75, "Integer": 5},
        scale="gain: 10, offset: -3",
    )
    assert status == 0, said
    assert set(results["b.Real_out"]) == {2 * (10 * 1.5 - 3)}
    assert set(results["b.Integer_out"]) == {2 * (10 * 10 - 3)}
    assert results.record.content()["connections"][0] == {
        "from": "a.Real_out", "to": "b.Real_in", "gain": 10.0, "offset": -3.0
    }  # fmt: skip


@mostly_together
@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_text_parameters_and_inputs_are_recorded_by_name(run, isolate, form):
    status, said, results = run(
        *isolate,
        "--format",
        form,
        record="record: [b.String_out, b.answer, b.Integer_in, b.Real_in, '*.Real_out']",
    )
    assert status == 0, said
    assert list(results) == [
        "b.String_out",
        "b.answer",
        "b.Integer_in",
        "b.Real_in",
        "a.Real_out",
        "b.Real_out",
    ]
    assert set(results["b.String_out"]) == {"<<größer>>"}
    assert set(results["b.answer"]) == {0}
    assert set(results["b.Integer_in"]) == {-42}
    assert set(results["b.Real_in"]) == {1.5}
    assert results.record.rows == 11


@together_and_apart
@pytest.mark.parametrize(("guid", "rows", "reached"), [("{whole}", 7, 0.3), ("{half}", 6, 0.275)])
def test_an_fmu_that_wants_to_end_ends_the_run_in_good_order(run, isolate, guid, rows, reached):
    status, said, results = run(*isolate, guid=guid)
    assert status == 0, said
    assert mentions(said, "ended", f"{reached:g} s")
    assert results.time.size == rows
    assert (results.record.status, results.record.error) == ("completed", None)
    assert results.record.ended.instance == "a"
    assert results.record.ended.time == pytest.approx(reached)
    assert results["b.Real_out"].tolist() == [3.0] * rows


def test_a_run_that_an_fmu_has_ended_is_fresh_and_lacks_metrics_of_later_windows(run, tmp_path, capsys):
    results = run(guid="{whole}")[2]
    plan = make_plan(load_scenario(tmp_path / "two.yaml"))
    assert staleness(plan, tmp_path / "out") is None
    peak = metric("peak(b.Real_out)")
    assert evaluate(results, peak, (0.0, 0.3)) is not None
    assert evaluate(results, peak, (0.0, 0.4)) is None


@mostly_together
def test_start_time_and_tolerance_reach_the_fmu(run, isolate):
    status, said, results = run(*isolate, "--set", "start_time=0.25", guid="{solver}")
    assert status == 0, said
    assert results.time.tolist() == [0.25, 0.3, 0.35, 0.4, 0.45, 0.5]
    assert results["b.Real_out"][-1] == 0.25
    default = '<DefaultExperiment tolerance="1e-4"/>'
    with_default = lambda xml: xml.replace("<ModelVariables>", f"{default}<ModelVariables>")  # noqa: E731
    assert run(*isolate, guid="{solver}", change=with_default)[2]["b.Real_out"][-1] == 1e-4
    results = run(*isolate, guid="{solver}", change=with_default, more=", tolerance: 1e-6")[2]
    assert (results["a.Real_out"][-1], results["b.Real_out"][-1]) == (1e-4, 1e-6)
    assert results.record.fmus["b"].tolerance == 1e-6


@pytest.mark.parametrize(
    ("setting", "names"),
    [
        ("start_time=0.5", ("start_time", "0.5 s")),
        (
            "start_time=0.02",
            ("0.48 s", "0.02 s", "0.05 s"),
        ),
    ],
)
def test_a_start_time_that_does_not_fit_is_said(run, setting, names):
    status, said, _ = run("--set", setting)
    assert status == 2
    assert mentions(said, *names)


WRONG = {
    "given": {"Real": 0.75},
    "change": lambda xml: xml.replace('<Real start="0"/>', '<Real unit="bar" start="0"/>'),
}


def test_a_description_that_is_formally_wrong_runs_with_a_warning_if_asked_to(run):
    status, said, _ = run(**WRONG)
    assert status == 2
    assert "a: " in said or "two.yaml" in said
    assert mentions(said, "FMI", "2.0")
    assert mentions(said, "'validate: false'", "--set INSTANCE.validate=false")
    status, said, results = run("--no-validate", **WRONG)
    assert status == 0, said
    assert mentions(said, "warning", "0 s", "FMI", "2.0", '"bar"')
    assert [w.instance for w in results.record.warnings] == ["a", "b"]
    assert results["b.Real_out"][-1] == 3.0


def test_one_unit_may_be_left_unvalidated_by_the_scenario(run):
    status, said, _ = run(**WRONG, more=", validate: false")
    assert status == 2
    assert mentions(said, "two.yaml:7", "units.a.fmu")
    assert "units.b" not in said


@pytest.mark.exhaustive
def test_every_command_that_runs_a_scenario_takes_fmus_that_are_formally_wrong_if_asked_to(
    run, tmp_path, monkeypatch
):
    """By `--set`, which they all have, as by the keys of files that make runs."""
    both = ("--set", "a.validate=false", "--set", "b.validate=false")
    status, said, results = run(*both, **WRONG)
    assert (status, results["b.Real_out"][-1]) == (0, 3.0), said
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sweep.yaml").write_text(
        "title: Wrong\nscenario: two.yaml\nset: {a.validate: false, b.validate: false}\n"
        "axes: {start: {vary: inputs.a.Real_in, values: [0.25, 0.5]}}\n"
        "metrics: {m: {metric: peak(b.Real_out)}}\n"
    )
    for command in (["sweep", "sweep.yaml"], ["converge", "two.yaml", "--signal", "b.Real_out", *both]):
        assert status_of(*command, "--out", command[0]) == 0, command


@mostly_together
def test_an_fmu_without_optional_functions_runs(run, bare_library, isolate):
    numbers = {kind: value for kind, value in KINDS.items() if kind != "String"}
    status, said, results = run(*isolate, given=numbers, binary=bare_library)
    assert status == 0, said
    assert results["b.Integer_out"][-1] == -84


def test_an_fmu_without_a_function_that_is_needed_is_refused_before_the_run(
    run, bare_library, tmp_path, capsys
):
    status, said, results = run(binary=bare_library)
    assert (status, results) == (2, None)
    assert mentions(said, "a:", "fmi2SetString", "String_in")
    assert status_of("check", tmp_path / "two.yaml") == 2
    assert mentions(capsys.readouterr().err, "a:", "fmi2GetString", "String_out")


@mostly_together
def test_a_foreign_unit_takes_time_series_of_every_type(run, isolate, tmp_path):
    (tmp_path / "d.csv").write_text("time,r,i,b,s\n0,0,1,0,x\n0.25,1,2,1,y\n0.5,2,3,0,z\n", encoding="utf-8")
    given = {
        kind: f"{{file: d.csv, column: {name}}}"
        for kind, name in (("Real", "r"), ("Integer", "i"), ("Boolean", "b"), ("String", "s"))
    }
    status, said, results = run(*isolate, given=given, record="record: ['a.*', a.String_out]")
    assert status == 0, said
    # the output follows the input at once, so it is that of the end of the step; it doubles and negates
    assert results["a.Real_out"].tolist() == pytest.approx([8 * t for t in results.time])
    assert results["a.Integer_out"].tolist() == [2] * 5 + [4] * 5 + [6]
    assert results["a.Boolean_out"].tolist() == [1] * 5 + [0] * 5 + [1]
    assert results["a.String_out"].tolist() == ["<x>"] * 5 + ["<y>"] * 5 + ["<z>"]
    assert set(results.record.fmus["a"].series) == {f"{kind}_in" for kind in given}


HANGING = (
    "Instantiate",
    "SetupExperiment",
    "SetInteger",
    "SetReal",
    "EnterInitializationMode",
    "ExitInitializationMode",
)


@together_and_apart
@pytest.mark.parametrize("function", HANGING)
@pytest.mark.sampled(2)
def test_an_fmu_that_hangs_in_initialization_is_ended_at_the_limit_of_a_call(
    run, monkeypatch, function, isolate
):
    monkeypatch.setattr(child_run, "INITIALIZATION_LIMIT", 1.0)
    limit = ["--call-limit", "1 s"] if isolate else []
    guid = f"{{hang {function}}}"
    status, said, _ = run(*isolate, *limit, given={"Real": 0.75, "Integer": 5}, guid=guid)
    assert status == 1
    option = "--call-limit" if isolate else "--isolate --call-limit"
    assert mentions(said.splitlines()[0], "a:", "1 s", option, *([f"fmi2{function}"] if isolate else []))
