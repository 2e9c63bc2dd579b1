import json
import math
import os
import signal

import pytest

from tests.orchestrator.fakes import Behaviour, Clock, Echo, FakeSlave, Function, Mixed, Stage, make_plan
from tests.refusals import each_mentions, mentions
from yawbench.foundation.errors import Interrupted, SimulationError
from yawbench.orchestrator.master.log import DISCARD, ERROR, FATAL, OK, PENDING, WARNING
from yawbench.orchestrator.master.simulate import simulate
from yawbench.orchestrator.results.reader import load_results

SOURCE_TO_TARGET = ["source.x -> target.x"]


class Passing(Behaviour):
    """y follows x and the unit does something of the test's choice in every step."""

    inputs = ("x",)
    outputs = {"y": ("x",)}

    def __init__(self, act=lambda t: None):
        self.act = act

    def advance(self, t, h, u):
        self.act(t)

    def output(self, t, u):
        return {"y": u["x"]}


def fail(tmp_path, units, wires, *, status=1, kinds=(), **options):
    """Run fake units to the error they make; return its sentence, the results and the slaves."""
    stage = Stage(units, **dict(kinds))
    with pytest.raises(SimulationError if status == 1 else Interrupted) as caught:
        simulate(make_plan(units, wires, **options), tmp_path, opener=stage)
    assert caught.value.exit_status == status
    return str(caught.value), load_results(tmp_path), stage.slaves


def ramp_into(act):
    return {"source": Clock(x=lambda t: 10.0 * t), "target": Passing(act)}


def raise_at(when, error):
    def act(t):
        if t >= when:
            raise error

    return act


def test_a_failed_step_is_a_sentence_that_keeps_the_rows_before_and_frees_every_instance_once(tmp_path):
    units = ramp_into(raise_at(0.5, ValueError("velocity_x must exceed 1 m/s (got 0.2)")))
    sentence, results, slaves = fail(tmp_path, units, SOURCE_TO_TARGET)
    assert mentions(sentence, "target", "0.5 s", "ValueError", "velocity_x", "1 m/s", "0.2")
    assert results.record.status == "failed"
    assert results.record.error.message == sentence
    assert results.record.error.instance == "target"
    assert results.record.error.time == 0.5
    assert json.loads(results.record.to_json())["error"]["unit"] == "target"  # the key of earlier versions
    assert results.time.tolist() == [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]
    assert results["target.y"].tolist() == results["source.x"].tolist()
    assert results.record.rows == 6
    assert results.record.error.inputs == {"x": pytest.approx(6.0)}
    assert [slave.freed for slave in slaves.values()] == [1, 1]
    assert slaves["target"].worst == ERROR


def answering(status, *messages, call="step", at=3):
    """Return a kind of slave that logs and returns a status in its `at`th call of a kind."""

    class Slave(FakeSlave):
        def connect(self, buffers):
            calls = super().connect(buffers)
            count = iter(range(1, 10**9))

            def answer():
                inner = getattr(calls, call)()
                if next(count) != at:
                    return inner
                for level, text in messages:
                    self.log.add(self.name, level, "", text)
                return status

            return calls._replace(**{call: answer})

    return Slave


def answer(tmp_path, kind, *, status=1):
    """Run a source and a target, a slave of this kind, to the error that it makes."""
    units = ramp_into(lambda t: None)
    return fail(tmp_path, units, SOURCE_TO_TARGET, kinds={"target": kind}, status=status)


def entering(act):
    """Return a kind of slave that does this when it enters initialization."""

    class Slave(FakeSlave):
        def enter(self):
            return act(self)

    return Slave


def go_on(tmp_path, kind):
    """Run them to the end; return instance, time and text of every warning, and the results."""
    units = ramp_into(lambda t: None)
    info = simulate(make_plan(units, SOURCE_TO_TARGET), tmp_path, opener=Stage(units, target=kind))
    return [(m.instance, m.time, m.text) for m in info.warnings], load_results(tmp_path)


@pytest.mark.parametrize(
    ("status", "word"),
    [(DISCARD, "Discard"), (ERROR, "Error"), (FATAL, "Fatal"), (PENDING, "asynchronously")],
)
def test_a_status_without_a_message_is_named(status, word, tmp_path):
    sentence, _, slaves = answer(tmp_path, answering(status))
    assert mentions(sentence, "target", "0.2 s", word)
    assert slaves["target"].worst == status


