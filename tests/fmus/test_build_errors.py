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
from yawbench.fmus.build import COMPONENTS, build_all, build_component
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


@pytest.fixture
def attempt(tmp_path):
    """Write a controller with some text replaced, try to build it and return the problems."""

    def do(*replacements, **options):
        text = GOOD
        for old, new in replacements:
            assert old in text
            text = text.replace(old, new)
        file = tmp_path / "own work" / "controllers" / "idea.py"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, "utf-8")
        with pytest.raises(BuildError) as caught:
            build_component(file, tmp_path / "out", **options)
        assert list(tmp_path.glob("out/*")) == []
        return [*texts_of(caught.value)]

    return do


def test_a_syntax_error_names_file_and_line(attempt):
    (problem,) = attempt(("return (-self.p.gain * u[0],)", "return (-self.p.gain * u[0],"))
    assert mentions(problem, "controller_idea", "controllers/idea.py:28", "SyntaxError", "'('")


def test_an_unknown_unit_lists_the_known_ones(attempt):
    (problem,) = attempt(('"N.m.s/rad"', '"Nms"'))
    assert mentions(
        problem,
        "controller_idea",
        "DeclarationError",
        "Parameters.gain",
        "'Nms'",
        "rad.s",
        "Pa/s",
        "controllers/idea.py:19",
        "1",
    )
    assert problem.endswith("(controllers/idea.py:19)")


def test_an_unknown_signal_is_named(attempt):
    (problem,) = attempt(('inputs = ("yaw_rate",)', 'inputs = ("yawrate",)'))
    assert mentions(problem, "'yawrate'", "signal", "dictionary")


def test_a_signal_that_the_role_demands_is_named(attempt):
    problems = attempt(('"yaw_moment"', '"drive_force"'))
    assert each_mentions(problems, ("controller_idea", "yaw_moment"))


def test_every_missing_signal_of_the_role_is_named(attempt):
    problems = attempt(('"yaw_moment"', '"wheel_torque_fl", "wheel_torque_fr"'), role="actuators")
    assert each_mentions(
        problems,
        ("actuator_idea", "torque_request_*"),
        ("actuator_idea", "wheel_torque_rl", "wheel_torque_rr"),
    )


def test_an_import_from_outside_the_standard_library_is_refused(attempt):
    (problem,) = attempt(("from dataclasses import", "import numpy\nfrom dataclasses import"))
    assert mentions(
        problem, "controller_idea", "controllers/idea.py:5", "host_packages", '"numpy"', "`yawbench`"
    )


NEEDY = (
    ("from dataclasses import dataclass", "import {package}\nfrom dataclasses import dataclass"),
    ('    inputs = ("yaw_rate",)', '    host_packages = ("{package}",)\n    inputs = ("yaw_rate",)'),
)


def needy(package):
    """Return the controller with an import of a package that it declares."""
    text = GOOD
    for old, new in NEEDY:
        text = text.replace(old, new.format(package=package))
    return text


def test_a_package_that_the_component_declares_may_be_imported(tmp_path, unpack):
    file = tmp_path / "controllers" / "idea.py"
    file.parent.mkdir()
    file.write_text(needy("numpy").replace("(-self.p.gain", "(numpy.float64(-1.0) * self.p.gain"))
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


def test_a_host_without_a_declared_package_is_told_in_one_sentence(tmp_path, monkeypatch):
    monkeypatch.setenv("YAWBENCH_UNITS", "python")  # a native unit needs no package
    restart_checker()
    module = tmp_path / "modules" / "rare_package.py"
    module.parent.mkdir()
    module.touch()
    file = tmp_path / "controllers" / "idea.py"
    file.parent.mkdir()
    file.write_text(needy("rare_package"))
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


def test_a_package_that_is_not_the_declared_one_is_refused(attempt):
    (problem,) = attempt(
        ('    inputs = ("yaw_rate",)', '    host_packages = ("scipy",)\n    inputs = ("yaw_rate",)'),
        ("from dataclasses import", "import numpy\nfrom dataclasses import"),
    )
    assert "imports numpy" in problem


def test_an_import_that_only_type_checkers_see_is_allowed(tmp_path):
    text = GOOD.replace(
        "from dataclasses import",
        "from typing import TYPE_CHECKING\n\nif TYPE_CHECKING:\n    import numpy\nfrom dataclasses import",
    )
    file = tmp_path / "controllers" / "idea.py"
    file.parent.mkdir()
    file.write_text(text)
    assert build_component(file, tmp_path / "out").exists()


