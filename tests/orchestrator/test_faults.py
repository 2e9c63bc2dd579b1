"""Faults of outputs and inputs against closed forms; what a scenario, an option and a file say of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex

import yawbench as yb
from orchestrator.cli import main
from orchestrator.commands.experiments import command_of
from orchestrator.errors import ScenarioError, YawbenchError
from orchestrator.experiments.experiment import load_experiment
from orchestrator.fault_kinds import KINDS, CountedNoise, Fault, FaultLocation, FaultySignal
from orchestrator.figures.panels import FAULTY, LabelledRun
from orchestrator.figures.plots import draw
from orchestrator.interrupts import StopFlag
from orchestrator.master.process_state import Log
from orchestrator.master.simulate import simulate, simulate_in_memory
from orchestrator.master.step_loop import Master
from orchestrator.plan import Override
from orchestrator.results.freshness import key_of, staleness
from orchestrator.results.reader import load_results
from orchestrator.scenario.loader import load_scenario
from orchestrator.scenario.overrides import read_changes
from orchestrator.wiring.make_plan import make_plan as plan_of_scenario
from tests.sentences import golden, golden_in, texts_of

from .fake_fmus import Var, make_fmu, out
from .fakes import Clock, Function, Integrator, Stage, Witness, make_plan
from .recorded import car, noted

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
RANDOM = {"noise", "dropout", "outlier"}


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


def test_every_kind_has_a_closed_form_or_is_random_and_tested_as_such():
    assert FORMS.keys() | RANDOM == KINDS.keys()
    assert not FORMS.keys() & RANDOM


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
    fault = on("law", "x", False, "bias", 0.5)
    made = make_plan(
        units, ["state.x -> law.x", "law.rate -> state.rate"], step="1/1000", n_steps=2000,
        algorithm=algorithm, faults=[fault],
    )  # fmt: skip
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
@pytest.mark.parametrize("kind", sorted(RANDOM))
def test_what_is_random_disturbs_a_run_as_it_is_drawn(kind, algorithm):
    given = {"value": None if kind == "dropout" else 0.2, "share": 0.4, "every": 0.25, "stream": 3}
    _, recorded = witnessed([faulty(kind, of_output=True, **given)], algorithm)
    alone = disturbance(faulty(kind, of_output=True, **given), held=False)
    assert recorded["source.x"].tolist() == [alone(t, signal(t)) for t in recorded.time.tolist()]
    assert (recorded["source.x"] != signal(recorded.time)).any()


def test_numbers_are_those_of_their_message_whatever_was_asked_before():
    fault = on("a", "x", True, "noise", 1.0, every=0.01, stream=2**63 + 5)
    forth, back = (CountedNoise(fault, lambda made: made.standard_normal(1024)) for _ in range(2))
    times = [-0.02, 0.0, 0.07, 0.29, 12.0, 1e6]
    assert [forth.at(t) for t in times] == [back.at(t) for t in reversed(times)][::-1]
    assert CountedNoise(replace(fault, stream=1), lambda made: made.standard_normal(1024)).at(
        0.0
    ) != forth.at(0.0)


# What it costs


def operations(faults, algorithm):
    units = {"source": Clock(x=signal), "target": Witness()}
    made = make_plan(units, WIRES, algorithm=algorithm, faults=faults)
    stage = Stage(units)
    log = Log()
    slaves = {unit.name: stage(unit, log, set()) for unit in made.instances}
    return [(op.instance, op.kind) for op in Master(made, slaves, log, StopFlag()).program.at(1)]


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_step_has_one_operation_more_for_a_unit_with_faults_and_none_without(algorithm):
    without = operations([], algorithm)
    assert "fault" not in {kind for _, kind in without}
    inputs = [faulty("bias", of_output=False, variable=name, value=1.0) for name in ("middle", "end")]
    for faults, unit, follows in (
        (inputs, "target", "gather"),
        ([faulty("freeze", of_output=True)], "source", "get"),
    ):
        given = operations(faults, algorithm)
        at = given.index((unit, "fault"))
        assert given[:at] + given[at + 1 :] == without
        assert given[at - 1][1] == follows


# Scenarios

SCENARIO = """\
title: Faulty
stop_time: 2
step_size: 10 ms
units:
  plant: {fmu: plant_a}
  gyro: {fmu: sensor_a}
  law: {fmu: controller_a}
connections:
  - {from: plant.yaw_rate, to: gyro.yaw_rate_true}
  - {from: [gyro], to: [law]}
