"""FMUs in C from elsewhere, from the archive through the command line to the results, also isolated."""

from __future__ import annotations

import ctypes
import sys
from dataclasses import replace
from pathlib import Path

import fmpy
import pytest

from tests.cars import load_scenario, make_plan
from tests.command_line import status_of
from tests.orchestrator.foreign_fmus import KINDS, mostly_together, together_and_apart
from tests.orchestrator.foreign_fmus import write_fmu as write_fmu
from tests.refusals import each_mentions, mentions, refused
from yawbench.foundation.errors import ModelDescriptionError, SimulationError, YawbenchError
from yawbench.metrics.expressions import evaluate, metric
from yawbench.orchestrator.master import child_run
from yawbench.orchestrator.master.fmi import open_instance
from yawbench.orchestrator.master.isolation import Isolation
from yawbench.orchestrator.master.simulate import simulate
from yawbench.orchestrator.results.freshness import staleness
from yawbench.orchestrator.results.reader import load_results

DISCARD, ERROR, FATAL, AT_THE_END = 2, 3, 4, 100
"""What the parameter `answer` asks a step for; with 100 more the end of the instance."""
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="compiles for Linux")


@pytest.fixture
def run(scenario, tmp_path, capsys, isolate):
    """Run such a scenario, which ends with this status and a line with the names `a | b`; return results."""

    def go(*arguments, status=0, says="", **keys):
        out = tmp_path / "out"
        given = status_of("run", scenario(**keys), "--out", out, *isolate, *arguments)
        said = capsys.readouterr().err
        assert given == status, said
        assert not says or mentions(said, *says.split(" | "))
        return load_results(out) if (out / "run.json").exists() else None

    return go


@together_and_apart
def test_all_types_pass_through_without_optional_capabilities(run):
    results = run()
    assert {name: column[-1] for name, column in results.columns.items()} == {
        "a.Real_out": 1.5,
        "a.Integer_out": -42,
        "a.Boolean_out": 0,
        "b.Real_out": 3.0,
        "b.Integer_out": -84,
        "b.Boolean_out": 1,
    }  # fmt: skip; text is not recorded, see below


# Statuses and the end of instances


@pytest.fixture
def plan(scenario, cache):
    """Make a plan of such a scenario, with a library of its own that stays in memory; return counts, too.

    They tell how often the library was asked to instantiate, to terminate and to free.
    """

    def make(**keys):
        path = scenario(change=lambda xml: xml.replace('min="0" max="4"', ""), **keys)
        made = make_plan(load_scenario(path))
        binaries = made.instances[0].fmu.directory / "binaries"
        library = ctypes.CDLL(str(binaries / fmpy.platform / "foreign.so"))
        return made, (ctypes.c_int * 3).in_dll(library, "counters")

    return make


@pytest.mark.parametrize("apart", [False, True], ids=["together", "apart"])
@pytest.mark.parametrize(
    ("answer", "ended", "names"),
    [
        (DISCARD, [2, 2, 2], ("3", "99.5%")),
        (ERROR, [2, 1, 2], ("3", "99.5%")),
        (FATAL, [2, 0, 0], ("3", "99.5%")),
        (-1, [2, 0, 0], ()),
        (42, [2, 0, 0], ()),
    ],
)
def test_a_step_that_fails_is_a_sentence_and_the_results_so_far(plan, answer, ended, names, apart, tmp_path):
    """Instances are ended as the standard allows: after Fatal no function of any of them may be called."""
    made, counters = plan(answer=answer)
    with (
        Isolation(made.instances) as isolation,
        refused(SimulationError, "fmu-call-failed", names=("b:", "0.25 s", *names)),
    ):
        simulate(made, tmp_path / "out", opener=isolation if apart else open_instance)
    assert [*counters] == ([0, 0, 0] if apart else ended)
    results = load_results(tmp_path / "out")
    assert results.record.status == "failed"
    assert results.time[-1] == 0.25
    assert results.record.error.inputs == {
        "Real_in": 1.5, "Integer_in": -42, "Boolean_in": False, "String_in": "<größer>",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("answer", "word", "ended"), [(ERROR, "Error", [2, 2, 2]), (FATAL, "Fatal", [2, 1, 0])]
)
def test_an_instance_that_cannot_be_ended_is_reported(plan, answer, word, ended, tmp_path):
    made, counters = plan(answer=AT_THE_END + answer)
    info = simulate(made, tmp_path / "out")
    assert each_mentions([(m.instance, m.text) for m in info.warnings], ("fmi2Terminate", word))
    assert [*counters] == ended
    assert load_results(tmp_path / "out").record.status == "completed"


def test_an_fmu_that_refuses_to_be_instantiated_says_why(plan, tmp_path):
    made, counters = plan()
    first, second = made.instances
    refusing = replace(second, fmu=replace(second.fmu, guid="{refuse}"))
    with refused(SimulationError, "fmu-not-loadable", names=("b:", "foreign.fmu")):
        simulate(replace(made, instances=(first, refusing)), tmp_path / "out")
    assert [*counters] == [1, 0, 1]


