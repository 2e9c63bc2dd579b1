"""FMUs of plain Python: they give what the program gives, here and in other tools."""

from __future__ import annotations

import functools
import io
import os
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import fmpy
import numpy as np
import pytest

import yawbench as yb
from tests.refusals import refused
from tests.yawbench.laws import Data, Derived, half, powers
from yawbench.components.controllers.fnn import Fnn

GAIN = 3e4
LOG = io.StringIO()  # a value that no FMU can take along
MODULES = {
    "__init__": "import numpy\n",
    "laws": """
import sys

import ourlab.limits as within
from ourlab.limits import cut
from .deep import SHARE

assert "ourlab_was_imported_twice" not in sys.modules
sys.modules["ourlab_was_imported_twice"] = sys


def law(yaw_rate_ref, yaw_rate, gain=20000):
    return SHARE * cut(gain * (yaw_rate_ref - yaw_rate)) + within.zero()
""",
    "limits": """
import math

import ourlab.deep


def cut(x):
    from . import deep
    return math.copysign(min(abs(x), deep.LIMIT), x)


def zero():
    return ourlab.deep.LIMIT - ourlab.deep.LIMIT
""",
    "deep": "LIMIT, SHARE = 900.0, 0.5\n",
    "foreign": "import numpy as np\n\n\ndef law(yaw_rate):\n    return np.tanh(yaw_rate)\n",
    "deeply_foreign": "from . import foreign\n\n\ndef law(yaw_rate):\n    return foreign.law(yaw_rate)\n",
}


@pytest.fixture(scope="module")
def base():
    return yb.load("fnn_sideslip/25mps").set({"stop_time": 1.4})


@pytest.fixture(scope="module")
def ourlab(tmp_path_factory) -> Iterator[Any]:
    """A package of a user, with a function that returns its modules."""
    folder = tmp_path_factory.mktemp("project") / "ourlab"
    folder.mkdir()
    for name, text in MODULES.items():
        (folder / f"{name}.py").write_text(text)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder.parent)
        yield lambda name: import_module(f"ourlab.{name}")
    for name in [name for name in sys.modules if name.startswith("ourlab")]:
        del sys.modules[name]


def law(yaw_rate_ref, yaw_rate, t, gain=20000, share=0.5):
    return half(GAIN + gain) * share * (yaw_rate_ref - yaw_rate) if t > 0.1 else 0


def times(factor):
    def made(yaw_rate):
        return factor * half(yaw_rate)

    return made


class Changed(Derived):
    """An object that is not as its constructor has made it."""

    def __init__(self):
        super().__init__()
        self.table = [1.0, 2.0]

    def output(self, t, u):
        return self.table[-1] * super().output(t, u)


def changed():
    made = Changed()
    made.table = [3.0, float("inf"), 4.0]
    return made


LAWS: dict[str, Any] = {
    "a function": law,
    "a dataclass": Data(3e4),
    "whole numbers": powers,
    "a partial function": functools.partial(law, gain=1e4),
    "a lambda": lambda yaw_rate, gain=1e3: gain * yaw_rate + GAIN,
    "a closure": times(3.0),
    "an attribute of the class": Derived(),
    "a changed object": changed(),
    "a component": Fnn,
}
FIRST = ("a function", "a dataclass")


@pytest.mark.parametrize(
    "what", [pytest.param(w, marks=[pytest.mark.exhaustive] * (w not in FIRST)) for w in LAWS]
)
def test_the_fmu_gives_the_bits_of_the_program_here_and_in_fmpy(what, base, tmp_path):
    fmu = yb.export_fmu(LAWS[what], tmp_path / "my.fmu")
    by_fmu, by_program = (base.swap(controller=one).run() for one in (fmu, LAWS[what]))
    assert list(by_fmu) == list(by_program)
    assert all(np.array_equal(by_fmu[name], by_program[name]) for name in by_fmu)
    translated = by_program.record["fmus"]["controller"]["runs_as"] == "native"
    assert (by_fmu.record["fmus"]["controller"]["runs_as"] == "native") >= translated
    driven = {name: by_program[f"plant.{name}"] for name in ("yaw_rate", "sideslip")}
    columns = [("time", float), *((name, float) for name in driven)]
    table = np.array(list(zip(by_program.time, *driven.values(), strict=True)), dtype=columns)
    result = fmpy.simulate_fmu(
        str(fmu), input=table, output=["yaw_moment"], stop_time=0.5, output_interval=0.01
    )
    assert np.all(np.isfinite(result["yaw_moment"]))
    assert fmpy.read_model_description(str(fmu)).modelName == "my"