def test_an_error_after_which_a_unit_went_on_is_reported_and_not_taken_for_the_reason(tmp_path):
    class Slave(answering(ERROR, at=4)):
        def connect(self, buffers):
            calls = super().connect(buffers)

            def step():
                if self.time < 0.05:
                    self.log.add(self.name, ERROR, "", "a glitch, never mind")
                return calls.step()

            return calls._replace(step=step)

    sentence, _, _ = answer(tmp_path, Slave)
    assert mentions(sentence, "target", "0.3 s", "Error")
    warnings, results = go_on(tmp_path, answering(OK, (ERROR, "a glitch, never mind")))
    assert warnings == [("target", 0.2, "a glitch, never mind")]
    assert [w.status for w in results.record.warnings] == ["Error"]


def test_the_first_error_that_was_logged_is_the_reason_and_no_warning(tmp_path):
    kind = answering(ERROR, (WARNING, "getting warm"), (ERROR, "pressure\n  too high"), (ERROR, "giving up"))
    sentence, results, _ = answer(tmp_path, kind)
    assert mentions(sentence, "target", "0.2 s", "pressure too high")
    assert [w.text for w in results.record.warnings] == ["getting warm"]


def test_a_component_s_own_sentence_is_not_wrapped_in_another(tmp_path):
    own = "ValueError: 100 % too much: no (plants/a.py:7)"
    text = f"step failed at t = 0.2 s: {own}; inputs: x = 1.0, y = 2.0"
    sentence, _, _ = answer(tmp_path, answering(DISCARD, (ERROR, text)))
    assert mentions(sentence, "target", "0.2 s", own)
    assert sentence.count("failed at") == 1


@pytest.mark.parametrize(("call", "what"), [("set", "inputs"), ("get", "outputs")])
def test_a_failed_set_or_get_says_so(call, what, tmp_path):
    sentence, results, _ = answer(tmp_path, answering(ERROR, (ERROR, "no"), call=call, at=6))
    assert mentions(sentence, "target", what)
    assert sentence.endswith(" s: no")
    assert 1 <= len(results.time) < 11


def test_a_warning_is_reported_and_the_run_goes_on(tmp_path):
    warnings, results = go_on(tmp_path, answering(WARNING, (WARNING, "getting warm")))
    assert warnings == [("target", 0.2, "getting warm")]
    assert len(results.time) == 11
    assert results.record.content()["warnings"] == [
        {"unit": "target", "time": 0.2, "status": "Warning", "text": "getting warm"}
    ]


def test_a_warning_without_a_message_is_reported_too(tmp_path):
    warnings, _ = go_on(tmp_path, answering(WARNING))
    assert each_mentions(warnings, ("target", "Warning", "gave", "reason"))


def test_an_error_logged_during_initialization_is_a_warning_if_the_status_is_ok(tmp_path):
    def enter(slave):
        slave.log.add(slave.name, ERROR, "", "no table of mass, -1 is taken")
        return OK

    warnings, results = go_on(tmp_path, entering(enter))
    assert each_mentions(warnings, ("target", "mass", "-1"))
    assert results.time[-1] > 0


def test_an_instance_that_cannot_be_made_frees_those_made_before(tmp_path):
    def without_licence(*_):
        raise SimulationError("target: cannot be instantiated: no licence", instance="target", time=0.0)

    sentence, results, slaves = answer(tmp_path, without_licence)
    assert mentions(sentence, "no licence")
    assert (slaves["source"].freed, results.record.status) == (1, "failed")


@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel", "extrapolated"])
@pytest.mark.parametrize("value", [math.nan, -math.inf])
def test_a_value_that_is_not_finite_names_its_wire_and_time(value, algorithm, tmp_path):
    source = Clock(ok=lambda t: t, x=lambda t: value if t > 0.45 else t)
    wires = ["source.ok -> b.x", "source.x -> a.x"]
    units = {"source": source, "a": Passing(), "b": Passing()}
    sentence, results, _ = fail(tmp_path, units, wires, algorithm=algorithm)
    assert mentions(sentence, "source", "0.5 s", "source.x", "a.x", "x")
    assert results.time.tolist() == [0.0, 0.1, 0.2, 0.3, 0.4]


