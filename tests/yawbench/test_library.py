"""The Python library: scenarios as values, runs in memory, units in plain Python."""

import importlib
import json
import re
import sys
import warnings
from collections import deque
from html import escape
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import yawbench as yb
from tests.command_line import status_of
from tests.refusals import mentions, refused, texts_of
from tests.reports.made_up import unpacked
from tests.yawbench.laws import Derived, Law, proportional
from yawbench._controller import PythonComponent
from yawbench.components.controllers.fnn import Fnn
from yawbench.foundation.errors import warnings_in

SCENARIO = "fnn_sideslip/25mps"
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def base():
    return yb.load(SCENARIO).set({"stop_time": 1.6})


@pytest.fixture(scope="module")
def run(base):
    return base.run()


class Counting:
    """A law with a memory."""

    inputs, outputs = ("yaw_rate",), ("yaw_moment",)

    step_size = 0.1
    calls = 0

    def advance(self, t, h, u):
        self.calls += 1

    def output(self, t, u):
        return float(self.calls)


def equal(one, other):
    return list(one) == list(other) and all(np.array_equal(one[name], other[name]) for name in one)


def test_a_run_has_the_numbers_that_the_command_line_writes(base, run, tmp_path):
    main_path = str(base.path)
    assert status_of("run", main_path, "--set", "stop_time=1.6", "--out", tmp_path / "cli") == 0
    assert equal(run, yb.open(tmp_path / "cli"))


def test_swap_and_set_leave_the_scenario_as_it_was(base):
    other = base.swap(controller="controller_off").set(
        {"vehicle.mass": 1200, "plant.initial_speed": "80 km/h"}
    )
    assert str(base.changes[0].target) == "stop_time"
    assert len(base.changes) == 1
    assert [str(change.target) for change in other.changes] == [
        "stop_time", "controller", "vehicle.mass", "plant.initial_speed",
    ]  # fmt: skip
    plant = next(unit for unit in other.plan().instances if unit.name == "plant")
    assert plant.parameters["mass"] == 1200
    assert plant.parameters["initial_speed"] == pytest.approx(80 / 3.6)


def test_a_scenario_that_was_loaded_stays_where_it_is_when_the_working_directory_changes(
    monkeypatch, tmp_path
):
    monkeypatch.chdir(ROOT)
    scenario = yb.load(f"scenarios/{SCENARIO}.yaml")
    monkeypatch.chdir(tmp_path)
    assert scenario.set({"stop_time": 0.01}).run().time[-1] == 0.01


def test_names_of_signals_and_columns_give_the_same_arrays(run):
    assert np.array_equal(run["plant.sideslip"], run["sideslip"])
    assert run.time.shape == run["sideslip"].shape == (len(run),)
    assert run.unit_of("sideslip") == "rad"
    assert "plant.sideslip" in run
    assert list(run.to_pandas()) == list(run)
    assert np.array_equal(run.to_pandas()["plant.yaw_rate"], run["yaw_rate"])
    with refused(yb.ResultsError, "signal-unknown", names=("25 m/s", "0.65", "'yawrate'", "'yaw_rate'")):
        run["yawrate"]


def test_metrics_are_those_of_the_command_line(run):
    assert run.metric("peak(sideslip)") == np.max(np.abs(run["sideslip"]))
    late = run.time >= 1.2
    assert run.metric("peak(sideslip)", window=(1.2, 1.6)) == np.max(np.abs(run["sideslip"][late]))
    with refused(yb.ResultsError, "signal-unknown", names=("peak(sideslip)", "0", "1.6 s")):
        run.metric("peak(sideslip)", window=(1, 60))
    with refused(yb.ResultsError, "signal-unknown", names=("peak(sidslip)", "'sidslip'", "'sideslip'")):
        run.metric("peak(sidslip)")
    with refused(yb.ScenarioError, "metric-unknown", names=("'peek(sideslip)'", "'peek'", "'peak'")):
        run.metric("peek(sideslip)")


def test_saved_results_are_read_back_to_the_bit_also_from_a_folder_that_had_some(run, tmp_path):
    for name in ("csv", "csv", "parquet"):
        again = yb.open(run.save(tmp_path / "mine", format=name))
        assert equal(run, again)
        assert again.changes == run.changes
        assert again.record["status"] == "completed"


