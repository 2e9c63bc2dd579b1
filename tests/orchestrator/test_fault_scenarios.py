"""Faults in scenario files, options and experiments, in records, figures and commands."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from matplotlib.colors import to_hex

import yawbench as yb
from tests.command_line import status_of
from tests.fmus.fake_fmus import Var, make_fmu, out
from tests.orchestrator.recorded import car, noted
from tests.refusals import mentions, refused, texts_of
from yawbench.figures.plots import FAULTY, LabelledRun, draw
from yawbench.foundation.errors import ScenarioError, YawbenchError
from yawbench.orchestrator.fault_kinds import Fault, FaultLocation, FaultySignal
from yawbench.orchestrator.plan import Override
from yawbench.orchestrator.results.freshness import key_of
from yawbench.orchestrator.scenario.loader import load_scenario
from yawbench.orchestrator.scenario.overrides import read_changes
from yawbench.orchestrator.wiring.make_plan import make_plan as plan_of_scenario
from yawbench.studies.load_experiment import load_experiment

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
    fault = Fault(FaultLocation("gyro", "yaw_rate"), "freeze", None, begin=0.5, end=1.5)
    assert frozen == FaultySignal(fault, "gyro", "yaw_rate", True, None, 0)
    where = noisy.instance, noisy.variable, noisy.of_output
    assert (where, noisy.fault.every) == (("gyro", "yaw_rate_true", False), 0.02)
    assert noisy.value == pytest.approx(math.radians(0.5))
    assert by_file.changes == ()
    assert mentions(str(by_option.changes[0]), "--fault gyro.yaw_rate", "0.5 s", "1.5 s", "freeze")


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
    streams = {f.stream for f in made.faults}
    assert len(streams) == 4
    assert streams.isdisjoint(f.stream for f in planned("plant.slip_*: noise 0.1 seed 2").faults)
    more = planned("plant.yaw_rate: noise 0.1", "plant.slip_*: noise 0.1 seed 1")
    assert streams < {f.stream for f in more.faults}


@pytest.mark.parametrize(
    ("fault", "names"),
    [
        ("gyro.yaw_rate", ("--fault", "INSTANCE.OUTPUT", "KIND", "TIME")),
        ("gyro.yaw_rte: freeze", ("'yaw_rte'", "gyro")),
        ("gyr.yaw_rate: freeze", ("'gyr'", "'gyro'")),
        ("gyro yaw_rate: freeze", ("instance.output", "instance.input")),
        ("plant.yaw_rate -> law: freeze", ("plant.yaw_rate", "wire", "leads")),
        ("plant.yaw_rat -> gyro: freeze", ("plant.yaw_rat", "wire", "leads")),
        ("law.yaw_moment -> gyro: freeze", ("law.yaw_moment", "wire", "leads")),
        ("gyro.yaw_rate -> plant: freeze", ("gyro.yaw_rate", "leads", "plant")),
        ("law.friction: bias 1", ("faults", "outputs", "instances")),
        ("plant.gear: freeze", ("plant.gear", "Integer", "Real")),
        ("gyro.yaw_rate: freez", ("'bias'", "'gain'", "'drift'", "'noise'", "'freeze'")),
        ("gyro.yaw_rate: bias", ("bias", "value")),
        ("gyro.yaw_rate: freeze 3", ("freeze", "value")),
        ("gyro.yaw_rate: freeze seed 3", ("freeze", "seed", "random")),
        ("gyro.yaw_rate: bias 1 share 0.5", ("bias", "share")),
        ("gyro.yaw_rate: dropout", ("dropout", "share", "messages")),
        ("gyro.yaw_rate: dropout share 0", ("0", "1")),
        ("gyro.yaw_rate: noise 1 seed -1", ("0", "greater", "equal")),
        ("gyro.yaw_rate: noise -1", ("gyro.yaw_rate", "0 rad/s", "noise")),
        ("gyro.yaw_rate: loss 2", ("gyro.yaw_rate", "0", "1", "loss")),
        ("gyro.yaw_rate: bias 3 kg", ("'3 kg'", "rad/s", "deg/s", "rpm")),
        ("gyro.yaw_rate: drift 3 deg/s", ("'3 deg/s'", "rad/s")),
        ("gyro.yaw_rate: freeze from 2 s until 1 s", ("2 s", "1 s", "until")),
        ("gyro.yaw_rate: freeze from 1 s from 2 s", ("has from twice",)),
        ("gyro.yaw_rate: freeze from soon", ("'soon'", "neither", "number")),
    ],
)  # fmt: skip
def test_a_fault_that_cannot_be_is_one_sentence(fault, names, folder):
    with pytest.raises(YawbenchError) as caught:
        planned(fault)
    (problem,) = texts_of(caught.value)
    assert str(problem).startswith(f"--fault {fault}: ")
    assert mentions(str(problem), *names)


def test_a_fault_of_a_file_is_told_with_its_place_also_after_an_option_has_removed_another(folder):
    text = SCENARIO + "faults:\n  - {on: gyro.yaw_rate, kind: freeze}\n  - {on: plant.yaw_rate, kind: gain}\n"
    with refused(ScenarioError, "value-invalid", names=("a.yaml:13", "faults[1]")) as caught:
        planned("gyro.yaw_rate: none", text=text)
    assert len(caught.value.diagnostics) == 1


def test_what_a_fault_never_reaches_is_noted(folder):
    late = planned("gyro.yaw_rate: freeze from 3 s")
    assert mentions(texts_of(late), "--fault gyro.yaw_rate", "3 s", "2 s", "freeze", "never")
    make_fmu(Path("fmus/controller_off.fmu"), outputs=[out("yaw_moment", unit="N.m")])
    without = SCENARIO.replace("  - {from: [gyro], to: [law]}\n", "")
    swap = Override.of("law", "controller_off", "--swap")
    gone = planned("gyro.yaw_rate -> law: freeze", text=without, changes=[swap])
    assert gone.faults == ()
    assert mentions(texts_of(gone), "--fault", "gyro.yaw_rate", "freeze")


def test_a_run_with_a_fault_is_another_run(folder):
    keys = [key_of(planned(*f)) for f in ([], ["gyro.yaw_rate: freeze"], ["gyro.yaw_rate -> law: freeze"])]
    assert len(set(keys)) == 3
    assert keys[0] == key_of(planned())


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
    ways = [[gain], [gain, frozen], [gain, *off]]
    assert told == [way for first in ways for way in (first, [*first, late])]
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
    assert mentions(str(change), "plant.yaw_rate", "0.123456789 s")
    (none,) = read_changes(faults=["a.y: none"])
    assert (none.faults, str(none)) == ((), "--fault a.y: none")
    both = yb.load("a.yaml").fault("gyro.yaw_rate", kind="freeze", start=exact)
    both = both.fault("gyro.yaw_rate", kind="noise", value="1 deg/s", seed=3)
    assert [(f.fault.kind, f.fault.begin, f.value) for f in both.plan().faults] == [
        ("freeze", exact, None),
        ("noise", -math.inf, pytest.approx(math.radians(1.0))),
    ]


# What is shown


def test_check_shows_faults_and_an_archive_says_that_it_has_none(folder, capsys):
    assert status_of("check", "a.yaml", "--fault", "plant.slip_*: bias 0.1 from 1 s") == 0
    assert mentions(capsys.readouterr().out, "plant.slip_*", "0.1", "1 s")
    assert status_of("export-ssp", "a.yaml", "--fault", "gyro.yaw_rate: freeze") == 0
    assert mentions(capsys.readouterr().err, "note", "gyro.yaw_rate")
    assert status_of("second-opinion", "a.yaml", "--fault", "gyro.yaw_rate: freeze") == 2
    assert mentions(capsys.readouterr().err, "gyro.yaw_rate", "faults", "masters")


def test_figures_mark_when_runs_were_faulty_and_the_legend_says_how():
    def drawn(runs, panels):
        figure = draw([LabelledRun(name, run) for name, run in runs.items()], panels)
        legend = [text.get_text() for box in figure.legends for text in box.get_texts()]
        assert mentions(legend[-1], "gyro.yaw_rate", "2 s")
        return figure

    healthy, broken = car(), car(1.2)
    fault = {"on": "gyro.yaw_rate", "fault": "freeze from 2 s", "from": 2.0, "until": None, "at": []}
    noted(broken, faults=[fault])
    over_time, path = drawn({"healthy": healthy, "broken": broken}, ["sideslip", "path"]).axes
    (span,) = [p for p in over_time.patches if to_hex(p.get_facecolor()) == FAULTY.lower()]
    assert (span.get_x(), span.get_x() + span.get_width()) == (2.0, 8.0)
    assert not path.patches
    drawn({"broken": broken}, ["sideslip"])
