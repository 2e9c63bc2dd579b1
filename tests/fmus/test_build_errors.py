"""Errors of the build: file, line and remedy of a component that cannot become an FMU."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys

import pytest

from tests.fmus.bare import Fmu, Unit
from tests.fmus.fake_fmus import make_fmu
from tests.refusals import each_mentions, mentions, refused, texts_of
from yawbench.fmus import check
from yawbench.fmus.build import build_component
from yawbench.fmus.check import defects
from yawbench.fmus.opener import Opener, host_needs
from yawbench.foundation.errors import BuildError, ModelDescriptionError

GOOD = '''"""A controller."""

from __future__ import annotations

from dataclasses import dataclass

from yawbench.components.fmi.component import Component
from yawbench.components.fmi.variables import parameter


@dataclass(frozen=True)
class Parameters:
    gain: float = parameter(100.0, "N.m.s/rad", "Gain", "chosen: for the test", minimum=0.0)
    steps: int = parameter(2, None, "A number")
    fast: bool = parameter(False, None, "A switch")
    mode: str = parameter("a", None, "A choice", choices=("a", "b"))


class Idea(Component):
    """Somebody's own idea."""

    Parameters = Parameters
    inputs = ("yaw_rate",)
    outputs = ("yaw_moment",)
    sampled = True

    def output(self, t, u):
        return (-self.p.gain * u[0],)
