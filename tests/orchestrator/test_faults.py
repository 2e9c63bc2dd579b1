"""Faults of outputs and inputs in a run: closed forms, random numbers, and what they cost."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tests.orchestrator.fakes import Clock, Function, Integrator, Stage, Witness, make_plan
from tests.refusals import mentions
from yawbench.foundation.interrupts import StopFlag
from yawbench.orchestrator.fault_kinds import KINDS, CountedNoise, Fault, FaultLocation, FaultySignal
from yawbench.orchestrator.master.log import Log
from yawbench.orchestrator.master.simulate import simulate, simulate_in_memory
from yawbench.orchestrator.master.step_loop import Master
from yawbench.orchestrator.results.freshness import staleness
from yawbench.orchestrator.results.reader import load_results

ALGORITHMS = ("jacobi", "gauss_seidel", "extrapolated")
BEGIN, END, STEP = 1.0, 2.0, 1 / 8


def signal(t):
    """Return the true signal: a line, which `extrapolated` hands on exactly."""
    return 3.0 + 2.0 * t


FORMS: dict[str, tuple[float | None, Callable[[float, float], float]]] = {
    "bias": (0.5, lambda t, since: signal(t) + 0.5),
    "gain": (-3.0, lambda t, since: -3.0 * signal(t)),
    "drift": (0.7, lambda t, since: signal(t) + 0.7 * (t - BEGIN)),
    "freeze": (None, lambda t, since: signal(since)),
    "value": (-4.0, lambda t, since: -4.0),
    "delay": (0.3, lambda t, since: signal(t - 0.3)),
    "saturation": (5.5, lambda t, since: min(signal(t), 5.5)),
    "loss": (0.75, lambda t, since: 0.25 * signal(t)),
    "stuck": (None, lambda t, since: signal(since)),
}
"""Kind of which nothing is random -> value, and the faulty signal at t, faulty since an instant."""
RANDOM = sorted(KINDS.keys() - FORMS.keys())


WIRES = ["source.x -> target.middle", "source.x -> target.end"]


def faulty(kind, *, of_output, variable=None, **given):
    unit, name = ("source", "x") if of_output else ("target", variable)
    return on(unit, name, of_output, kind, **{"begin": BEGIN, "end": END, **given})


def on(unit, name, of_output, kind, value=None, stream=0, **given):
    """Return a fault on a signal, with its value in the signal's unit."""
    fault = Fault(FaultLocation(unit, name), kind, value, **given)
    return FaultySignal(fault, unit, name, of_output, value, stream)


def disturbance(signal, *, held):
    return KINDS[signal.fault.kind].disturbance(signal, held)


def witnessed(faults, algorithm, *, periods=None, step="1/8", n_steps=24, source=signal):
    """Return what a unit got from a faulty source, and what was recorded of this."""
    witness = Witness()
    units = {"source": Clock(x=source), "target": witness}
    made = make_plan(
        units, WIRES, step=step, n_steps=n_steps, algorithm=algorithm, periods=periods, faults=faults
    )
    return witness.seen, simulate_in_memory(made, opener=Stage(units))