def test_a_figure_shows_itself_in_a_notebook(run):
    figure = run.plot("sideslip", "yaw_rate")
    assert figure._repr_png_().startswith(b"\x89PNG")
    assert [axes.get_label() for axes in figure.axes] == ["sideslip", "yaw_rate"]


def test_function_and_object_of_one_law_give_the_same_bits(base):
    by_function, by_object = (base.swap(controller=law).run() for law in (proportional, Law(20000)))
    assert equal(by_function, by_object)
    assert mentions(by_function.record["fmus"]["controller"]["generation_tool"], "Python")


def test_a_component_class_gives_the_bits_of_its_fmu(base, run):
    assert equal(run, base.swap(controller=Fnn).run())


class Lag:
    def __init__(self):
        self.y = 0.0

    def step(self, u):
        self.y += 0.1 * (u - self.y)
        return self.y


class Lagging:
    """A law that is called, and keeps an object and a list."""

    def __init__(self, gain=2e4):
        self.gain, self.lag, self.past = gain, Lag(), [0.0, 0.0]

    def __call__(self, yaw_rate_ref, yaw_rate):
        self.past[0], self.past[1] = self.past[1], self.lag.step(yaw_rate_ref - yaw_rate)
        return self.gain * (self.past[0] + self.past[1])

    def law(self, yaw_rate_ref, yaw_rate, share=0.5):
        return share * self.gain * self.lag.step(yaw_rate_ref - yaw_rate)


LAWS = {
    "a function of time": lambda yaw_rate_ref, yaw_rate, t: 2e4 * (yaw_rate_ref - yaw_rate) if t > 0.1 else 0,
    "an object that derives": Derived(),
    "an object that is called and remembers": Lagging(),
    "a method": Lagging().law,
    "a component": Fnn,
}
"""Laws beside those with parameters, which test_parameters.py runs in both ways."""


@pytest.mark.parametrize("what", LAWS)
def test_plain_python_runs_natively_with_the_same_bits(what, base, monkeypatch):
    scenario = base.swap(controller=LAWS[what])
    native = scenario.run()
    monkeypatch.setenv("YAWBENCH_UNITS", "python")
    in_python = scenario.run()
    assert native.record["fmus"]["controller"]["runs_as"] == "native"
    assert mentions(in_python.record["fmus"]["controller"]["runs_as"], "YAWBENCH_UNITS", "Python")
    assert equal(native, in_python)


def with_numpy(yaw_rate_ref, yaw_rate):
    return 2e4 * np.tanh(yaw_rate_ref - yaw_rate)


class Remembering:
    """A law with a queue, which belongs to the object."""

    def __init__(self):
        self.past = deque(maxlen=3)

    def __call__(self, yaw_rate):
        self.past.append(yaw_rate)
        return -1e3 * sum(self.past)


class Slotted:
    __slots__ = ("gain",)

    def __init__(self):
        self.gain = 1e3

    def __call__(self, yaw_rate):
        return -self.gain * yaw_rate


UNTRANSLATED = {
    "numpy": (with_numpy, "with_numpy", "tanh", "test_library.py"),
    "a queue": (Remembering(), "Remembering.past", "deque"),
    "slots": (Slotted(), "Slotted"),
    "no source": (eval("lambda yaw_rate: -1e3 * yaw_rate"), "<lambda>", "<string>:1"),
}


@pytest.mark.parametrize("what", UNTRANSLATED)
def test_plain_python_that_is_not_translated_says_why(what, base):
    law, *names = UNTRANSLATED[what]
    run = base.swap(controller=law).set({"stop_time": 0.01}).run()
    (note,) = (one for one in run.diagnostics if one.code == "instance-in-python")
    assert note.severity == "info"
    assert mentions(note.message, "controller", "Python", *names)


@pytest.mark.parametrize(
    "law", [lambda yaw_rate: False, lambda yaw_rate: yaw_rate > 0.1], ids=["always", "by sign"]
)
def test_a_law_that_returns_a_truth_is_refused_natively_too(law, base):
    zero = base.set({"stop_time": 0.01}).swap(controller=lambda yaw_rate: 0)
    assert zero.run().record["fmus"]["controller"]["runs_as"] == "native"  # the same C as for False
    with refused(
        yb.SimulationError, "fmu-call-failed", names=("controller", "0 s", "TypeError", "yaw_moment", "False")
    ):
        base.swap(controller=law).run()


