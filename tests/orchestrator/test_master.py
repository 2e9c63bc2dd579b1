import math
from fractions import Fraction

import numpy as np
import pytest

from tests.orchestrator.fakes import (
    Behaviour,
    Clock,
    Echo,
    Function,
    Integrator,
    Mass,
    Mixed,
    Stage,
    Witness,
    make_plan,
)
from tests.refusals import refused
from yawbench.foundation.errors import SimulationError
from yawbench.orchestrator.master import step_loop, step_program
from yawbench.orchestrator.master.simulate import simulate
from yawbench.orchestrator.results.reader import load_results


def run(units, wires, out, **options):
    """Simulate fake units and return their slaves and the results."""
    stage = Stage(units)
    simulate(make_plan(units, wires, **options), out, opener=stage)
    return stage.slaves, load_results(out)


def spring():
    return Function(lambda t, u: {"force": -4.0 * u["x"]}, ["x"], ["force"])


LOOP = ["mass.x -> spring.x", "spring.force -> mass.force"]
BOTH = ["source.x -> target.middle", "source.x -> target.end"]
each_algorithm = pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel", "extrapolated"])
each_order = pytest.mark.parametrize("turn", [False, True], ids=["in order", "turned"])


def in_turn(turn, **units):
    """Return units in their order or the other way round."""
    return dict(reversed(units.items())) if turn else units


def oscillator_error(algorithm, turn, periods, n, out):
    """Return the largest error of cos(2 t) over two seconds in n steps, where all units are up to date."""
    units = in_turn(turn, mass=Mass(), spring=spring())
    keys = {"step": Fraction(2, n), "n_steps": n, "algorithm": algorithm, "periods": periods}
    _, results = run(units, LOOP, out, **keys)
    return float(np.abs(results["mass.x"] - np.cos(2.0 * results.time))[::4].max())


@each_order
@pytest.mark.parametrize(
    "periods",
    [{}, {"spring": 2}, {"mass": 2}, {"mass": 4, "spring": 2}, {"mass": 2, "spring": 4}],
    ids=lambda p: " ".join(f"{k}={v}" for k, v in p.items()) or "one rate",
)
def test_extrapolated_is_second_order_in_any_order_and_at_any_rate(turn, periods, tmp_path):
    coarse, fine = (oscillator_error("extrapolated", turn, periods, n, tmp_path) for n in (400, 800))
    assert math.log2(coarse / fine) == pytest.approx(2.0, abs=0.05)
    assert fine < 6e-4


@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel"])
def test_holding_values_is_first_order(algorithm, tmp_path):
    coarse, fine = (oscillator_error(algorithm, False, {}, n, tmp_path) for n in (400, 800))
    assert math.log2(coarse / fine) == pytest.approx(1.0, abs=0.05)


@each_order
@pytest.mark.parametrize(("n", "m"), [(1, 1), (5, 1), (1, 5), (2, 4), (4, 2), (2, 3), (3, 2)])
def test_a_linear_signal_arrives_exactly_at_the_middle_and_the_end_of_the_step(n, m, turn, tmp_path):
    witness = Witness()
    units = in_turn(turn, source=Clock(x=lambda t: 3.0 + 2.0 * t), target=witness)
    run(units, BOTH, tmp_path, step="1/8", n_steps=60, periods={"source": n, "target": m})
    assert len(witness.seen) == 60 // m
    settled = [seen for seen in witness.seen if seen[0] >= (2 * n + m) / 8]
    assert settled
    for t, h, middle, end in settled:
        assert middle == pytest.approx(3.0 + 2.0 * (t + h / 2), abs=1e-12)
        assert end == pytest.approx(3.0 + 2.0 * (t + h), abs=1e-12)


@each_algorithm
def test_periods_without_a_common_factor_keep_few_programs_and_change_no_number(
    algorithm, tmp_path, monkeypatch
):
    made = []

    def programs(memory):
        made.append(step_program.StepProgram(memory))
        return made[-1]

    def positions():
        units = {"mass": Mass(), "spring": spring(), "late": Integrator(), "clock": Clock(y=math.cos)}
        keys = {"step": "1/512", "n_steps": 400, "periods": {"mass": 3, "spring": 7, "late": 11}}
        _, results = run(units, [*LOOP, "mass.v -> late.rate"], tmp_path, algorithm=algorithm, **keys)
        return results["mass.x"], results["late.x"]

    monkeypatch.setattr(step_loop, "StepProgram", programs)
    usual = positions()
    monkeypatch.setattr(step_program, "KEPT", 5)
    few = positions()
    assert (made[0].cycle, len(made[0]._made), len(made[1]._made)) == (231, 231, 5)
    assert len(made[1]._gathers) <= 5
    assert all(np.array_equal(a, b) for a, b in zip(usual, few, strict=True))