"""


@pytest.fixture
def folder(cache, tmp_path, monkeypatch):
    """A working directory with a scenario, `a.yaml`, and its FMUs."""
    monkeypatch.chdir(tmp_path)
    make_fmu(
        tmp_path / "fmus/plant_a.fmu",
        inputs=[Var("yaw_moment", "N.m")],
        outputs=[out("yaw_rate", unit="rad/s"), out("slip_*"), Var("gear", type="Integer", start=1)],
    )
    make_fmu(
        tmp_path / "fmus/sensor_a.fmu",
        inputs=[Var("yaw_rate_true", "rad/s")],
        outputs=[out("yaw_rate", unit="rad/s", variability="discrete")],
    )
    make_fmu(
        tmp_path / "fmus/controller_a.fmu",
        inputs=[Var("yaw_rate", "rad/s"), Var("friction", optional=True, start=1.0)],
        outputs=[out("yaw_moment", "yaw_rate", unit="N.m")],
    )
    (tmp_path / "a.yaml").write_text(SCENARIO)
    return tmp_path


def planned(*faults, text=SCENARIO, changes=()):
    Path("a.yaml").write_text(text)
    return plan_of_scenario(load_scenario("a.yaml", changes=(*changes, *read_changes(faults=faults))))


def test_an_option_and_a_file_say_the_same(folder):
    text = SCENARIO + (
        "faults:\n  - {on: gyro.yaw_rate, kind: freeze, from: 0.5, until: 1.5}\n"
        "  - {on: plant.yaw_rate -> gyro, kind: noise, value: 0.5 deg/s, seed: 3, every: 20 ms}\n"
    )
    by_file = planned(text=text)
    by_option = planned(
        "gyro.yaw_rate: freeze from 0.5 s until 1500 ms",
        "plant.yaw_rate->gyro: noise 0.5 deg/s seed 3 every 0.02",
    )
    assert by_file.faults == by_option.faults
    frozen, noisy = by_file.faults
    assert frozen == on("gyro", "yaw_rate", True, "freeze", begin=0.5, end=1.5)
    assert str(frozen.fault.on) == "gyro.yaw_rate"
    assert golden(str(frozen.fault))
    assert (noisy.instance, noisy.variable, noisy.of_output, noisy.fault.every) == (
        "gyro",
        "yaw_rate_true",
        False,
        0.02,
    )
    assert noisy.value == pytest.approx(math.radians(0.5))
    assert by_file.changes == ()
    assert golden(str(by_option.changes[0]))


def test_an_option_takes_the_place_of_what_the_file_has_there(folder):
    text = SCENARIO + (
        "faults:\n  - {on: gyro.yaw_rate, kind: freeze}\n  - {on: plant.yaw_rate, kind: gain, value: 2}\n"
    )
    made = planned("gyro.yaw_rate: bias 1; drift 0.1", "gyro.yaw_rate: loss", text=text)
    assert [(str(f.fault.on), f.fault.kind, f.value) for f in made.faults] == [
        ("plant.yaw_rate", "gain", 2.0), ("gyro.yaw_rate", "bias", 1.0), ("gyro.yaw_rate", "drift", 0.1),
        ("gyro.yaw_rate", "loss", 1.0),
    ]  # fmt: skip
    assert [str(f.fault.on) for f in planned("gyro.yaw_rate: none", text=text).faults] == ["plant.yaw_rate"]
    assert planned("gyro.yaw_rate: freeze", text=text).changes == ()


def test_a_pattern_stands_for_several_and_each_has_random_numbers_of_its_own(folder):
    made = planned("plant.slip_*: noise 0.1 seed 1")
    assert [f.variable for f in made.faults] == ["slip_fl", "slip_fr", "slip_rl", "slip_rr"]
    assert len({f.stream for f in made.faults}) == 4
    assert {f.stream for f in planned("plant.slip_*: noise 0.1 seed 2").faults}.isdisjoint(
        f.stream for f in made.faults
    )
    more = planned("plant.yaw_rate: noise 0.1", "plant.slip_*: noise 0.1 seed 1")
    assert {f.stream for f in made.faults} < {f.stream for f in more.faults}


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        ("gyro.yaw_rate", "write --fault 'INSTANCE.OUTPUT: KIND VALUE from TIME until TIME'"),
        ("gyro.yaw_rte: freeze", "gyro has neither an output nor an input 'yaw_rte'; did you mean"),
        ("gyr.yaw_rate: freeze", "there is no instance 'gyr'; did you mean 'gyro'?"),
        ("gyro yaw_rate: freeze", "must be instance.output, instance.input or instance.output -> instance,"),
        ("plant.yaw_rate -> law: freeze", "no wire leads from plant.yaw_rate to law; it goes to gyro"),
        ("plant.yaw_rat -> gyro: freeze", "no wire leads from plant.yaw_rat to gyro; did you mean"),
        ("law.yaw_moment -> gyro: freeze", "no wire leads from law.yaw_moment to gyro; it goes to plant"),
        ("gyro.yaw_rate -> plant: freeze", "no wire leads from gyro.yaw_rate to plant; it goes to law"),
        ("law.friction: bias 1", "on no wire: faults of inputs act on outputs of instances"),
        ("plant.gear: freeze", "plant.gear is Integer: faults are for Real"),
        ("gyro.yaw_rate: freez", "must be 'bias', 'gain', 'drift', 'noise', 'freeze'"),
        ("gyro.yaw_rate: bias", "bias needs a value: x + value"),
        ("gyro.yaw_rate: freeze 3", "freeze takes no value"),
        ("gyro.yaw_rate: freeze seed 3", "freeze takes no seed: nothing of it is random"),
        ("gyro.yaw_rate: bias 1 share 0.5", "bias takes no share"),
        ("gyro.yaw_rate: dropout", "dropout needs a share of the messages"),
        ("gyro.yaw_rate: dropout share 0", "a share must be above 0 and at most 1 (got 0)"),
        ("gyro.yaw_rate: noise 1 seed -1", "greater than or equal to 0"),
        ("gyro.yaw_rate: noise -1", "gyro.yaw_rate: noise must be at least 0 rad/s"),
        ("gyro.yaw_rate: loss 2", "gyro.yaw_rate: loss must be at least 0 and at most 1"),
        ("gyro.yaw_rate: bias 3 kg", "'3 kg' is not a value in rad/s: use rad/s, deg/s or rpm"),
        ("gyro.yaw_rate: drift 3 deg/s", "'3 deg/s' is not a value in (rad/s)/s"),
        ("gyro.yaw_rate: freeze from 2 s until 1 s", "until must be after from, 2 s (got 1 s)"),
        ("gyro.yaw_rate: freeze from 1 s from 2 s", "has from twice"),
        ("gyro.yaw_rate: freeze from soon", "'soon' is neither a number in s nor a number with its unit"),
    ],
)  # fmt: skip
def test_a_fault_that_cannot_be_is_one_sentence(fault, sentence, folder):
    with pytest.raises(YawbenchError) as caught:
        planned(fault)
    (problem,) = texts_of(caught.value)
    assert str(problem).startswith(f"--fault {fault}: ")
    assert sentence in str(problem)


def test_a_fault_of_a_file_is_told_with_its_line_also_after_an_option_has_moved_it(folder):
    text = SCENARIO + "faults:\n  - {on: gyro.yaw_rate, kind: freeze}\n  - {on: plant.yaw_rate, kind: gain}\n"
    with pytest.raises(ScenarioError) as caught:
        planned("gyro.yaw_rate: none", text=text)
    assert caught.value.code == "value-invalid"
    assert golden([str(p) for p in texts_of(caught.value)])


def test_what_a_fault_never_reaches_is_noted(folder):
    assert golden_in(texts_of(planned("gyro.yaw_rate: freeze from 3 s")))
    make_fmu(Path("fmus/controller_off.fmu"), outputs=[out("yaw_moment", unit="N.m")])
    without = SCENARIO.replace("  - {from: [gyro], to: [law]}\n", "")
    gone = planned("gyro.yaw_rate -> law: freeze", text=without,
                   changes=[Override.of("law", "controller_off", "--swap")])  # fmt: skip
    assert gone.faults == ()
    assert golden_in(texts_of(gone))


def test_a_run_with_a_fault_is_another_run(folder):
    keys = [key_of(planned(*f)) for f in ([], ["gyro.yaw_rate: freeze"], ["gyro.yaw_rate -> law: freeze"])]
    assert len(set(keys)) == 3
    assert keys[0] == key_of(planned())


def test_the_record_says_what_was_faulty_and_results_are_known_to_be_of_another_fault(tmp_path):
    units = {"source": Clock(x=signal), "target": Witness()}
    frozen = faulty("freeze", of_output=True)
    made = make_plan(units, WIRES, faults=[frozen])
    simulate(made, tmp_path, opener=Stage(units))
    assert golden(load_results(tmp_path).record.content()["faults"])
    assert staleness(made, tmp_path) is None
    assert golden(staleness(replace(made, faults=()), tmp_path))
    simulate(replace(made, faults=()), tmp_path / "healthy", opener=Stage(units))
    assert "faults" not in load_results(tmp_path / "healthy").record.content()


CAMPAIGN = """\
title: Campaign
scenario: a.yaml
faults: [{on: plant.yaw_rate, kind: gain, value: 1.1}]
axes:
  gyro:
    vary: faults.gyro.yaw_rate
    values: {none: healthy, freeze from 1 s: frozen, "bias 1 deg/s; noise 0.1": off}
  way:
    variants:
      clear: {}
      late: {faults: [{on: gyro.yaw_rate -> law, kind: delay, value: 20 ms}]}