@pytest.mark.parametrize("law", [Lagging(), Lagging().law, Remembering()], ids=["native", "method", "Python"])
def test_no_run_of_an_object_that_remembers_affects_the_next(law, base):
    assert equal(base.swap(controller=law).run(), base.swap(controller=law).run())


def test_parameters_of_an_object_that_is_called_are_those_of_constructor_and_call(base):
    def last(scenario):
        return scenario.run()["controller.yaw_moment"][-1]

    scenario = base.swap(controller=Lagging())
    assert (
        last(scenario.set({"controller.gain": 1e4}))
        == last(base.swap(controller=Lagging(1e4)))
        != last(scenario)
    )
    derived = base.swap(controller=Derived()).set({"controller.gain": 2e4, "controller.scale": 0.5})
    assert last(derived) == last(base.swap(controller=Derived()))
    assert derived.set({"stop_time": 0.01}).run().record["fmus"]["controller"]["runs_as"] == "native"


def slow_law(yaw_rate_ref, yaw_rate):
    total = 0.0
    for k in range(3000):
        total = 0.5 * total + k * (yaw_rate_ref - yaw_rate)
    return total


def test_a_law_that_takes_long_to_compare_runs_in_python_without_a_long_wait(base, monkeypatch):
    monkeypatch.setattr("yawbench._native.LIMIT", 1)
    run = base.swap(controller=slow_law).set({"stop_time": 0.01}).run()
    assert mentions(run.record["fmus"]["controller"]["runs_as"], "1 s", "comparison", "processor")


def test_a_value_of_the_module_counts_as_it_is_when_a_run_begins(base, monkeypatch):
    scenario = base.swap(controller=with_gain).set({"stop_time": 0.01})
    before = scenario.run()
    monkeypatch.setattr(sys.modules[__name__], "GAIN", 300.0)
    after = scenario.run()
    assert {run.record["fmus"]["controller"]["runs_as"] for run in (before, after)} == {"native"}
    assert [run["controller.yaw_moment"][-1] for run in (before, after)] == [200.0, 300.0]


GAIN = 200.0


def with_gain(yaw_rate):
    return GAIN


def test_code_that_was_edited_since_it_was_imported_is_not_translated(base, monkeypatch, tmp_path):
    file = tmp_path / "edited_law.py"
    file.write_text("def law(yaw_rate):\n    return 1.0\n")
    monkeypatch.syspath_prepend(tmp_path)
    import edited_law

    file.write_text("def law(yaw_rate):\n    return 2.0\n")
    run = base.swap(controller=edited_law.law).set({"stop_time": 0.01}).run()
    assert run["controller.yaw_moment"][-1] == 1.0
    assert mentions(run.record["fmus"]["controller"]["runs_as"], "edited_law.py:1", "law", "since")


