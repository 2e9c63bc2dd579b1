"""FMUs of FMI 3.0 behind the master, beside fmpy's own simulation of them."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest

from tests.command_line import status_of
from tests.fmus.models3 import make_fmu
from tests.orchestrator.foreign_fmus import mostly_together, together_and_apart, write_fmu
from tests.refusals import mentions
from yawbench.orchestrator.results.reader import load_results

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="compiles for Linux")
each_algorithm = pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel", "extrapolated"])


@pytest.fixture
def go(models, tmp_path, capsys, isolate):
    """Call a command for units as name -> model or path (and other keys); return status, words, results."""

    def call(units, *arguments, command="run", stop_time=1.0, step_size=0.1, **keys):
        given = {}
        for name, unit in units.items():
            fmu, more = unit if isinstance(unit, tuple) else (unit, {})
            path = fmu if isinstance(fmu, Path) else make_fmu(tmp_path, fmu, models)
            given[name] = {"fmu": str(path), **more}
        data = {"stop_time": stop_time, "step_size": step_size, "units": given, **keys}
        (tmp_path / "s.yaml").write_text(json.dumps(data), encoding="utf-8")
        out = tmp_path / "out"
        where = ["--out", out, *isolate] if command == "run" else []
        status = status_of(command, tmp_path / "s.yaml", *where, *arguments)
        said = capsys.readouterr()
        results = load_results(out) if (out / "run.json").exists() else None
        return status, said.err + said.out, results

    return call


@pytest.fixture
def run(go):
    """Make a run that reaches its end; return its results."""

    def ran(units, *arguments, **keys):
        status, said, results = go(units, *arguments, **keys)
        assert status == 0, said
        return results

    return ran


@pytest.fixture
def fails(go):
    """Call a command that ends with this exit status and a line with the names `a | b`; return results."""

    def failed(status, names, units, *arguments, **keys):
        given, said, results = go(units, *arguments, **keys)
        assert given == status, said
        assert mentions(said, *names.split(" | "))
        return results

    return failed


@pytest.fixture
def by_both_loops(run, tmp_path, monkeypatch):
    """Make a run with each loop, which give the same bytes; return its results."""

    def ran(*arguments, **keys):
        files = []
        for wanted in ("python", ""):
            monkeypatch.setenv("YAWBENCH_LOOP", wanted)
            results = run(*arguments, **keys)
            files.append((tmp_path / "out" / "results.csv").read_bytes())
        assert files[0] == files[1]
        return results

    return ran


@mostly_together
@pytest.mark.parametrize(
    ("model", "parameters"),
    [("Dahlquist", {"k": 2.5}), ("VanDerPol", {"mu": 3.0}), ("BouncingBall", {"e": 0.5, "g": -20.0})],
)
def test_models_agree_with_fmpys_own_simulation(run, tmp_path, model, parameters):
    results = run({"a": (model, {"parameters": parameters})}, stop_time=5)
    path = str(tmp_path / f"{model}.fmu")
    theirs = fmpy.simulate_fmu(path, output_interval=0.1, stop_time=5, start_values=parameters)
    assert results.record.fmus["a"].fmi_version == "3.0"
    for column in results:
        difference = np.abs(results[column] - theirs[column.removeprefix("a.")])
        assert difference.max() < 1e-12, column


EVERY = {
    "Float64": -0.1, "Float32": 0.1, "Int8": -128, "UInt8": 255, "Int16": -32768, "UInt16": 65535,
    "Int32": -(2**31), "UInt32": 2**32 - 1, "Int64": -(2**53), "UInt64": 2**53, "Boolean": True,
}  # fmt: skip


REST = EVERY | {"String": "", "mode": "dry"}


def rest(*driven, units):
    """Return constants for the inputs of instances of Every but those that are driven."""
    given = {f"{unit}.{kind}_in": value for unit in units for kind, value in REST.items()}
    return {name: value for name, value in given.items() if name not in driven}


@together_and_apart
def test_every_type_passes_from_unit_to_unit(run):
    constants = {f"a.{kind}_in": value for kind, value in EVERY.items()}
    constants |= {"a.String_in": "größer", "a.mode_in": "wet"}
    wires = [{"from": f"a.{kind}_out", "to": f"b.{kind}_in"} for kind in (*EVERY, "String", "mode")]
    results = run({"a": "Every", "b": "Every"}, inputs=constants, connections=wires)
    for unit in "ab":
        last = {kind: results[f"{unit}.{kind}_out"][-1] for kind in EVERY}
        assert last == {**EVERY, "Float32": float(np.float32(0.1))}
        assert results[f"{unit}.mode_out"][-1] == 4


@pytest.mark.parametrize(
    ("kind", "value", "names"),
    [
        ("Int8", 128, "-128 | 127"),
        ("UInt64", -1, "0 | 18446744073709551615 | -1"),
        ("Float32", 1e39, "1e+39 | finite | number"),
    ],
)
def test_a_constant_that_a_type_cannot_hold_is_refused(fails, kind, value, names):
    fails(2, names, {"a": "Every"}, inputs=rest(units="a") | {f"a.{kind}_in": value})


@together_and_apart
def test_types_convert_on_a_wire_without_loss(run, library, tmp_path):
    wires = [
        {"from": "a.Int64_out", "to": "b.Float64_in"},
        {"from": "a.Boolean_out", "to": "b.Float32_in", "gain": 0.25, "offset": -3},
        {"from": "a.Int8_out", "to": "b.mode_in"},
        {"from": "a.mode_out", "to": "b.UInt8_in"},
        {"from": "a.Int16_out", "to": "old.Real_in"},
    ]
    constants = rest(*(wire["to"] for wire in wires), units="ab")
    constants |= {"a.Int64_in": 2**53 - 1, "a.Int8_in": 4, "a.mode_in": "wet"}
    old = write_fmu(tmp_path / "foreign.fmu", library, "Real")
    units = {"a": "Every", "b": "Every", "old": old}
    results = run(units, inputs=constants, connections=wires)
    taken = {name: set(results[f"b.{name}_out"]) for name in ("Float64", "Float32", "mode", "UInt8")}
    assert taken == {"Float64": {2.0**53 - 1}, "Float32": {-2.75}, "mode": {4}, "UInt8": {4}}
    assert set(results["old.Real_out"]) == {-65536.0}


@each_algorithm
def test_an_integer_that_feeds_a_real_is_coupled_alike_by_both_loops(by_both_loops, algorithm):
    units = {"m": "Matrix", "a": "Stair", "n": ("Matrix", {"step_size": 0.4})}
    wires = [
        {"from": "a.counter", "to": "m.u[1]", "gain": 0.5, "offset": 1},
        {"from": "m.y[1]", "to": "n.u[1]"},
        {"from": "a.counter", "to": "n.u[2]"},
    ]
    keys = {"inputs": {"m.u[2]": 0.0}, "algorithm": algorithm, "stop_time": 4, "step_size": 0.2}
    results = by_both_loops(units, connections=wires, **keys)
    counts = results["a.counter"]
    late = counts if algorithm == "gauss_seidel" else np.array([counts[0], *counts[:-1]])
    if algorithm != "extrapolated":
        assert results["m.y[1]"].tolist() == (0.5 * late + 1).tolist()
    assert {*results["n.y[2]"]} <= {*counts.astype(float)}  # held, never interpolated
    assert results["n.y[2]"][-1] >= 4.0


@mostly_together
@pytest.mark.parametrize(
    ("wire", "constants", "unit", "time", "names"),
    [
        ("a.counter -> b.mode_in", {}, "b", 1.0, "b: | mode_in | 2 | 1 | 4"),
        ("c.Int64_out -> b.Float64_in", {"c.Int64_in": 2**53 + 1}, "c", 0.0, "9007199254740993 | Real"),
        ("c.Int64_out -> b.Int8_in", {"c.Int64_in": 1000}, "b", 0.0, "b: | 0 s | 1000"),
        ("c.UInt32_out -> old.Integer_in", {}, "old", 0.0, "0 s | 4294967295 | Integer"),
    ],
)
def test_a_number_that_its_input_cannot_be_ends_the_run(
    fails, tmp_path, library, wire, constants, unit, time, names
):
    old = write_fmu(tmp_path / "foreign.fmu", library, "Integer")
    units = {"a": "Stair", "b": "Every", "c": "Every", "old": old}
    source, target = wire.split(" -> ")
    inputs = {"old.Integer_in": 0} | rest(units="bc") | constants
    del inputs[target]
    wires = [{"from": source, "to": target}]
    error = fails(1, names, units, inputs=inputs, connections=wires, stop_time=3).record.error
    assert error.instance == unit
    assert error.time == pytest.approx(time, abs=0.11)


@mostly_together
@each_algorithm
@pytest.mark.sampled(2)
def test_arrays_are_wired_set_and_recorded_element_by_element(run, library, tmp_path, algorithm):
    matrix = {"A[1,1]": 1.0, "A[1,2]": 2.0, "A[2,1]": 3.0}  # A[2,2] keeps its start value, 1
    units = {"d": "Dahlquist", "m": ("Matrix", {"parameters": matrix}), "n": "Matrix"}
    wires = [{"from": "d.x", "to": "m.u[2]"}, {"from": "m.y[*]", "to": "n.u[*]"}]
    results = run(units, inputs={"m.u[1]": 10.0}, connections=wires, algorithm=algorithm)
    x = np.array([0.99 ** (10 * k) for k in range(11)])
    assert np.allclose(results["d.x"], x, rtol=1e-12)
    seen = x if algorithm != "jacobi" else np.array([x[0], *x[:-1]])
    assert np.allclose(results["m.y[1]"], 10 + 2 * seen, rtol=1e-12)
    assert np.allclose(results["m.y[2]"], 30 + seen, rtol=1e-12)
    assert results["n.result[2]"].tolist() == results["n.y[2]"].tolist()  # an alias
    if algorithm != "jacobi":
        assert results["n.y[1]"].tolist() == results["m.y[1]"].tolist()


@mostly_together
def test_whole_arrays_are_given_and_connected(run):
    units = {
        "m": ("Matrix", {"parameters": {"A": [[1.0, 2.0], [3.0, 4.0]]}}),
        "n": ("Matrix", {"parameters": {"A": [1, 0, 0, 2], "A[2,1]": 5.0}}),
    }
    wires = [{"from": "m.y", "to": "n.u", "gain": 10}]
    results = run(units, inputs={"m.force": [7, 8]}, connections=wires)
    assert [results[f"m.y[{i}]"][-1] for i in (1, 2)] == [7 + 16, 21 + 32]
    assert [results[f"n.y[{i}]"][-1] for i in (1, 2)] == [230, 5 * 230 + 2 * 530]


def test_options_give_whole_arrays(fails, run):
    options = ("--set", "m.A=[[1, 2], [3, 4]]", "--set", "inputs.m.u=[7, 8]")
    results = run({"m": "Matrix"}, *options, inputs={"m.u": [0, 0]})
    assert [results[f"m.y[{i}]"][-1] for i in (1, 2)] == [7 + 16, 21 + 32]
    wrong = ("--set", "m.A=[1, nan, 3, 4]")
    fails(2, "--set m.A | 2x2 | 4", {"m": "Matrix"}, *wrong, inputs={"m.u": [0, 0]})


def test_an_element_takes_precedence_over_its_array(run):
    results = run({"m": "Matrix"}, inputs={"m.u[2]": 3.0, "m.u": [7, 8]})
    assert [results[f"m.y[{i}]"][-1] for i in (1, 2)] == [7, 3]


@pytest.mark.parametrize(
    ("parameters", "inputs", "wires", "names"),
    [
        ({"A": [1, 2, 3]}, {"u": [1, 2]}, [], "A | 2x2 | 4 | [1, 2, 3]"),
        ({"A": [[1, 2], [3]]}, {"u": [1, 2]}, [], "A | 2x2 | 4"),
        ({"A": 5.0}, {"u": [1, 2]}, [], "A | 2x2 | 4 | 5.0"),
        ({"A": [1, 2, 3, "x"]}, {"u": [1, 2]}, [], "A | number | x"),
        ({}, {"u": 5.0}, [], "u | 2 | 5.0"),
        ({}, {"u": [1, 2, 3]}, [], "u | 2 | [1, 2, 3]"),
        ({}, {"u[1]": [1, 2], "u[2]": 1}, [], "m.u[1] | one value"),
        ({}, {"u": [1, 2]}, [{"from": "s.w", "to": "n.u"}], "s.w | n.u | 3 | 2"),
        ({}, {"u": [1, 2]}, [{"from": "d.x", "to": "n.u"}], "d.x | n.u | one | 2"),
    ],
)
def test_an_array_takes_as_many_values_as_it_has_elements(fails, parameters, inputs, wires, names):
    units = {"m": ("Matrix", {"parameters": parameters}), "n": "Matrix", "s": "Sized", "d": "Dahlquist"}
    others = {"s.v": [1, 2, 3]} if wires else {"n.u": [1, 2], "s.v": [1, 2, 3]}
    given = {f"m.{name}": value for name, value in inputs.items()} | others
    fails(2, names, units, inputs=given, connections=wires)


@together_and_apart
def test_structural_parameters_set_the_sizes_of_arrays(run):
    units = {"s": ("Sized", {"parameters": {"m": 5, "k": 2.0}}), "t": ("Sized", {"parameters": {"m": 5}})}
    wires = [{"from": "s.w", "to": "t.v"}]
    results = run(units, inputs={"s.v": [1, 2, 3, 4, 5]}, connections=wires)
    assert [results[f"t.w[{i}]"][-1] for i in range(1, 6)] == [2, 4, 6, 8, 10]
    assert results.record.fmus["s"].parameters == {"m": 5, "k": 2.0}


@pytest.mark.parametrize(
    ("sizes", "inputs", "names"),
    [
        ({"m": 0}, [1, 2, 3], "m | 1 | 0"),
        ({"m": 2.5}, [1, 2, 3], "m | whole number | 2.5"),
        ({"m": 2}, [1, 2, 3], "v | 2 | [1, 2, 3]"),
        ({"m": 200000}, [1, 2, 3], "m = 200000 | v | 100000"),
    ],
)
def test_a_size_that_cannot_be_is_refused(fails, sizes, inputs, names):
    fails(2, names, {"s": ("Sized", {"parameters": sizes})}, inputs={"s.v": inputs})


def test_a_size_that_an_fmu_refuses_ends_the_run(fails):
    units = {"s": ("Sized", {"parameters": {"m": 17}})}
    fails(1, "s: | structural parameters", units, inputs={"s.v[*]": 1.0})


@together_and_apart
@each_algorithm
@pytest.mark.sampled(2)
def test_tunable_parameters_follow_wires_and_series(run, tmp_path, algorithm):
    (tmp_path / "k.csv").write_text("time,k\n0,1\n0.5,3\n1,5\n", encoding="utf-8")
    units = {"d": "Dahlquist", "s": "Sized", "t": "Sized"}
    inputs = {"s.v": [1, 1, 1], "t.v": [1, 2, 3], "t.k": {"file": "k.csv", "interpolation": "held"}}
    wires = [{"from": "d.x", "to": "s.k"}]
    results = run(units, inputs=inputs, connections=wires, algorithm=algorithm)
    late = algorithm == "jacobi"
    x = results["d.x"]
    assert results["s.w[2]"].tolist() == (np.array([x[0], *x[:-1]]) if late else x).tolist()
    k = [1.0] * 5 + [3.0] * 5 + [5.0]
    assert results["t.w[3]"].tolist() == [3 * one for one in ([k[0], *k[:-1]] if late else k)]


def test_a_parameter_that_is_not_tunable_follows_nothing(fails):
    units = {"d": "Dahlquist", "e": "Dahlquist"}
    fails(2, "e.k | parameter | fixed", units, connections=[{"from": "d.x", "to": "e.k"}])


def test_variables_that_cannot_be_used_are_named(go):
    status, said, _ = go({"a": "Every"}, command="check", inputs=rest(units="a"))
    assert status == 0, said
    for name, kind in (("raw", "Binary"), ("tick", "Clock"), ("ticked", "Clock")):
        assert mentions(said, "a (Every)", name, kind)


@mostly_together
def test_an_alias_of_an_input_is_another_name_for_it(run):
    units = {"d": "Dahlquist", "m": "Matrix", "n": "Matrix"}
    wires = [{"from": "d.x", "to": "m.force[2]"}, {"from": "m.y[*]", "to": "n.force[*]"}]
    record = ["d.x", "m.force[*]", "m.u[*]", "n.force[1]", "n.y[*]"]
    faults = ["--fault", "n.force[1]: gain 3"]
    inputs = {"m.force[1]": 10.0}
    results = run(units, *faults, inputs=inputs, connections=wires, record=record)
    assert results["m.force[2]"].tolist() == results["m.u[2]"].tolist() == results["d.x"].tolist()
    assert set(results["m.force[1]"]) == {10.0}
    assert set(results["n.force[1]"]) == set(results["n.y[1]"]) == {30.0}
    assert results["n.y[2]"].tolist() == results["d.x"].tolist()


def test_an_output_feeds_the_input_that_has_its_name_as_an_alias(run):
    inputs = rest("e.Float64_in", units="e")
    results = run({"s": "Dahlquist", "e": "Every"}, inputs=inputs)
    assert results["e.Float64_out"].tolist() == results["s.x"].tolist()


def test_an_input_with_two_names_has_one_source(fails):
    units = {"s": "Dahlquist", "m": "Matrix"}
    wires = [{"from": "s.x", "to": "m.u[1]"}, {"from": "s.x", "to": "m.force[1]"}]
    names = "s.yaml:1 | connections[1] | m.u[1] | s.x | connections[0]"
    fails(2, names, units, inputs={"m.u[2]": 0.0}, connections=wires)


@mostly_together
def test_units_of_both_versions_share_a_scenario(run, tmp_path, library):
    old = write_fmu(tmp_path / "foreign.fmu", library, "Real")
    units = {"d": "Dahlquist", "old": old, "m": "Matrix"}
    wires = [{"from": "d.x", "to": "old.Real_in"}, {"from": "old.Real_out", "to": "m.u[1]"}]
    results = run(units, inputs={"m.u[2]": 1.0}, connections=wires)
    assert results["m.y[1]"].tolist() == (2 * results["d.x"]).tolist()
    assert [results.record.fmus[u].fmi_version for u in units] == ["3.0", "2.0", "3.0"]


@mostly_together
def test_an_fmu_that_wants_to_end_ends_the_run_after_its_last_step(run):
    results = run({"a": "Stair"}, stop_time=20, step_size=0.5)
    assert mentions(results.record.ended.message, "9 s", "ended")
    assert (results.time[-1], results["a.counter"][-1]) == (9.0, 10)
    assert results.record.ended.time == 9.0


@mostly_together
def test_a_step_from_which_an_fmu_returns_early_is_gone_to_its_end(run):
    results = run({"a": "Early"})
    assert np.allclose(results["a.gone"], results.time, atol=1e-12)


@mostly_together
def test_an_fmu_that_returns_early_and_stays_is_an_error(fails):
    fails(1, "a: | 0 s", {"a": "Stuck"})


@mostly_together
def test_a_parameter_that_does_not_take_ends_the_run(fails):
    fails(1, "a: | 1 | 2 | k", {"a": ("Deaf", {"parameters": {"k": 2.0}})})


@together_and_apart
def test_an_fmu_that_refuses_to_be_instantiated_says_why(fails):
    fails(1, "a: | Refusing.fmu | 100", {"a": "Refusing"})


@pytest.mark.parametrize(("target", "kind"), [("b.raw", "Binary"), ("b.tick", "Clock")])
def test_what_is_not_supported_is_refused_where_it_is_asked_for(fails, target, kind):
    units, wires = {"a": "Every", "b": "Every"}, [{"from": "a.Int8_out", "to": target}]
    fails(2, f"{target} | {kind}", units, inputs=rest(units="ab"), connections=wires)


@pytest.mark.parametrize("interface", ["ModelExchange", "ScheduledExecution"])
def test_other_interfaces_are_refused(fails, tmp_path, models, interface):
    path = make_fmu(tmp_path, "Dahlquist", models, interface=interface)
    fails(2, "FMI | 2.0 | 3.0", {"a": path})


@mostly_together
def test_elements_of_arrays_can_be_faulty(run):
    units = {"d": "Dahlquist", "m": "Matrix", "n": "Matrix"}
    wires = [{"from": "d.x", "to": "m.u[2]"}, {"from": "m.y[*]", "to": "n.u[*]"}]
    faults = ["--fault", "d.x -> m: bias 1 from 0.5 s", "--fault", "m.y[1]: gain 3"]
    results = run(units, *faults, inputs={"m.u[1]": 10.0}, connections=wires)
    passed_on = results["d.x"] + (results.time >= 0.5)
    assert results["m.y[2]"] == pytest.approx(passed_on)
    for unit in "mn":
        assert results[f"{unit}.y[1]"] == pytest.approx(np.full(11, 30.0))
        assert results[f"{unit}.y[2]"] == pytest.approx(passed_on)


def test_check_shows_arrays_and_their_constants(go):
    status, said, _ = go({"m": "Matrix"}, command="check", inputs={"m.u[*]": 2.5})
    assert status == 0, said
    shown = [line.split() for line in said.splitlines()]
    assert ["u[1]", "2.5", "scenario", "m"] in shown
    assert ["u[2]", "2.5", "scenario", "m"] in shown
    assert mentions(said, "No errors")


LOOP = [{"from": "m.y[1]", "to": "n.u[1]"}, {"from": "n.y[1]", "to": "m.u[1]", "gain": 0.5}]
FEEDBACK = {"m": ("Matrix", {"parameters": {"A[1,2]": 1.0}}), "n": "Matrix"}


def delayed(wire):
    return wire | {"delay": "1 step"}


@together_and_apart
@each_algorithm
@pytest.mark.sampled(3)
def test_a_declared_delay_breaks_an_algebraic_loop(by_both_loops, fails, algorithm):
    inputs = {"m.u[2]": 1.0, "n.u[2]": 0.0}
    fails(2, "delay: 1 step", FEEDBACK, inputs=inputs, connections=LOOP)
    wires = [LOOP[0], delayed(LOOP[1])]
    results = by_both_loops(FEEDBACK, inputs=inputs, connections=wires, algorithm=algorithm)
    m, n = results["m.y[1]"], results["n.y[1]"]
    assert m[0] == n[0] == 1.0  # from the start value, 0
    assert m[1:].tolist() == (0.5 * n[:-1] + 1.0).tolist()
    assert n[1:].tolist() == (m[:-1] if algorithm == "jacobi" else m[1:]).tolist()
    assert [wire.delay for wire in results.record.connections] == ["1 step", None]


@pytest.mark.sampled(6)
@each_algorithm
@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 1), (1, 2), (3, 2)])
def test_a_delayed_wire_brings_the_value_of_one_communication_step_before(run, algorithm, n, m):
    units = {"d": ("Dahlquist", {"step_size": n / 10}), "m": ("Matrix", {"step_size": m / 10})}
    wires = [delayed({"from": "d.x", "to": "m.u[1]"})]
    results = run(units, inputs={"m.u[2]": 0.0}, connections=wires, algorithm=algorithm, stop_time=1.2)
    stepped = np.arange(m, 13, m)
    assert results["m.y[1]"][0] == 0.0
    earlier = stepped - (m if algorithm == "jacobi" else 1)
    assert results["m.y[1]"][stepped].tolist() == results["d.x"][earlier].tolist()


@pytest.mark.parametrize(
    ("source", "target", "delay", "command", "names"),
    [
        ("d.x", "m.u[1]", "2 steps", "check", "s.yaml:1 | connections[0].delay | '1 step' | '2 steps'"),
        ("e.Int8_out", "f.Int8_in", "1 step", "check", "s.yaml:1 | connections[0] | Real | f.Int8_in"),
        (["d", "e"], "m.u[*]", "1 step", "check", "s.yaml:1 | connections[0] | instance.variable"),
        ("d.x", "m.u[1]", "1 step", "export-ssp", "s.ssp | m.u[1]"),
    ],
)
def test_a_delay_that_cannot_be_is_refused(fails, tmp_path, source, target, delay, command, names):
    units = {"d": "Dahlquist", "m": "Matrix", "e": "Every", "f": "Every"}
    inputs = rest("f.Int8_in" if "f" in target else "", "e.Float64_in", "f.Float64_in", units="ef")
    inputs |= {name: 0.0 for name in ("m.u[1]", "m.u[2]") if name != target}
    wires = [{"from": source, "to": target, "delay": delay}]
    where = ["--out", str(tmp_path / "s.ssp")] if command == "export-ssp" else []
    fails(2, names, units, *where, command=command, inputs=inputs, connections=wires)


def test_check_lists_delays(go):
    inputs = {"m.u[2]": 1.0, "n.u[2]": 0.0}
    wires = [LOOP[0], delayed(LOOP[1])]
    status, said, _ = go(FEEDBACK, command="check", inputs=inputs, connections=wires)
    assert status == 0, said
    rows = [line.split() for line in said.splitlines()]
    assert ["n.y[1]", "m.u[1]", "0"] in rows
    assert mentions(said, "Delayed", "step")