@pytest.mark.parametrize(("since", "time"), [(-1.0, "0 s"), (0.45, "0.5 s")])
def test_a_failure_downstream_of_a_nan_is_blamed_on_its_source(since, time, tmp_path):
    failing = raise_at(0.36, ValueError("cannot convert float NaN to integer"))
    units = {"source": Clock(x=lambda t: math.nan if t > since else t), "target": Passing(failing)}
    sentence, _, _ = fail(tmp_path, units, SOURCE_TO_TARGET)
    assert mentions(sentence, "source", time, "source.x", "target.x", "x")


def test_a_nan_from_a_unit_that_has_logged_an_error_is_explained_by_it(tmp_path):
    units = {"source": Clock(x=lambda t: math.nan if t > 0.45 else t), "target": Passing()}
    said = ERROR, "reading Real [17] failed at t = 0.5 s: KeyError: 17"
    kinds = {"source": answering(OK, said, call="get", at=6)}
    sentence, _, _ = fail(tmp_path, units, SOURCE_TO_TARGET, kinds=kinds)
    assert mentions(sentence, "source", "Real", "17", "0.5 s", "KeyError")


@pytest.mark.parametrize("algorithm", ["jacobi", "gauss_seidel", "extrapolated"])
@pytest.mark.parametrize(("begins", "time"), [(-1.0, 0.0), (0.45, 0.5)])
def test_a_value_on_no_wire_that_is_not_finite_is_a_warning_with_its_first_time(
    begins, time, algorithm, tmp_path
):
    units = {
        "source": Clock(x=lambda t: t, spare=lambda t: math.nan if t > begins else t, more=lambda t: t),
        "target": Passing(),
    }
    plan = make_plan(units, SOURCE_TO_TARGET, algorithm=algorithm)
    info = simulate(plan, tmp_path, opener=Stage(units))
    assert each_mentions([m.text for m in info.warnings], ("spare",))
    results = load_results(tmp_path)
    assert results.record.status == "completed"
    assert [(w.instance, w.time) for w in results.record.warnings] == [("source", time)]
    assert len(results.time) == 11
    assert math.isnan(results["source.spare"][-1])


def test_after_a_warning_of_one_value_all_others_are_still_looked_at(tmp_path):
    units = {
        "source": Clock(
            x=lambda t: math.inf if t > 0.75 else t,
            spare=lambda t: math.inf if t > 0.25 else t,
            more=lambda t: -math.inf if t > 0.45 else t,
        ),
        "target": Passing(),
    }
    sentence, results, _ = fail(tmp_path, units, SOURCE_TO_TARGET)
    assert mentions(sentence, "source", "0.8 s", "source.x", "target.x", "x")
    assert [w.text.split()[0] for w in results.record.warnings] == ["spare", "more"]
    assert [w.time for w in results.record.warnings] == [0.3, 0.5]


def test_a_value_on_no_wire_is_named_also_of_a_unit_that_floods_the_log(tmp_path):
    def act(t):
        for _ in range(1100):
            stage.slaves["target"].log.add("target", WARNING, "", "hot")

    units = {"source": Clock(x=lambda t: t), "target": Passing(act)}
    units["target"].output = lambda t, u: {"y": math.nan if t > 0.5 else u["x"]}
    stage = Stage(units)
    first, *_ = simulate(make_plan(units, SOURCE_TO_TARGET), tmp_path, opener=stage).warnings
    assert first.time == 0.6
    assert mentions(first.text, "y", "number", "wire")


def test_a_nan_at_the_start_that_the_loop_heals_is_no_error(tmp_path):
    units = {
        "a": Function(lambda t, u: {"y": 1.0 / u["x"] if u["x"] else math.nan}, ["x"], ["y"]),
        "b": Clock(x=lambda t: 2.0),
    }
    simulate(make_plan(units, ["b.x -> a.x"]), tmp_path, opener=Stage(units))
    assert load_results(tmp_path)["a.y"].tolist() == [0.5] * 11