HELPERS = {
    "a function": """
def helper(x):
    return 1.0 * x
""",
    "a default value": """
def helper(x, k=1.0):
    return k * x
""",
    "a default function": """
def by(x):
    return 1.0 * x
def helper(x, f=by):
    return f(x)
""",
    "in a generator": """
def f(x):
    return 1.0 * x
def helper(x):
    return sum(f(y) for y in (x, x))
""",
    "a decorated function": """
def twice(f):
    return lambda x: f(f(x))
@twice
def helper(x):
    return 1.0 * x
""",
    "a cached function": """
@functools.lru_cache
def helper(x):
    return 1.0 * x
""",
    "a partial function": """
def f(k, x):
    return 1.0 * x
helper = functools.partial(f, 0)
""",
    "a function in a table": """
T = {'a': lambda x: 1.0 * x}
def helper(x):
    return T['a'](x)
""",
    "what a closure has": """
def make(k):
    return lambda x: k * x
helper = make(1.0)
""",
    "an attribute of a class": """
class H:
    k = 1.0
def helper(x):
    return H.k * x
""",
    "a base class": """
class B:
    def f(self, x):
        return 1.0 * x
class H(B):
    pass
def helper(x):
    return H().f(x)
""",
    "a property": """
class H:
    @property
    def k(self):
        return 1.0
def helper(x):
    return H().k * x
""",
    "a cached property": """
class H:
    @functools.cached_property
    def k(self):
        return 1.0
def helper(x):
    return H().k * x
""",
    "an object": """
class H:
    def f(self, x):
        return 1.0 * x
helper = H().f
""",
    "an object in a list": """
class H:
    def f(self, x):
        return 1.0 * x
L = [H()]
def helper(x):
    return L[0].f(x)
""",
    "what an object keeps beside a function": """
class H:
    pass
h = H()
h.f, h.k = lambda x: x, 1.0
def helper(x):
    return h.f(x) * h.k
""",
    "another module": """
import law_helpers
def helper(x):
    return law_helpers.helper(x)
""",
}
USERS = {
    "a function": """
def law(yaw_rate):
    return helper(yaw_rate)
""",
    "an object": """
class Law:
    inputs = ('yaw_rate',)
    outputs = ('yaw_moment',)
    def output(self, t, u):
        return helper(u.yaw_rate)
law = Law()
""",
    "an object that is called": """
class Law:
    def __call__(self, yaw_rate):
        return self.f(yaw_rate)
law = Law()
law.f = helper
""",
    "a component": """
from yawbench.components.fmi.component import Component
from yawbench.components.fmi.variables import output, signal
class law(Component):
    'A law.'
    inputs = (signal('yaw_rate', 'rad/s', 'Yaw rate'),)
    outputs = (output('yaw_moment', 'yaw_rate', unit='N.m', text='Moment'),)
    def output(self, t, u):
        return (helper(u[0]),)
""",
}


def users_of_helpers():
    """Return all pairs of a helper and a user of it; the first tier has one user of each helper, in turn."""
    return [
        pytest.param(what, user, marks=() if i == k % len(USERS) else pytest.mark.exhaustive)
        for (k, what), (i, user) in product(enumerate(HELPERS), enumerate(USERS))
    ]