def test_an_import_of_the_whole_package_says_how_to_write_it(attempt):
    (problem,) = attempt(
        (
            "from yawbench.components.fmi.component import Component",
            "import yawbench.components.fmi.component",
        )
    )
    assert mentions(
        problem,
        "controller_idea",
        "controllers/idea.py:7",
        "'from yawbench.components.fmi.component import ...'",
    )


def test_a_module_that_does_not_exist_is_named_with_the_line(attempt):
    (problem,) = attempt(("yawbench.components.fmi.variables", "yawbench.components.fmi.variable"))
    assert mentions(problem, "controller_idea", "controllers/idea.py:8", "fmi.variable", "components", "fmi")


def test_a_module_that_stands_in_another_room_is_pointed_to(attempt):
    (problem,) = attempt(("yawbench.components.fmi.variables", "yawbench.components.core.variables"))
    assert mentions(
        problem,
        "controller_idea",
        "controllers/idea.py:8",
        "core.variables",
        "components",
        "yawbench.components.fmi.variables",
    )


def test_an_import_beyond_the_package_is_refused(attempt):
    (problem,) = attempt(("from yawbench.components.fmi.component", "from ....fmi.component"))
    assert mentions(problem, "controller_idea", "controllers/idea.py:7")


def test_a_file_without_a_component_is_refused(attempt):
    (problem,) = attempt(("class Idea(Component)", "class Idea"))
    assert mentions(problem, "controller_idea", "define", "component")


def test_a_file_with_two_components_is_refused(attempt):
    (problem,) = attempt(("class Idea(", "class First(Component):\n    pass\n\n\nclass Idea("))
    assert mentions(problem, "controller_idea", "First", "Idea")


def test_a_component_may_build_on_another_in_the_same_file(tmp_path):
    file = tmp_path / "controllers" / "idea.py"
    file.parent.mkdir()
    file.write_text(
        GOOD.replace("class Idea(Component)", "class Base(Component):\n    pass\n\n\nclass Idea(Base)")
    )
    assert build_component(file, tmp_path).exists()


def test_an_exception_while_importing_names_file_and_line(attempt):
    (problem,) = attempt(("class Idea", "LIMIT = 1 / 0\n\n\nclass Idea"))
    assert mentions(problem, "controller_idea", "ZeroDivisionError", "controllers/idea.py:19")


def test_leaving_the_interpreter_while_importing_is_an_error(attempt):
    (problem,) = attempt(("class Idea", "raise SystemExit(0)\n\n\nclass Idea"))
    assert mentions(problem, "controller_idea", "SystemExit", "0", "controllers/idea.py:19")


def test_a_unit_that_cannot_be_instantiated_is_an_error(attempt):
    (problem,) = attempt(
        (
            "    def output",
            "    def __init__(self, **kwargs):\n        super().__init__(**kwargs)\n"
            '        if "logger" in kwargs:\n            raise OSError("100 % stillborn")\n\n    def output',
        )
    )
    assert each_mentions(problem, ("controller_idea", "PyObject_Call"), ("'100 % stillborn'",))
    assert "OSError('100 % stillborn')" in problem


def test_a_name_that_is_no_identifier_is_an_error(attempt):
    (problem,) = attempt(
        ('"yaw_moment",', '"yaw_moment", signal("Gier winkel", "rad", "text"),'),
        ("import parameter", "import parameter, signal"),
    )
    assert mentions(problem, "'Gier winkel'", "lower-case", "letters")


def test_what_fmpy_finds_in_the_model_description_is_an_error(attempt):
    spoilt = """    def to_xml(self, model_options=None):
        root = super().to_xml(model_options)
        structure = root.find("ModelStructure")
        structure.remove(structure.find("InitialUnknowns"))
        return root

    def output"""
    (problem,) = attempt(("    def output", spoilt))
    assert mentions(problem, "controller_idea", "ModelStructure/InitialUnknowns", "yaw_moment")
    assert "InitialUnknowns" in problem


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


def test_a_component_of_the_project_can_be_built_by_its_file(tmp_path):
    fmu = build_component(COMPONENTS / "tyres" / "linear.py", tmp_path)
    assert fmu.name == "tyre_linear.fmu"


def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path, monkeypatch):
    build_all(tmp_path, components=["tyre_linear"])

    def refuse(*args, **kwargs):
        raise PermissionError(13, "Permission denied", str(tmp_path))

    monkeypatch.setattr("yawbench.foundation.safe_files.claim", refuse)
    with pytest.raises(BuildError) as caught:
        build_all(tmp_path, components=["tyre_linear"], force=True)
    assert each_mentions(texts_of(caught.value), ("tyre_linear", "[Errno 13]"))


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