def test_the_first_step_holds_what_has_no_history(tmp_path):
    witness = Witness()
    units = {"target": witness, "source": Clock(x=lambda t: 3.0 + 2.0 * t)}
    run(units, BOTH, tmp_path, step="1/8", n_steps=2)
    assert witness.seen[0] == (0.0, 0.125, 3.0, 3.0)


class Sampler(Behaviour):
    """A controller that samples: u = -gain x, held until its next step."""

    inputs = ("x",)
    outputs = {"u": ("x",)}
    discrete = True

    def output(self, t, u):
        return {"u": -3.0 * u["x"]}


@each_order
def test_a_sampled_controller_gives_the_exact_sampled_data_solution(turn, tmp_path):
    units = in_turn(turn, plant=Integrator(), controller=Sampler())
    wires = ["plant.x -> controller.x", "controller.u -> plant.rate"]
    _, results = run(units, wires, tmp_path, step="1/100", n_steps=200, periods={"controller": 10})
    exact = (1.0 - 3.0 * 0.1) ** np.arange(21)  # x_k+1 = x_k + T u_k
    np.testing.assert_allclose(results["plant.x"][::10], exact, atol=1e-13)


def test_a_discrete_source_is_taken_as_it_was_in_force(tmp_path):
    witness = Witness()
    steps = Clock(x=lambda t: round(8 * t))
    steps.discrete = True
    run({"source": steps, "target": witness}, BOTH, tmp_path, step="1/8", n_steps=4, periods={"source": 2})
    assert [seen[2:] for seen in witness.seen] == [(0.0, 0.0), (0.0, 2.0), (2.0, 2.0), (2.0, 4.0)]


def test_jacobi_takes_all_inputs_before_anything_moves(tmp_path):
    chain = {
        "a": Clock(x=lambda t: 8 * t),
        "b": Function(lambda t, u: {"y": u["x"]}, ["x"], ["y"]),
        "c": Function(lambda t, u: {"y": u["x"]}, ["x"], ["y"]),
    }
    _, results = run(chain, ["a.x -> b.x", "b.y -> c.x"], tmp_path, step="1/8", n_steps=4, algorithm="jacobi")
    assert results["b.y"].tolist() == [0, 0, 1, 2, 3]
    assert results["c.y"].tolist() == [0, 0, 0, 1, 2]


@pytest.mark.parametrize(
    ("algorithm", "taken", "published"),
    [
        ("jacobi", [0.0, 3.0, 6.0], [0, 0, 0, 0, 0, 0, 3, 3, 3, 6]),
        ("gauss_seidel", [3.0, 6.0, 9.0], [0, 0, 0, 3, 3, 3, 6, 6, 6, 9]),
    ],
)
def test_a_slow_unit_steps_by_its_period_and_publishes_at_its_end(algorithm, taken, published, tmp_path):
    """It takes inputs at the start of its step under Jacobi, at the end under Gauss-Seidel."""
    witness = Witness()
    units = {"source": Clock(x=lambda t: 8 * t), "target": witness}
    keys = {"step": "1/8", "n_steps": 9, "algorithm": algorithm, "periods": {"target": 3}}
    _, results = run(units, BOTH, tmp_path, **keys)
    assert witness.seen == [(k * 0.375, 0.375, x, x) for k, x in enumerate(taken)]
    assert results["target.y"].tolist() == published


@each_algorithm
def test_one_set_one_step_one_get_per_unit_and_step(algorithm, tmp_path):
    slaves, _ = run({"mass": Mass(), "spring": spring()}, LOOP, tmp_path, n_steps=7, algorithm=algorithm)
    for slave in slaves.values():
        after = [call[0] for call in slave.calls[slave.calls.index(("exit",)) :]]
        assert after.count("set") == after.count("step") == 7