@pytest.mark.parametrize(("what", "user"), users_of_helpers())
def test_a_law_whose_helper_was_edited_is_another_program(what, user, monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    digests = []
    for value in ("1.0", "1.0", "2.0"):
        (tmp_path / "law_helpers.py").write_text(f"def helper(x):\n    return {value} * x\n")
        text = f"import functools\n{HELPERS[what].replace('1.0', value)}{USERS[user]}"
        (tmp_path / "law_and_helpers.py").write_text(text)
        for module in ("law_helpers", "law_and_helpers"):
            monkeypatch.delitem(sys.modules, module, raising=False)
        law = importlib.import_module("law_and_helpers").law
        digests.append(PythonComponent(law, instance="controller", role="controller").fmu.sha256)
    assert digests[0] == digests[1] != digests[2]


def test_every_run_begins_with_a_copy_of_the_object(base):
    law = Counting()
    scenario = base.swap(controller=law)
    first, second = scenario.run(), scenario.run()
    assert law.calls == 0
    assert equal(first, second)
    assert first["controller.yaw_moment"][-1] == 16


def test_a_step_size_goes_with_the_program_that_brought_it(base):
    again = base.swap(controller=Counting()).swap(controller=proportional)
    assert again.changes == base.swap(controller=proportional).changes


@pytest.mark.parametrize("mass", [np.int64(1200), np.float32(1200), np.array(1200.0)])
def test_numbers_of_numpy_are_numbers(base, mass):
    assert base.set({"vehicle.mass": mass}).plan() == base.set({"vehicle.mass": mass.item()}).plan()


def test_what_python_code_raises_is_the_cause(base):
    def broken(t, yaw_rate):
        return 1 / (t < 1)

    with pytest.raises(yb.SimulationError, match=r"controller: .*ZeroDivisionError") as caught:
        base.swap(controller=broken).run()
    assert isinstance(caught.value.__cause__, ZeroDivisionError)
    assert caught.value.instance == "controller"
    assert caught.value.time == pytest.approx(1.0, abs=0.003)


@pytest.mark.parametrize(
    ("given", "names"),
    [
        (3, ("int", "controller")),
        (Law, ("Law", "object", "class")),
        (lambda **signals: 0.0, ("function", "signal")),
        (lambda x: x, ("'x'", "signal")),
        (type("Mute", (), {"output": lambda self, t, u: 0.0, "inputs": ()})(), ("Mute", "outputs")),
        (type("Text", (Law,), {"output": None})(), ("output", "method")),
        (type("Text", (Law,), {"inputs": "yaw_rate"})(), ("inputs", "tuple")),
    ],
)
def test_what_cannot_stand_for_a_controller_is_refused_in_a_sentence(base, given, names):
    with refused(yb.ScenarioError, names=names):
        base.swap(controller=given)


def test_unknown_units_and_places_are_refused_with_a_guess(base):
    with refused(yb.ScenarioError, "instance-unknown", names=("'controler'", "'controller'")) as caught:
        base.swap(controler="controller_off")
    assert (caught.value.file, caught.value.line) == (base.path, None)
    with refused(
        yb.YawbenchError, "parameter-unknown", names=("plant.mas=3", "plant_seven_dof", "'mas'", "'mass'")
    ):
        base.set({"plant.mas": 3}).plan()


def test_an_output_of_the_wrong_length_ends_the_run_with_a_sentence(base):
    with refused(
        yb.SimulationError,
        "fmu-call-failed",
        names=("controller", "0 s", "ValueError", "2 values", "1 output", "yaw_moment"),
    ):
        base.swap(controller=lambda yaw_rate: (yaw_rate, 1.0)).run()


@pytest.mark.parametrize(
    "test, angle, names",
    [
        ("sine-with-dwel", None, ("'sine-with-dwel'", "'sine-with-dwell'")),
        ("sine-with-dwell", 0.0, ("angle", "0", "2 pi", "0.0")),
        ("sine-with-dwell", -0.6, ("angle", "0", "2 pi", "-0.6")),
        ("sine-with-dwell", float("nan"), ("angle", "nan")),
        ("sine-with-dwell", "36 deg", ("angle", "'36 deg'")),
        ("step-steer", 0.6, ("step-steer", "angle", "omit")),
    ],
)
def test_what_a_run_cannot_be_evaluated_with_is_said_in_a_sentence(run, test, angle, names):
    with pytest.raises(yb.ScenarioError) as raised:
        run.evaluate(test, angle=angle)
    assert mentions(raised.value, *names)


@pytest.mark.parametrize(
    ("call", "kind", "names"),
    [
        (lambda base, run: yb.load(None), TypeError, ("source", "nothing")),
        (lambda base, run: base.set([("a", 1)]), TypeError, ("values", "targets")),
        (
            lambda base, run: base.set({"vehicle.mass": b"1"}),
            yb.ScenarioError,
            ("vehicle.mass", "number"),
        ),
        (lambda base, run: base.run(progress=3), TypeError, ("progress", "function", "total")),
        (lambda base, run: run.metric("peak(sideslip)", (1,)), TypeError, ("window", "pair", "times")),
        (
            lambda base, run: run.metric("peak(sideslip)", ("0", "1")),
            TypeError,
            ("0", "number", "window"),
        ),
        (
            lambda base, run: base.set({"stop_time": 1e9, "step_size": 1e-9}),
            yb.ScenarioError,
            ("1,000,000,000", "+18"),
        ),
        (
            lambda base, run: base.set({"stop_time": 3e5}).run(),
            yb.ScenarioError,
            ("16 GB", "kept", "memory"),
        ),
        (
            lambda base, run: base.set({"vehicle.mass": "3 m", "driver.amplitude": "1 kg"}),
            yb.ScenarioError,
            ("set driver.amplitude=1 kg", "deg"),
        ),
        (
            lambda base, run: base.swap(controller=lambda yawrate: 0.0),
            yb.ScenarioError,
            ("'yaw_rate'",),
        ),
    ],
)
def test_a_wrong_argument_is_named(base, run, call, kind, names):
    with refused(kind, names=names):
        call(base, run)


@pytest.mark.parametrize(
    ("returned", "names"),
    [
        (None, ("yaw_moment", "returned", "return")),
        (np.ones((1, 1)), ("1", "yaw_moment")),
        ("1.0", ("yaw_moment", "number")),
        (b"1", ("yaw_moment", "number")),
        (True, ("yaw_moment", "number")),
    ],
)
def test_what_a_controller_must_not_return_ends_the_run_with_a_sentence(base, returned, names):
    with refused(yb.SimulationError, names=names):
        base.swap(controller=lambda yaw_rate: returned).run()


def test_an_error_is_at_the_file_and_line_of_its_first_problem(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("stop_time: 1\nstep_size: 0.001\nunits:\n  plant: {fmu: plant_seven_dof, setp_size: 1}\n")
    with refused(
        yb.ScenarioError,
        "key-unknown",
        names=("mine.yaml:4", "units.plant.setp_size", "'step_size'", "fmu", "validate"),
    ) as caught:
        yb.load(file)
    assert (caught.value.file, caught.value.line) == (file, 4)


def test_remarks_are_in_what_a_run_shows_of_itself_and_warn_once_where_it_was_started(base):
    spinning = base.set({"friction": 65, "plant.initial_sideslip": "60 deg"})
    with pytest.warns(yb.YawbenchWarning) as warned:
        run = spinning.run()
    assert len(warnings_in(run.diagnostics)) >= 2
    assert len(warned) == 1
    assert warned[0].filename == __file__
    for says in ("did you mean '65 %'?", "the car spins"):
        assert any(says in text for text in texts_of(run))
        assert says in str(warned[0].message)
        assert says in repr(run)
        assert escape(says) in run._repr_html_()


def test_a_run_without_remarks_warns_of_nothing(base):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = base.run()
    assert warnings_in(run.diagnostics) == ()


def test_an_experiment_warns_once_and_says_in_how_many_runs(base):
    made = yb.experiment(base, {"speed": [20, 300]}, metrics=["peak(yaw_rate)"])
    with pytest.warns(yb.YawbenchWarning) as warned:
        runs = made.run(workers=1)
    assert len(warned) == 1
    assert warned[0].filename == __file__
    assert mentions(str(warned[0].message), "'300 km/h'")
    assert mentions(str(warned[0].message), "1", "2 runs", "speed-implausible")
    assert mentions(repr(runs), "1", "2 runs", "speed-implausible")


def test_a_run_that_fails_warns_of_what_was_remarkable_before(base):
    def giving_up(t, yaw_rate):
        if t > 0.1:
            raise RuntimeError("enough")
        return 0.0

    with pytest.warns(yb.YawbenchWarning, match="did you mean '300 km/h'"), pytest.raises(yb.SimulationError):
        base.swap(controller=giving_up).set({"speed": 300}).run()


def test_a_viewer_shows_runs_by_their_labels(base, run, tmp_path):
    free = base.swap(controller="controller_off").run()
    shown = yb.view(
        {"free": free, "held": run}, "yaw_rate", "plant.sideslip - reference.sideslip_ref", height=500
    )
    data = json.loads(re.findall(r'application/json">(.*?)</script>', unpacked(shown.html), re.DOTALL)[0])
    assert [one["label"] for one in data["runs"]] == ["free", "held"] == list(shown.labels)
    assert data["views"][0]["panels"] == [
        "plant.yaw_rate,reference.yaw_rate_ref", "plant.sideslip - reference.sideslip_ref",
    ]  # fmt: skip
    assert shown.save(tmp_path / "v.html").read_text(encoding="utf-8") == shown.html
    frame = shown._repr_html_()
    assert escape(shown.html) in frame and "height: 500px" in frame
    assert repr(yb.view([run, run])) == f"<View of 1: {run.title} and 2: {run.title}>"
    assert yb.view([free, run]).labels == ("1: controller_off for controller", f"2: {run.title}")
    assert yb.view(run).labels == (run.title,)


def test_a_viewer_refuses_what_it_cannot_show(run, tmp_path):
    with pytest.raises(yb.ScenarioError) as refused:
        yb.view(run, "plant.nothing")
    assert "plant.nothing" in str(refused.value)
    with pytest.raises(yb.ResultsError):
        yb.view([])
    for wrong in (7, "run", [run, 7], {"a": None}, {7: run}):
        with pytest.raises(TypeError):
            yb.view(wrong)
    with pytest.raises(ValueError):
        yb.view(run, height=5)
    with pytest.raises(yb.ResultsError):
        yb.view(run).save(tmp_path)