def test_modules_of_the_own_package_are_packed_with_it(ourlab, base, tmp_path):
    program = ourlab("laws").law
    fmu = yb.export_fmu(program, tmp_path / "packed.fmu")
    changed = {"controller.gain": 2.5e4}
    by_fmu, by_program = (base.swap(controller=one).set(changed).run() for one in (fmu, program))
    assert np.array_equal(by_fmu["controller.yaw_moment"], by_program["controller.yaw_moment"])
    assert np.ptp(by_fmu["controller.yaw_moment"]) > 0
    alone = "; ".join([
        "import fmpy, sys",
        "result = fmpy.simulate_fmu(sys.argv[1], start_values={'yaw_rate': 1.0})",
        "print(result[-1][1])",
    ])  # fmt: skip
    for units in ("python", ""):  # in another process, which has no such package
        done = subprocess.run(
            [sys.executable, "-c", alone, fmu],
            env=os.environ | {"YAWBENCH_UNITS": units},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.stdout.split()[-1:] == ["-450.0"], done.stderr


def reads_a_file(yaw_rate):
    return LOG.tell()


def uses_numpy(yaw_rate):
    return np.tanh(yaw_rate)


REFUSED: dict[str, tuple[Any, ...]] = {
    "a file": (lambda get: reads_a_file, "my:", "reads_a_file", "LOG", "io.StringIO"),
    "numpy": (lambda get: uses_numpy, "my:", "uses_numpy", "numpy"),
    "an array": (lambda get: times(np.ones(3)), "my:", "factor", "numpy.ndarray"),
    "no source": (lambda get: eval("lambda yaw_rate: 1.0"), "my:", "<lambda>", "<string>:1"),
    "a method": (lambda get: Data().output, "output", "'u'"),
    "a foreign import": (lambda get: get("foreign").law, "my:", "law", "numpy"),
    "a foreign import of a module": (
        lambda get: get("deeply_foreign").law,
        "my:",
        "ourlab/foreign.py:1",
        "numpy",
    ),
    "the name of an FMU": (lambda get: "controller_off", "'controller_off'"),
    "a class": (lambda get: Data, "Data", "Data()"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_an_fmu_cannot_take_along_is_refused_in_a_sentence(what, ourlab, tmp_path):
    get, *names = REFUSED[what]
    with refused(yb.YawbenchError, names=names):
        yb.export_fmu(get(ourlab), tmp_path / "my.fmu")
    assert not list(tmp_path.iterdir())


def test_names_and_roles_that_no_fmu_can_have_are_refused(tmp_path):
    for wrong, names in (
        ({"file": "my controller.fmu"}, ("file", ".fmu", "'my controller.fmu'")),
        ({"file": "my.zip"}, ("file", ".fmu", "'my.zip'")),
        ({"file": "my.fmu", "role": "pilot"}, ("role", "driver", "monitor", "'pilot'")),
    ):
        with refused(yb.ScenarioError, "argument-invalid", names=names):
            yb.export_fmu(law, **wrong)


class Filtered:
    """A law with a step of its own, by which it advances."""

    inputs, outputs = ("yaw_rate",), ("yaw_moment",)
    step_size = 0.004

    def start(self, t, u):
        self.x = 0.0

    def advance(self, t, h, u):
        self.x += h * (u.yaw_rate - self.x)

    def output(self, t, u):
        return 1e4 * self.x


class Difference(Filtered):
    """The same as a difference equation, right for its own step alone."""

    def advance(self, t, h, u):
        self.x += 0.004 * (u.yaw_rate - self.x)


class Plain:
    """A law without a state."""

    inputs, outputs = ("yaw_rate",), ("yaw_moment",)
    step_size = 0.02

    def output(self, t, u):
        return 1e4 * u.yaw_rate


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(
    ("law", "step", "any_step"),
    [(Filtered(), 0.004, True), (Difference(), 0.004, False), (Plain(), 0.02, True)],
)
def test_the_step_of_a_law_is_that_of_its_fmu_and_the_only_one_if_its_state_does_not_follow_it(
    law, step, any_step, fmi, tmp_path
):
    fmu = yb.export_fmu(law, tmp_path / "stepped.fmu", fmi=fmi)
    described = fmpy.read_model_description(str(fmu))
    assert float(described.defaultExperiment.stepSize) == step
    assert described.coSimulation.canHandleVariableCommunicationStepSize is any_step
    inputs = np.array([(0.0, 0.1)], dtype=[("time", float), ("yaw_rate", float)])
    made = fmpy.simulate_fmu(str(fmu), stop_time=10 * step, input=inputs, output=["yaw_moment"])
    assert np.diff(made["time"]) == pytest.approx(step)


def test_another_step_than_the_only_one_is_warned_of_and_the_own_is_not(base, tmp_path):
    fmu = yb.export_fmu(Difference(), tmp_path / "stepped.fmu")
    with pytest.warns(yb.YawbenchWarning, match="step_size=0.004"):
        base.swap(controller=fmu).run()
    by_fmu = base.swap(controller=fmu).set({"controller.step_size": 0.004}).run()
    by_python = base.swap(controller=Difference()).run()
    assert (by_fmu["controller.yaw_moment"] == by_python["controller.yaw_moment"]).all()


def test_laws_that_differ_in_their_step_alone_are_not_one_fmu(tmp_path):
    slow = Plain()
    slow.step_size = 0.05
    guids = [
        fmpy.read_model_description(str(yb.export_fmu(law, tmp_path / f"{folder}" / "plain.fmu"))).guid
        for folder, law in (("a", Plain()), ("b", slow))
        if (tmp_path / folder).mkdir() is None
    ]
    assert len({*guids}) == 2
