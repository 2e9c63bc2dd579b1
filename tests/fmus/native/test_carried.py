"""Native library in an FMU: one archive, Python beside it, either of them on request."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import zipfile

import pytest

from tests.checkout import ROOT
from tests.fmus.programs import begun
from tests.refusals import mentions
from yawbench.fmus.archive import REASON, runs_as
from yawbench.fmus.build import build_component
from yawbench.fmus.fmu import RunsAs

LAW = '''"""A law."""

from dataclasses import dataclass

from yawbench.components.fmi.component import Component
from yawbench.components.fmi.variables import output, parameter


@dataclass(frozen=True)
class LawParameters:
    """Parameters of the law."""

    gain: float = parameter(2000.0, "N.m.s/rad", "Gain", "chosen: a test", minimum=0.0)


class Law(Component):
    """Yaw moment in proportion to the yaw rate's error."""

    Parameters = LawParameters
    sampled = True
    inputs = ("yaw_rate_ref", "yaw_rate")
    outputs = (output("yaw_moment", "yaw_rate_ref", "yaw_rate"),)

    def output(self, t, u):
        return (BODY,)
'''
PROGRAM = """
import json, sys, tempfile, zipfile
from tests.fmus.bare import Fmu, Unit
with tempfile.TemporaryDirectory() as folder:
    zipfile.ZipFile(sys.argv[1]).extractall(folder)
    unit = Unit(Fmu(folder), yaw_rate_ref=0.3, yaw_rate=0.1)
    unit.start()
    loaded = open("/proc/self/maps").read()
    print(json.dumps([unit.outputs()[0], "native.so" in loaded, "libpythonfmu" in loaded]))
    unit.free()
"""


def built(folder, body, law=LAW):
    """Return the FMU of the law, and its file."""
    file = folder / "controllers" / "controller_law.py"
    file.parent.mkdir()
    file.write_text(law.replace("BODY", body))
    return build_component(file, folder), file


def asked(archive, **environment):
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(archive)],
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout.splitlines()[-1])


def test_the_launcher_opens_the_native_library_and_python_on_request(tmp_path, monkeypatch):
    law, _ = built(tmp_path, "self.p.gain * (u[0] - u[1])")
    assert runs_as(law).native
    native, python = asked(law), asked(law, YAWBENCH_UNITS="python")
    assert native[1:] == [True, False] and python[1:] == [False, True]
    assert native[0] == python[0] == 2000.0 * (0.3 - 0.1)
    monkeypatch.setenv("YAWBENCH_UNITS", "python")
    assert mentions(str(runs_as(law)), "YAWBENCH_UNITS", "Python")


def test_what_is_not_translated_runs_in_python_and_says_why(tmp_path):
    made, file = built(tmp_path, "sum(x for x in u if x > 0.0)")
    line = file.read_text().splitlines().index("        return (sum(x for x in u if x > 0.0),)") + 1
    why = f"a filter that is only known at run time (controllers/controller_law.py:{line})"
    assert zipfile.ZipFile(made).read(REASON).decode() == why
    assert runs_as(made) == RunsAs(why)
    assert asked(made)[1:] == [False, True]


def test_a_component_that_reads_a_file_when_it_is_imported_runs_in_python(tmp_path):
    data = tmp_path / "gain.txt"
    data.write_text("2.0")
    read = f"\n\nGAIN = float(open({str(data)!r}).read())\n\n\n"
    made, file = built(tmp_path, "GAIN * (u[0] - u[1])", LAW.replace("\n\n\n", read, 1))
    line = next(k for k, text in enumerate(file.read_text().splitlines(), 1) if text.startswith("GAIN"))
    where = f"(controllers/controller_law.py:{line})"
    assert runs_as(made) == RunsAs(f"{data} is read at every import, and may change after the build {where}")
    before = asked(made)
    data.write_text("4.0")
    assert asked(made)[0] == 2.0 * before[0]


@pytest.mark.parametrize("kind", ["controller", "driver", "plant", "reference", "road", "tyre"])
@pytest.mark.sampled(2)
def test_what_yawbench_new_writes_is_native(kind, tmp_path):
    begun(tmp_path, kind, "python")
    assert runs_as(build_component(tmp_path / f"{kind}s" / "idea.py", tmp_path / "out")).native