def expected(kind, times):
    """Return the faulty signal in closed form at increasing instants."""
    _, form = FORMS[kind]
    since = next(t for t in times if t >= BEGIN)
    return [form(t, since) if BEGIN <= t < END else signal(t) for t in times]


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("period", [1, 3])
@pytest.mark.parametrize("kind", FORMS)
def test_a_faulty_input_follows_the_closed_form_and_the_results_keep_the_truth(kind, algorithm, period):
    value = FORMS[kind][0]
    faults = [faulty(kind, of_output=False, variable=name, value=value) for name in ("middle", "end")]
    seen, recorded = witnessed(faults, algorithm, periods={"target": period})
    assert recorded["source.x"] == pytest.approx(signal(recorded.time), abs=1e-12)
    steps = [(t, h) for t, h, _, _ in seen]
    ends = {"jacobi": (0.0, 0.0), "gauss_seidel": (1.0, 1.0), "extrapolated": (0.5, 1.0)}[algorithm]
    for got, part in zip(([s[2] for s in seen], [s[3] for s in seen]), ends, strict=True):
        settled = slice(2, None)  # `extrapolated` has two samples by then
        assert got[settled] == pytest.approx(expected(kind, [t + part * h for t, h in steps])[settled])


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("period", [1, 3])
@pytest.mark.parametrize("kind", FORMS)
def test_a_faulty_output_follows_the_closed_form_in_the_results_and_for_who_takes_it(kind, algorithm, period):
    faults = [faulty(kind, of_output=True, value=FORMS[kind][0])]
    seen, recorded = witnessed(faults, algorithm, periods={"source": period})
    samples = recorded.time[::period]
    assert recorded["source.x"][::period] == pytest.approx(expected(kind, samples.tolist()))
    at = recorded["source.x"][:-1] if algorithm == "jacobi" else recorded["source.x"][1:]
    if period == 1:
        assert [end for *_, end in seen] == pytest.approx(at.tolist())


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_fault_from_the_start_also_holds_at_initialization(algorithm):
    whole = {"begin": -math.inf, "end": math.inf}
    _, biased = witnessed([faulty("bias", of_output=True, value=0.5, **whole)], algorithm)
    assert biased["source.x"] == pytest.approx(signal(biased.time) + 0.5)
    _, frozen = witnessed([faulty("freeze", of_output=True, **whole)], algorithm)
    assert (frozen["source.x"] == 3.0).all()
    late = [faulty("delay", of_output=True, value=0.5, **whole)]
    _, delayed = witnessed(late, algorithm)
    assert delayed["source.x"] == pytest.approx(signal(np.maximum(delayed.time - 0.5, 0.0)))
    _, passed = witnessed([faulty("gain", of_output=False, variable="end", value=2.0, **whole)], algorithm)
    assert passed["target.y"][0] == 2 * signal(0.0)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_loop_with_a_faulty_wire_settles_at_the_start_and_moves_as_its_equation_says(algorithm):
    units = {"state": Integrator(), "law": Function(lambda t, u: {"rate": -u["x"]}, ["x"], ["rate"])}
    options = {"step": "1/1000", "n_steps": 500, "faults": [on("law", "x", False, "bias", 0.5)]}
    made = make_plan(units, ["state.x -> law.x", "law.rate -> state.rate"], algorithm=algorithm, **options)
    results = simulate_in_memory(made, opener=Stage(units))
    exact = -0.5 + 1.5 * np.exp(-results.time)  # x' = -(x + 0.5)
    tolerance = 1e-6 if algorithm == "extrapolated" else 2e-3
    assert results["law.rate"][0] == -1.5
    assert np.abs(results["state.x"] - exact).max() < tolerance


def test_faults_of_one_signal_act_one_after_the_other():
    both = [faulty("gain", of_output=True, value=2.0), faulty("bias", of_output=True, value=1.0)]
    _, recorded = witnessed(both, "jacobi")
    inside = (recorded.time >= BEGIN) & (recorded.time < END)
    truth = signal(recorded.time)
    assert recorded["source.x"] == pytest.approx(np.where(inside, 2 * truth + 1, truth))


def test_a_sampled_signal_that_is_late_stays_a_staircase():
    late = disturbance(on("a", "x", True, "delay", 0.15), held=True)
    seen = [late(k / 10, float(k)) for k in range(6)]
    assert seen == [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]


# Random numbers


def drawn(kind, n=4000, step=0.01, x=lambda t: 0.0, **given):
    """Return what becomes of a signal at every step."""
    made = on("a", "x", True, kind, **{"every": 0.01, "stream": 7, **given})
    disturb = disturbance(made, held=False)
    return np.array([disturb(k * step, x(k * step)) for k in range(n)])


def test_noise_has_its_deviation_and_no_memory():
    x = drawn("noise", value=0.2)
    assert np.mean(x) == pytest.approx(0.0, abs=4 * 0.2 / math.sqrt(x.size))
    assert np.std(x) == pytest.approx(0.2, rel=4 / math.sqrt(2 * x.size))
    assert np.mean(x[1:] * x[:-1]) == pytest.approx(0.0, abs=4 * 0.04 / math.sqrt(x.size))