@pytest.mark.parametrize(
    "change",
    [
        lambda library: library.parent.rename(library.parent.with_name("win16")),
        lambda library: library.write_bytes(b"no library"),
    ],
    ids=["for another platform", "no library"],
)
def test_a_library_that_cannot_be_loaded_is_refused(scenario, cache, change, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made = make_plan(load_scenario(scenario()))
    change(made.instances[0].fmu.directory / "binaries" / fmpy.platform / "foreign.so")
    names = ("a:", "foreign.fmu", "foreign.so")
    with refused(ModelDescriptionError, "fmu-not-loadable", names=names):
        simulate(made, "out")
    assert Path.cwd() == tmp_path
    assert load_results("out").record.status == "failed"


@mostly_together
def test_enumerations_are_wired_and_given_by_name(run):
    results = run(given={"Enumeration": "dry"})
    assert set(results["a.Enumeration_out"]) == {2}
    assert set(results["b.Enumeration_out"]) == {4}
    run(given={"Enumeration": "snow"}, status=2, says="dry | wet | ice")


@mostly_together
@pytest.mark.parametrize(
    ("guid", "says"), [("{good}", "3 | 99.5% | valve | gedacht"), ("{mute}", "0 s | whether | answer")]
)
def test_a_warning_is_said_and_the_run_goes_on(run, guid, says):
    """Of a step, and of a parameter that cannot be read back."""
    assert run(answer=1, guid=guid, says=says).time[-1] == 0.5


def test_a_tunable_parameter_is_given_as_any_other(run):
    run("--set", "b.answer=3", status=1)  # it reaches the FMU, which then fails
    run("--set", "b.answer=3", "--set", "b.answer=0")
    run("--set", "b.answer=5", status=2, says="--set b.answer=5 | 4")


@mostly_together
def test_a_parameter_reaches_an_fmu_that_resets_when_the_experiment_is_set_up(run):
    run(answer=3, guid="{reset}", status=1)  # as told, it fails
    results = run(answer=1, guid="{reset}", says="valve 3 of b")
    assert results.record.fmus["b"].parameters == {"answer": 1}


@mostly_together
def test_a_parameter_that_does_not_take_ends_the_run(run):
    record = run(answer=2, guid="{deaf}", status=1, says="b: | 0 | 2 | answer").record
    assert (record.status, record.error.instance) == ("failed", "b")


@mostly_together
@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel", "extrapolated"])
@pytest.mark.sampled(2)
def test_gain_and_offset_reach_units_that_declare_no_units_of_measurement(run, algorithm):
    """Both units double what they get."""
    given = {"given": {"Real": 0.75, "Integer": 5}, "scale": "gain: 10, offset: -3"}
    results = run("--set", f"algorithm={algorithm}", **given)
    assert set(results["b.Real_out"]) == {2 * (10 * 1.5 - 3)}
    assert set(results["b.Integer_out"]) == {2 * (10 * 10 - 3)}
    assert results.record.content()["connections"][0] == {
        "from": "a.Real_out", "to": "b.Real_in", "gain": 10.0, "offset": -3.0
    }  # fmt: skip


@mostly_together
@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_text_parameters_and_inputs_are_recorded_by_name(run, form):
    record = "record: [b.String_out, b.answer, b.Integer_in, b.Real_in, '*.Real_out']"
    results = run("--format", form, record=record)
    assert list(results) == [
        "b.String_out", "b.answer", "b.Integer_in", "b.Real_in", "a.Real_out", "b.Real_out"
    ]  # fmt: skip
    assert [set(results[name]) for name in [*results][:4]] == [{"<<größer>>"}, {0}, {-42}, {1.5}]
    assert results.record.rows == 11


@together_and_apart
@pytest.mark.parametrize(("guid", "rows", "reached"), [("{whole}", 7, 0.3), ("{half}", 6, 0.275)])
def test_an_fmu_that_wants_to_end_ends_the_run_in_good_order(run, guid, rows, reached, tmp_path):
    results = run(guid=guid, says=f"ended | {reached:g} s")
    assert results.time.size == rows
    assert (results.record.status, results.record.error) == ("completed", None)
    assert results.record.ended.instance == "a"
    assert results.record.ended.time == pytest.approx(reached)
    assert results["b.Real_out"].tolist() == [3.0] * rows
    assert staleness(make_plan(load_scenario(tmp_path / "two.yaml")), tmp_path / "out") is None
    peak = metric("peak(b.Real_out)")
    assert evaluate(results, peak, (0.0, 0.25)) is not None
    assert evaluate(results, peak, (0.0, 0.4)) is None


@mostly_together
def test_start_time_and_tolerance_reach_the_fmu(run):
    results = run("--set", "start_time=0.25", guid="{solver}")
    assert results.time.tolist() == [0.25, 0.3, 0.35, 0.4, 0.45, 0.5]
    assert results["b.Real_out"][-1] == 0.25
    default = '<DefaultExperiment tolerance="1e-4"/><ModelVariables>'
    with_default = {"guid": "{solver}", "change": lambda xml: xml.replace("<ModelVariables>", default)}
    results = run(**with_default, more=", tolerance: 1e-6")
    assert (results["a.Real_out"][-1], results["b.Real_out"][-1]) == (1e-4, 1e-6)
    assert results.record.fmus["b"].tolerance == 1e-6


@pytest.mark.parametrize(
    ("start", "says"), [("0.5", "start_time | 0.5 s"), ("0.02", "0.48 s | 0.02 s | 0.05 s")]
)
def test_a_start_time_that_does_not_fit_is_said(run, start, says):
    run("--set", f"start_time={start}", status=2, says=says)


WRONG = {
    "given": {"Real": 0.75},
    "change": lambda xml: xml.replace('<Real start="0"/>', '<Real unit="bar" start="0"/>'),
}


def test_a_description_that_is_formally_wrong_runs_with_a_warning_if_asked_to(run, capsys):
    run(**WRONG, status=2, says="FMI | 2.0 | 'validate: false' | --set INSTANCE.validate=false")
    results = run("--no-validate", **WRONG, says='warning | 0 s | FMI | 2.0 | "bar"')
    assert [w.instance for w in results.record.warnings] == ["a", "b"]
    assert results["b.Real_out"][-1] == 3.0


def test_one_unit_may_be_left_unvalidated_by_the_scenario(scenario):
    with refused(YawbenchError) as error:
        make_plan(load_scenario(scenario(**WRONG, more=", validate: false")))
    assert mentions(error.value, "two.yaml:7", "units.a.fmu")
    assert "units.b" not in str(error.value)


@pytest.mark.exhaustive
def test_every_command_that_runs_a_scenario_takes_fmus_that_are_formally_wrong_if_asked_to(
    run, tmp_path, monkeypatch
):
    """By `--set`, which they all have, as by the keys of files that make runs."""
    both = ("--set", "a.validate=false", "--set", "b.validate=false")
    assert run(*both, **WRONG)["b.Real_out"][-1] == 3.0
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sweep.yaml").write_text(
        "title: Wrong\nscenario: two.yaml\nset: {a.validate: false, b.validate: false}\n"
        "axes: {start: {vary: inputs.a.Real_in, values: [0.25, 0.5]}}\n"
        "metrics: {m: {metric: peak(b.Real_out)}}\n"
    )
    for command in (["sweep", "sweep.yaml"], ["converge", "two.yaml", "--signal", "b.Real_out", *both]):
        assert status_of(*command, "--out", command[0]) == 0, command