@pytest.mark.parametrize("step", ["1/1000", "7/30000"])
def test_time_is_the_correctly_rounded_multiple_of_the_step(step, tmp_path):
    slaves, results = run({"a": Clock(x=math.sin)}, [], tmp_path, step=step, n_steps=1000)
    step = Fraction(step)
    assert results.time.tolist() == [float(k * step) for k in range(1001)]
    assert [c for c in slaves["a"].calls if c[0] == "step"] == [
        ("step", float(k * step), float(step)) for k in range(1000)
    ]


def test_constants_are_set_once_and_never_again(tmp_path):
    unit = Function(lambda t, u: {"y": 2 * u["mu"]}, ["mu"], ["y"])
    slaves, results = run({"a": unit}, [], tmp_path, constants={"a": {"mu": 0.65}})
    calls = slaves["a"].calls
    assert ("put", "Real", ("mu",), (0.65,)) in calls[: calls.index(("enter",))]
    assert "set" not in [call[0] for call in calls[calls.index(("exit",)) :]]
    assert results["a.y"].tolist() == [1.3] * 11


def test_what_nobody_needs_is_not_read(tmp_path):
    read = []

    class Slave(Clock):
        def output(self, t, u):
            read.append(t)
            return super().output(t, u)

    _, results = run({"a": Slave(x=math.sin)}, [], tmp_path, record=[])
    assert list(results) == []
    assert len(results.time) == 11
    assert read == [0.0]  # the fake's own, when it leaves initialization


def test_parameters_are_set_between_the_experiments_setup_and_initialization_mode(tmp_path):
    class Gain(Behaviour):
        parameters = {"gain": 1.0}
        outputs = {"y": ()}

        def output(self, t, u):
            return {"y": u["gain"]}

    slaves, results = run({"a": Gain()}, [], tmp_path, parameters={"a": {"gain": 5.0}})
    assert slaves["a"].calls[:3] == [("setup", 0.0, 1.0), ("put", "Real", ("gain",), (5.0,)), ("enter",)]
    assert results["a.y"].tolist() == [5.0] * 11


ROUND = ["a.y -> b.x", "b.y -> a.x"]


def round_trip(first, second=lambda t, u: {"y": u["x"]}):
    """Return two units in a loop."""
    return {"a": Function(first, ["x"], ["y"]), "b": Function(second, ["x"], ["y"])}


def test_initialization_goes_round_until_a_loop_agrees_to_the_last_bit(tmp_path):
    half = lambda t, u: {"y": 0.5 * u["x"] + 1.0}  # noqa: E731
    slaves, results = run(round_trip(half, half), ROUND, tmp_path, n_steps=1)
    assert results["a.y"][0] == results["b.y"][0] == 2.0
    assert slaves["a"].values["x"] == 2.0


def test_units_enter_initialization_with_the_outputs_of_those_before_them(tmp_path):
    units = {"a": Clock(x=lambda t: 25.0), "b": Function(lambda t, u: {"y": 1.0 / u["x"]}, ["x"], ["y"])}
    slaves, _ = run(units, ["a.x -> b.x"], tmp_path)
    calls = slaves["b"].calls
    assert calls[: calls.index(("enter",))] == [("setup", 0.0, 1.0), ("put", "Real", ("x",), (25.0,))]


def test_a_loop_that_does_not_settle_is_an_error_that_names_its_wires(tmp_path):
    names = ("100 passes", "b.y", "a.x", "6.33825e+29", "1.26765e+30", "a.y", "b.x", "2.5353e+30")
    with refused(SimulationError, "initialization-unsettled", names=names):
        run(round_trip(lambda t, u: {"y": 2.0 * u["x"] + 1.0}), ROUND, tmp_path)


def test_a_loop_that_flickers_in_its_last_digits_is_accepted(tmp_path):
    flips = iter([1.0, 1.0 + 1e-12] * 1000)
    _, results = run(round_trip(lambda t, u: {"y": next(flips) + 0.0 * u["x"]}), ROUND, tmp_path, n_steps=1)
    assert results["a.y"][0] == pytest.approx(1.0, abs=1e-11)