'''


HEAD = "from dataclasses import"
FMI = "yawbench.components.fmi"
INPUTS = '    inputs = ("yaw_rate",)'
FIRST = "\n\n\nclass Idea"
"""Texts of it that are replaced."""
STILLBORN = """    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        if "logger" in kwargs:
            raise OSError("100 % stillborn")

"""
SPOILT = """    def to_xml(self, model_options=None):
        root = super().to_xml(model_options)
        structure = root.find("ModelStructure")
        structure.remove(structure.find("InitialUnknowns"))
        return root

"""
WRONG = {
    "syntax": (("* u[0],)", "* u[0],"), "controllers/idea.py:28", "SyntaxError", "'('"),
    "unit": (
        ('"N.m.s/rad"', '"Nms"'),
        *("DeclarationError", "Parameters.gain", "'Nms'", "rad.s", "Pa/s", "(controllers/idea.py:19)"),
    ),
    "signal": (('("yaw_rate",)', '("yawrate",)'), "'yawrate'", "signal", "dictionary"),
    "signal of the role": (('"yaw_moment"', '"drive_force"'), "yaw_moment"),
    "name": (
        ('"yaw_moment",', '"yaw_moment", signal("Gier winkel", "rad", "text"),'),
        ("import parameter", "import parameter, signal"),
        *("'Gier winkel'", "lower-case", "letters"),
    ),
    "package": ((HEAD, f"import numpy\n{HEAD}"), "controllers/idea.py:5", "host_packages", '"numpy"'),
    "not the declared package": (
        (INPUTS, f'    host_packages = ("scipy",)\n{INPUTS}'),
        (HEAD, f"import numpy\n{HEAD}"),
        *("controllers/idea.py:5", "imports numpy"),
    ),
    "whole package": (
        (f"from {FMI}.component import Component", f"import {FMI}.component"),
        *("controllers/idea.py:7", f"'from {FMI}.component import ...'"),
    ),
    "no module": ((f"{FMI}.variables", f"{FMI}.variable"), "controllers/idea.py:8", "fmi.variable"),
    "module of another room": (
        (f"{FMI}.variables", "yawbench.components.core.variables"),
        *("controllers/idea.py:8", "core.variables", f"{FMI}.variables"),
    ),
    "beyond the package": ((f"from {FMI}.component", "from ....fmi.component"), "controllers/idea.py:7"),
    "no component": (("class Idea(Component)", "class Idea"), "define", "component"),
    "two components": ((FIRST, f"\n\n\nclass First(Component):\n    pass{FIRST}"), "First", "Idea"),
    "exception": ((FIRST, f"\nL = 1 / 0{FIRST}"), "ZeroDivisionError", "controllers/idea.py:17"),
    "exit": ((FIRST, f"\nraise SystemExit(0){FIRST}"), "SystemExit", "0", "controllers/idea.py:17"),
    "no instance": (("    def output", f"{STILLBORN}    def output"), "PyObject_Call"),
    "description": (
        ("    def output", f"{SPOILT}    def output"),
        *("ModelStructure/InitialUnknowns", "yaw_moment"),
    ),
}
"""What is wrong -> replacements in the text, and what the sentence names."""


def text_with(*replacements):
    text = GOOD
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    return text


@pytest.fixture
def write(tmp_path):
    """Write a controller with some text replaced, and return its file."""

    def do(*replacements):
        file = tmp_path / "own work" / "controllers" / "idea.py"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text_with(*replacements), "utf-8")
        return file

    return do


@pytest.fixture
def attempt(write, tmp_path):
    """Write a controller with some text replaced, try to build it and return the problems."""

    def do(*replacements, **options):
        with pytest.raises(BuildError) as caught:
            build_component(write(*replacements), tmp_path / "out", **options)
        assert list(tmp_path.glob("out/*")) == []
        return [*texts_of(caught.value)]

    return do


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_is_told_in_one_sentence_with_its_place(attempt, what):
    (problem,) = attempt(*(one for one in WRONG[what] if isinstance(one, tuple)))
    assert mentions(problem, "controller_idea", *(one for one in WRONG[what] if isinstance(one, str)))
    assert ("stillborn" in problem) == (what == "no instance")


def test_every_missing_signal_of_the_role_is_named(attempt):
    problems = attempt(('"yaw_moment"', '"wheel_torque_fl", "wheel_torque_fr"'), role="actuators")
    assert each_mentions(
        problems,
        ("actuator_idea", "torque_request_*"),
        ("actuator_idea", "wheel_torque_rl", "wheel_torque_rr"),
    )


RIGHT = {
    "an import that only type checkers see": (
        (HEAD, f"from typing import TYPE_CHECKING\n\nif TYPE_CHECKING:\n    import numpy\n{HEAD}"),
    ),
    "a component that builds on another": (
        ("class Idea(Component)", "class Base(Component):\n    pass\n\n\nclass Idea(Base)"),
    ),
}


@pytest.mark.parametrize("what", RIGHT)
def test_what_is_allowed_is_built(write, tmp_path, what):
    assert build_component(write(*RIGHT[what]), tmp_path / "out").exists()


def needy(package):
    """Return the replacements for an import of a package that is declared."""
    return (
        (HEAD, f"import {package}\n{HEAD}"),
        (INPUTS, f'    host_packages = ("{package}",)\n{INPUTS}'),
    )


def test_a_package_that_the_component_declares_may_be_imported(write, tmp_path, unpack):
    file = write(*needy("numpy"), ("(-self.p.gain", "(numpy.float64(-1.0) * self.p.gain"))
    fmu = build_component(file, tmp_path / "out")
    unit = Unit(Fmu(unpack(fmu)), yaw_rate=0.5)
    unit.start()
    assert unit.outputs() == [-50.0]
    unit.free()
    opener = Opener()
    opened = opener.open(opener.bring(fmu))
    assert opened.host_packages == ("numpy",)
    (need,) = host_needs([opened])
    assert mentions(need.message, "controller_idea", "numpy", "host")
    assert mentions((opened.directory / "documentation/index.html").read_text(), "host", "Python", "numpy")


def test_a_host_without_a_declared_package_is_told_in_one_sentence(write, tmp_path, monkeypatch):
    monkeypatch.setenv("YAWBENCH_UNITS", "python")  # a native unit needs no package
    restart_checker()
    module = tmp_path / "modules" / "rare_package.py"
    module.parent.mkdir()
    module.touch()
    file = write(*needy("rare_package"))
    with monkeypatch.context() as patch:
        patch.syspath_prepend(str(module.parent))
        restart_checker()  # a process with this path
        fmu = build_component(file, tmp_path / "out")
        assert Opener().open(fmu)
    sys.modules.pop("rare_package", None)
    restart_checker()
    with pytest.raises(ModelDescriptionError) as caught:
        Opener().open(fmu)
    assert caught.value.code == "fmu-needs-packages"
    assert mentions(caught.value, "controller_idea.fmu", "rare_package", "venv")
    (problem,) = defects(fmu)
    assert each_mentions(
        problem,
        ("findClass", "load", "exception"),
        ("ImportError", "controller_idea", "rare_package", "venv"),
    )


def restart_checker():
    if check._checker is not None:
        check._checker.close(kill=True)
        check._checker = None


@pytest.mark.parametrize(
    ("defaults", "message"),
    [
        ({"gian": 1.0}, "has no parameter 'gian'; it has: gain, steps, fast, mode"),
        ({"gain": "much"}, "parameter gain must be of type float (got str)"),
        ({"steps": 1.5}, "parameter steps must be of type int (got float)"),
        ({"fast": 1}, "parameter fast must be of type bool (got int)"),
        ({"gain": -1.0}, "gain must be at least 0 (got -1.0)"),
        ({"mode": "c"}, "mode must be one of a, b (got 'c')"),
    ],
)
def test_other_defaults_must_fit_the_parameters(attempt, defaults, message):
    assert attempt(defaults=defaults) == [f"controller_idea: {message}"]


def test_a_file_without_a_role_or_that_does_not_exist_is_an_error(tmp_path):
    with refused(BuildError, "component-unreadable", names=("none.py", "file")):
        build_component(tmp_path / "controllers" / "none.py", tmp_path)
    (tmp_path / "idea.py").write_text(GOOD)
    with refused(BuildError, "component-without-role", names=("idea.py", "drivers", "monitors")):
        build_component(tmp_path / "idea.py", tmp_path)
    (tmp_path / "own-idea.py").write_text(GOOD)
    with refused(BuildError, "component-invalid", names=("controller_own-idea", "letters", "digits")):
        build_component(tmp_path / "own-idea.py", tmp_path, role="controllers")


@pytest.mark.parametrize("place", ["controllers/idea.py", "controller_idea.py"])
def test_a_file_from_anywhere_becomes_an_fmu_with_its_neighbours(tmp_path, unpack, place):
    file = tmp_path / "my own work" / place
    file.parent.mkdir(parents=True)
    text = GOOD.replace(
        "from yawbench.components.fmi.c", "from .gains import FACTOR\nfrom yawbench.components.fmi.c"
    )
    file.write_text(text.replace("-self.p.gain", "-FACTOR * self.p.gain"))
    (file.parent / "gains.py").write_text(
        "from yawbench.vocabulary.wheels import WHEELS\n\nFACTOR = len(WHEELS)\n"
    )
    fmu = build_component(file, tmp_path / "out", defaults={"gain": 10, "mode": "b", "fast": True})
    assert fmu == tmp_path / "out" / "controller_idea.fmu"
    unit = Unit(Fmu(unpack(fmu)), yaw_rate=0.5)
    assert (unit.get("gain"), unit.get("mode"), unit.get("fast")) == ([10.0], [b"b"], [1])
    unit.start()
    assert unit.outputs() == [-20.0]
    unit.free()


LEFT_ALONE = """
import os, time
from yawbench.fmus import check
check.defects({fmu!r})
if os.fork():
    print(check._checker.child.pid, flush=True)
time.sleep(60)  # the copy, too, with the pipe to the checker
"""


@pytest.mark.skipif(not hasattr(os, "pidfd_open"), reason="needs Linux")
def test_the_process_that_looks_at_fmus_ends_with_a_build_that_was_killed(tmp_path):
    make_fmu(tmp_path / "a.fmu")
    with subprocess.Popen(
        [sys.executable, "-c", LEFT_ALONE.format(fmu=str(tmp_path / "a.fmu"))],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, start_new_session=True,
    ) as build:  # fmt: skip
        assert build.stdout is not None
        checker = int(build.stdout.readline())
        try:
            ended = select.poll()
            ended.register(os.pidfd_open(checker), select.POLLIN)
            build.kill()
            assert ended.poll(30_000)
        finally:
            os.killpg(build.pid, signal.SIGKILL)