@mostly_together
def test_an_fmu_without_optional_functions_runs(run, bare_library):
    numbers = {kind: value for kind, value in KINDS.items() if kind != "String"}
    assert run(given=numbers, binary=bare_library)["b.Integer_out"][-1] == -84


def test_an_fmu_without_a_function_that_is_needed_is_refused_before_the_run(
    run, bare_library, tmp_path, capsys
):
    assert run(binary=bare_library, status=2, says="a: | fmi2SetString | String_in") is None
    assert status_of("check", tmp_path / "two.yaml") == 2
    assert mentions(capsys.readouterr().err, "a:", "fmi2GetString", "String_out")


@mostly_together
def test_a_foreign_unit_takes_time_series_of_every_type(run, tmp_path):
    kinds = ("Real", "Integer", "Boolean", "String")
    rows = f"time,{','.join(kinds)}\n0,0,1,0,x\n0.25,1,2,1,y\n0.5,2,3,0,z\n"
    (tmp_path / "d.csv").write_text(rows, encoding="utf-8")
    given = {kind: f"{{file: d.csv, column: {kind}}}" for kind in kinds}
    results = run(given=given, record="record: ['a.*', a.String_out]")
    # the output follows the input at once, so it is that of the end of the step; it doubles and negates
    assert results["a.Real_out"].tolist() == pytest.approx([8 * t for t in results.time])
    assert results["a.Integer_out"].tolist() == [2] * 5 + [4] * 5 + [6]
    assert results["a.Boolean_out"].tolist() == [1] * 5 + [0] * 5 + [1]
    assert results["a.String_out"].tolist() == ["<x>"] * 5 + ["<y>"] * 5 + ["<z>"]
    assert set(results.record.fmus["a"].series) == {f"{kind}_in" for kind in kinds}


MODE = "InitializationMode"


@together_and_apart
@pytest.mark.parametrize(
    "function", ["Instantiate", "SetupExperiment", "SetInteger", "SetReal", f"Enter{MODE}", f"Exit{MODE}"]
)
@pytest.mark.sampled(2)
def test_an_fmu_that_hangs_in_initialization_is_ended_at_the_limit_of_a_call(
    run, monkeypatch, function, isolate
):
    limit = 0.5
    monkeypatch.setattr(child_run, "INITIALIZATION_LIMIT", limit)
    options, names = ([], "--isolate --call-limit")
    if isolate:
        options, names = ["--call-limit", f"{limit} s"], f"--call-limit | fmi2{function}"
    given = {"given": {"Real": 0.75, "Integer": 5}, "guid": f"{{hang {function}}}"}
    run(*options, **given, status=1, says=f"a: | {limit} s | {names}")