@pytest.mark.parametrize(("algorithm", "late"), [("jacobi", 1), ("gauss_seidel", 0), ("extrapolated", 0)])
def test_values_that_are_no_reals_travel_and_are_recorded(algorithm, late, tmp_path):
    _, results = run(
        {"a": Mixed(), "b": Echo()}, [f"a.{n} -> b.{n}_in" for n in Mixed.outputs], tmp_path,
        n_steps=5, algorithm=algorithm, record=["b.word", "b.x", "b.flag", "b.count", "b.mode"],
    )  # fmt: skip
    seen = [max(0, k - late) for k in range(6)]
    assert list(results) == ["b.word", "b.x", "b.flag", "b.count", "b.mode"]
    assert results["b.word"].tolist() == [f'"{k}", {k}' for k in seen]
    assert results["b.flag"].tolist() == [k % 2 for k in seen]
    assert results["b.count"].tolist() == seen
    assert results["b.mode"].tolist() == [k % 3 for k in seen]


def test_constants_of_any_type_reach_their_unit(tmp_path):
    constants = {"count_in": 3, "flag_in": True, "word_in": "dry", "mode_in": 2, "x_in": 0.5}
    _, results = run({"b": Echo()}, [], tmp_path, n_steps=1, constants={"b": constants})
    assert [results[f"b.{n}"][1] for n in Mixed.outputs] == [3, 1, "dry", 2, 0.5]


class Twice(Behaviour):
    """Writes down an input that is converted beside the same unconverted; integrates one of each."""

    inputs = ("plain", "scaled", "plain_end", "scaled_end")
    outputs = {"y": ("plain_end", "scaled_end")}

    def __init__(self):
        self.seen = []

    def advance(self, t, h, u):
        self.seen.append([u[name] for name in self.inputs])

    def output(self, t, u):
        return {"y": u["scaled_end"] - u["plain_end"]}


@each_algorithm
@each_order
@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 3)])
def test_a_converting_wire_gives_gain_times_what_a_plain_one_gives_plus_offset(
    algorithm, turn, n, m, tmp_path
):
    target = Twice()
    units = in_turn(turn, source=Clock(x=lambda t: math.sin(5.0 * t) - 0.3), target=target)
    plain = [f"source.x -> target.{name}" for name in ("plain", "plain_end")]
    scaled = [f"source.x -> target.{name} 57.3 -0.7" for name in ("scaled", "scaled_end")]
    keys = {"step": "1/8", "n_steps": 30, "algorithm": algorithm, "periods": {"source": n, "target": m}}
    _, results = run(units, plain + scaled, tmp_path, **keys)
    seen = np.array(target.seen)
    assert np.ptp(seen[:, 0]) > 0.5
    assert np.array_equal(seen[:, 1], 57.3 * seen[:, 0] - 0.7)
    assert np.array_equal(seen[:, 3], 57.3 * seen[:, 2] - 0.7)
    assert results["target.y"][0] == 57.3 * -0.3 - 0.7 + 0.3  # from initialization on


@each_algorithm
def test_beside_a_converting_wire_others_keep_every_bit(algorithm, tmp_path):
    odd = [-0.0, 5e-324, 0.1, 1e300]
    units = {f"s{i}": Clock(x=lambda t, value=value: value) for i, value in enumerate(odd)}
    target = Function(lambda t, u: {"y": 0.0}, ["a", "b", "c", "d", "e"], ["y"])
    wires = [f"s{i}.x -> target.{name}" for i, name in enumerate("abcd")] + ["s2.x -> target.e 2 1"]
    slaves, _ = run(units | {"target": target}, wires, tmp_path, n_steps=3, algorithm=algorithm)
    sets = [call[1:] for call in slaves["target"].calls if call[0] == "set"]
    assert len(sets) >= 3
    assert all(list(map(repr, values)) == [*map(repr, odd), "1.2"] for values in sets)


def test_a_whole_number_is_converted_too_and_one_too_large_ends_the_run(tmp_path):
    units = {"source": Mixed(), "target": Echo()}
    wires = [f"source.{name} -> target.{name}_in" for name in Mixed.outputs if name != "count"]
    _, results = run(units, [*wires, "source.count -> target.count_in 3 -1"], tmp_path, n_steps=4)
    assert results["target.count"].tolist() == [-1, 2, 5, 8, 11]
    with refused(SimulationError, "value-too-large", names=("target", "count_in", "3000000000", "Integer")):
        run(units, [*wires, "source.count -> target.count_in 1e9 0"], tmp_path, n_steps=4)