metrics:
  rate: {metric: peak(plant.yaw_rate)}
"""


def test_faults_are_an_axis_of_an_experiment(folder):
    Path("sweep.yaml").write_text(CAMPAIGN)
    experiment = load_experiment(Path("sweep.yaml"))
    plans = [plan_of_scenario(load_scenario("a.yaml", changes=case.changes)) for case in experiment.cases]
    told = [[f"{f.fault.on}: {f.fault}" for f in plan.faults] for plan in plans]
    gain, late = "plant.yaw_rate: gain 1.1", "gyro.yaw_rate -> law: delay 20 ms"
    frozen = "gyro.yaw_rate: freeze from 1 s"
    off = ["gyro.yaw_rate: bias 1 deg/s", "gyro.yaw_rate: noise 0.1"]
    assert told == [
        [gain],
        [gain, late],
        [gain, frozen],
        [gain, frozen, late],
        [gain, *off],
        [gain, *off, late],
    ]
    assert len({key_of(plan) for plan in plans}) == 6
    of_option = load_experiment(Path("sweep.yaml"), changes=read_changes(faults=["plant.yaw_rate: none"]))
    assert plan_of_scenario(load_scenario("a.yaml", changes=of_option.cases[0].changes)).faults == ()


def test_faults_stay_data_on_the_way_from_where_they_are_written(folder):
    """A number with more digits than a line shows arrives with all of them."""
    exact = 0.12345678901234567
    Path("sweep.yaml").write_text(CAMPAIGN.replace("value: 1.1", f"value: {exact!r}, from: {exact!r}"))
    (change, *_) = load_experiment(Path("sweep.yaml")).cases[0].changes
    (fault,) = plan_of_scenario(load_scenario("a.yaml", changes=[change])).faults
    assert (fault.value, fault.fault.begin) == (exact, exact)
    assert change.faults == (Fault(FaultLocation("plant", "yaw_rate"), "gain", exact, begin=exact),)
    assert golden(str(change))
    one, other = read_changes(faults=["a.x: bias 1 deg until 2", "a.y: none"])
    assert one.faults == (Fault(FaultLocation("a", "x"), "bias", "1 deg", end=2.0),)
    assert other.faults == ()
    assert str(other) == "--fault a.y: none"
    assert golden(str(one))
    both = yb.load("a.yaml").fault("gyro.yaw_rate", kind="freeze", start=exact)
    both = both.fault("gyro.yaw_rate", kind="noise", value="1 deg/s", seed=3)
    assert [(f.fault.kind, f.fault.begin, f.value) for f in both.plan().faults] == [
        ("freeze", exact, None),
        ("noise", -math.inf, pytest.approx(math.radians(1.0))),
    ]


# What is shown


def yawbench_status(*arguments):
    with pytest.raises(SystemExit) as exit_:
        main(list(arguments))
    return exit_.value.code


def test_check_shows_faults_and_an_archive_says_that_it_has_none(folder, capsys):
    assert yawbench_status("check", "a.yaml", "--fault", "plant.slip_*: bias 0.1 from 1 s") == 0
    assert golden_in(capsys.readouterr().out)
    assert yawbench_status("export-ssp", "a.yaml", "--fault", "gyro.yaw_rate: freeze") == 0
    assert golden_in(capsys.readouterr().err)
    assert yawbench_status("second-opinion", "a.yaml", "--fault", "gyro.yaw_rate: freeze") == 2
    assert golden_in(capsys.readouterr().err)


def test_figures_mark_when_runs_were_faulty_and_the_legend_says_how():
    healthy, broken = car(), car(1.2)
    fault = {"on": "gyro.yaw_rate", "fault": "freeze from 2 s", "from": 2.0, "until": None, "at": []}
    noted(broken, faults=[fault])
    figure = draw([LabelledRun("healthy", healthy), LabelledRun("broken", broken)], ["sideslip", "path"])
    legend = [text.get_text() for box in figure.legends for text in box.get_texts()]
    assert golden(legend[-1])
    over_time, path = figure.axes
    (span,) = [p for p in over_time.patches if to_hex(p.get_facecolor()) == FAULTY.lower()]
    assert (span.get_x(), span.get_x() + span.get_width()) == (2.0, 8.0)
    assert not path.patches
    alone = draw([LabelledRun("broken", broken)], ["sideslip"])
    assert golden([text.get_text() for box in alone.legends for text in box.get_texts()][-1])


def test_the_command_of_a_page_gives_faults_as_the_option_takes_them():
    (change,) = read_changes(faults=["a.x -> b: bias 1 deg from 2 s"])
    assert golden(command_of("sweep", Path("s.yaml"), fault=[f"{change.faulty}: {change.value}"]))