def test_noise_is_the_same_for_any_step_and_holds_from_message_to_message():
    fine, coarse = drawn("noise", value=0.2, step=0.001), drawn("noise", value=0.2, n=400)
    assert (fine.reshape(-1, 10) == coarse[:, None]).all()
    assert np.unique(coarse).size == coarse.size


def test_outliers_are_a_share_of_the_messages_up_and_down():
    x = drawn("outlier", value=3.0, share=0.1)
    assert set(x) == {0.0, 3.0, -3.0}
    assert np.mean(x != 0) == pytest.approx(0.1, abs=4 * math.sqrt(0.09 / x.size))
    assert np.mean(x > 0) == pytest.approx(0.05, abs=4 * math.sqrt(0.05 / x.size))


def test_a_lost_message_is_the_last_value_before_it():
    x = drawn("dropout", share=0.3, x=lambda t: t)
    times = np.arange(x.size) * 0.01
    lost = x != times
    assert np.mean(lost) == pytest.approx(0.3, abs=4 * math.sqrt(0.21 / x.size))
    assert (x == np.maximum.accumulate(np.where(lost, 0.0, times))).all()


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("kind", RANDOM)
def test_what_is_random_disturbs_a_run_as_it_is_drawn(kind, algorithm):
    given = {"value": None if kind == "dropout" else 0.2, "share": 0.4, "every": 0.25, "stream": 3}
    _, recorded = witnessed([faulty(kind, of_output=True, **given)], algorithm)
    alone = disturbance(faulty(kind, of_output=True, **given), held=False)
    assert recorded["source.x"].tolist() == [alone(t, signal(t)) for t in recorded.time.tolist()]
    assert (recorded["source.x"] != signal(recorded.time)).any()


def test_numbers_are_those_of_their_message_whatever_was_asked_before():
    def noise(stream):
        fault = on("a", "x", True, "noise", 1.0, every=0.01, stream=stream)
        return CountedNoise(fault, lambda made: made.standard_normal(1024)).at

    times = [-0.02, 0.0, 0.07, 0.29, 12.0, 1e6]
    forth, back = noise(2**63 + 5), noise(2**63 + 5)
    assert [forth(t) for t in times] == [back(t) for t in reversed(times)][::-1]
    assert noise(1)(0.0) != forth(0.0)


# Records


def test_the_record_says_what_was_faulty_and_results_are_known_to_be_of_another_fault(tmp_path):
    units = {"source": Clock(x=signal), "target": Witness()}
    made = make_plan(units, WIRES, faults=[faulty("freeze", of_output=True)])
    healthy = replace(made, faults=())
    simulate(made, tmp_path, opener=Stage(units))
    (noted,) = load_results(tmp_path).record.content()["faults"]
    what = {"on": "source.x", "fault": "freeze from 1 s until 2 s"}
    assert noted == what | {"from": 1.0, "until": 2.0, "at": ["source.x"]}
    assert staleness(made, tmp_path) is None
    assert mentions(staleness(healthy, tmp_path), "faults")
    simulate(healthy, tmp_path / "healthy", opener=Stage(units))
    assert "faults" not in load_results(tmp_path / "healthy").record.content()


# What it costs


@pytest.mark.parametrize(
    ("kinds", "compiled"),
    [
        ([], []), (["bias"], [True]), (["gain", "loss"], [True]),
        (["freeze"], [False]), (["bias", "saturation"], [False]),
    ],
)  # fmt: skip
def test_the_compiled_loop_makes_faults_by_itself_if_all_of_a_unit_are_linear(kinds, compiled):
    units = {"source": Clock(x=signal), "target": Witness()}
    faults = [faulty(kind, of_output=True, value=0.5) for kind in kinds]
    made, log = make_plan(units, WIRES, algorithm="jacobi", faults=faults), Log()
    slaves = {unit.name: Stage(units)(unit, log, set()) for unit in made.instances}
    program = Master(made, slaves, log, StopFlag()).program.at(1)
    assert [op.data is not None for op in program if op.kind == "fault"] == compiled