def interrupt_at(when, number):
    def act(t):
        if abs(t - when) < 1e-9:
            os.kill(os.getpid(), number)

    return act


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_ends_between_two_steps_and_keeps_its_results(number, tmp_path):
    before = signal.getsignal(number)
    units = ramp_into(interrupt_at(0.5, number))
    status = 128 + number
    sentence, results, slaves = fail(tmp_path, units, SOURCE_TO_TARGET, status=status)
    assert mentions(sentence, "0.6 s", "interrupted")
    assert results.record.status == "interrupted"
    assert results.time.tolist()[-1] == 0.6
    assert [slave.freed for slave in slaves.values()] == [1, 1]
    assert signal.getsignal(number) is before
    units = {"a": Clock(x=math.sin)}
    simulate(make_plan(units), tmp_path / "whole", opener=Stage(units))
    assert signal.getsignal(number) is before


def test_a_run_interrupted_during_initialization_has_no_rows(tmp_path):
    interrupting = entering(lambda _: os.kill(os.getpid(), signal.SIGINT) or OK)
    sentence, results, slaves = answer(tmp_path, interrupting, status=130)
    assert mentions(sentence, "initialization")
    assert (results.record.status, len(results.time)) == ("interrupted", 0)
    assert [slave.freed for slave in slaves.values()] == [1, 1]


def test_a_failure_before_all_inputs_are_known_records_those_that_are(tmp_path):
    units = {"b": Echo(), "a": Mixed()}
    wires = [f"a.{name} -> b.{name}_in" for name in Mixed.outputs if name != "flag"]
    kinds = {"b": entering(lambda _: ERROR)}
    _, results, _ = fail(tmp_path, units, wires, kinds=kinds, constants={"b": {"flag_in": True}})
    assert results.record.error.inputs == {"x_in": "nan", "flag_in": True}


def test_a_failed_run_stands_beside_results_until_another_reaches_its_end_and_replaces_both(tmp_path):
    def run(units, wires=()):
        simulate(make_plan(units, wires), tmp_path, opener=Stage(units))

    def files():
        return sorted(path.name for path in tmp_path.iterdir())

    run({"a": Clock(x=math.sin)})
    for _ in range(2):  # it replaces one that failed before
        with pytest.raises(SimulationError) as caught:
            run(ramp_into(raise_at(0.5, ValueError("no"))), SOURCE_TO_TARGET)
        assert caught.value.code == "fmu-call-failed"
        assert mentions(str(caught.value.diagnostics[-1]), "failed", "recorded")
        results, beside = load_results(tmp_path), load_results(tmp_path / "failed")
        assert (list(results), results.record.status) == (["a.x"], "completed")
        assert (list(beside), beside.record.status) == (["source.x", "target.y"], "failed")
        assert files() == ["failed", "results.csv", "run.json"]
    run({"b": Clock(y=math.sin)})
    assert list(load_results(tmp_path)) == ["b.y"]
    assert files() == ["results.csv", "run.json"]


def test_a_failed_run_replaces_the_results_of_another_that_failed(tmp_path):
    for connected in (SOURCE_TO_TARGET, []):
        _, results, _ = fail(tmp_path, ramp_into(raise_at(0.5, ValueError("no"))), connected)
    assert results.record.connections == []
    assert sorted(p.name for p in tmp_path.iterdir()) == ["results.csv", "run.json"]


def test_results_are_whole_on_the_disk_before_a_unit_is_freed(tmp_path):
    units = {"a": Clock(x=math.sin)}
    found = []

    class Dying(Stage):
        def __call__(self, *arguments):
            slave = super().__call__(*arguments)
            slave.free = lambda: found.append((load_results(tmp_path), slave.note_end()))
            slave.note_end = lambda: slave.log.add("a", WARNING, "", "fmi2Terminate returned Error")
            return slave

    simulate(make_plan(units, n_steps=50), tmp_path, opener=Dying(units))
    ((before, _),) = found
    assert len(before.time) == 51
    assert before.record.status == "completed"
    assert not before.record.units_freed
    after = load_results(tmp_path).record
    assert after.units_freed
    assert each_mentions([w.text for w in after.warnings], ("fmi2Terminate", "Error"))
