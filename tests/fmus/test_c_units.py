"""Units written in C: built from a folder, with one sentence for whatever is wrong."""

from __future__ import annotations

import contextlib
import io
import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest

from tests.fmus.bare import Fmu, Refused, Unit
from tests.fmus.programs import begun, in_windows, in_wine, run, ten_steps
from tests.refusals import each_mentions, mentions, refused
from yawbench.fmus import recipe
from yawbench.fmus.build import build_all, build_component
from yawbench.fmus.build_stamp import Edition, read_stamp
from yawbench.fmus.c import c_recipe
from yawbench.fmus.compiler import MINGW, TO_WINDOWS, compile_library
from yawbench.foundation.errors import BuildError

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")


@pytest.fixture
def root(tmp_path, monkeypatch):
    """A folder of components with one controller in C, `idea`, that is compiled for Linux, and fast."""
    flags = ["-O0" if flag == "-O2" else flag for flag in c_recipe.FLAGS]
    monkeypatch.setattr(c_recipe, "FLAGS", flags)
    monkeypatch.setattr(recipe, "MINGW", "no compiler")
    return begun(tmp_path).parents[1]


@pytest.fixture
def folder(root):
    return root / "controllers" / "idea"


@pytest.fixture(scope="module")
def fmu(tmp_path_factory, unpack):
    """Its FMU as it is begun, and its library loaded; the compiler has nothing to warn of."""
    folder = tmp_path_factory.mktemp("begun")
    with contextlib.redirect_stderr(io.StringIO()) as said, pytest.MonkeyPatch.context() as patch:
        patch.setattr(recipe, "MINGW", "no compiler")
        made = build_component(begun(folder), folder / "out")
    assert said.getvalue() == ""
    return Fmu(unpack(made))


def edited(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


def problems(folder: Path) -> str:
    with pytest.raises(BuildError) as error:
        build_component(folder, folder.parents[2] / "out")
    assert not (folder.parents[2] / "out" / "controller_idea.fmu").exists()
    return str(error.value)


def test_only_what_has_changed_is_built_again(root, folder, tmp_path):
    assert build_all(tmp_path / "out", root=root).built == ["controller_idea"]
    assert build_all(tmp_path / "out", root=root).current == ["controller_idea"]
    first = (tmp_path / "out" / "controller_idea.fmu").read_bytes()
    build_all(tmp_path / "there", root=shutil.copytree(root, tmp_path / "other" / "components"))
    assert (tmp_path / "there" / "controller_idea.fmu").read_bytes() == first
    edited(folder / "idea.c", "s->x = 0.0", "s->x = 0.5")
    assert build_all(tmp_path / "out", root=root).built == ["controller_idea"]


def test_a_library_that_the_linker_does_not_find_is_named():
    with refused(BuildError, "compiler-failed", names=("-lnowhere",)):
        compile_library(["cc"], {"a.c": b"int a;"}, "-shared", "-fPIC", "a.c", "-lnowhere")


def test_an_fmu_whose_sources_are_broken_stays_and_one_whose_sources_are_gone_is_removed(
    root, folder, tmp_path
):
    target = tmp_path / "out" / "controller_idea.fmu"
    build_all(tmp_path / "out", root=root)
    edited(folder / "idea.c", "s->x = 0.0;", "s->x = nothing;")
    with refused(BuildError, "compiler-failed", names=("controller_idea", "idea.c:26:12")):
        build_all(tmp_path / "out", root=root)
    assert target.exists()
    edited(folder / "idea.c", "nothing", "0.0")
    build_all(tmp_path / "out", root=root)
    assert read_stamp(target).source == "components/controllers/idea"
    shutil.rmtree(folder)
    assert build_all(tmp_path / "out", root=root).removed == ["controller_idea"]
    assert not target.exists()


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        ("</fmiModelDescription>", "", ("well-formed",)),
        ('modelIdentifier="controller_idea"', 'modelIdentifier="x"', ('modelIdentifier="controller_idea"',)),
        ('valueReference="5"', 'valueReference="7"', ("moment_limit", "reference 5")),
        ('name="yaw_moment"', 'name="moment"', ("yaw_moment", "controller", "declare")),
        ('name="yaw_rate"', 'name="yaw rate"', ("'yaw rate'", "valid")),
        ('causality="input"', 'causality="local"', ("yaw_rate", "output", "parameter")),
        ('<Real unit="N.m" start', "<Integer start", ("moment_limit", "Real")),
        ('min="0"', 'min="none"', ("'none'", "min")),
        ('unit="N.m/rad" start', 'unit="N/rad" start', ('unit "N/rad"',)),
    ],
)
def test_a_wrong_model_description_is_told_in_one_sentence(folder, old, new, names):
    edited(folder / "modelDescription.xml", old, new)
    assert mentions(problems(folder), *names)


def test_what_is_missing_is_named(folder, root, monkeypatch):
    edited(folder / "idea.c", "fabs(law(s, v))", "strange(law(s, v))")
    assert "strange" in problems(folder)
    (folder / "idea.c").unlink()
    assert mentions(problems(folder), "controller_idea", "idea")
    (root / "controllers" / "idea.py").touch()
    assert mentions(problems(folder), "idea.py")
    monkeypatch.setenv("CC", "no-such-compiler")
    (root / "controllers" / "idea.py").unlink()
    assert mentions(problems(folder), "controller_idea", "no-such-compiler", "CC")


def test_a_folder_without_a_role_or_a_model_description_is_refused(folder, tmp_path):
    with refused(BuildError, "component-invalid", names=("modelDescription.xml", "component")):
        build_component(tmp_path, tmp_path / "out")
    moved = shutil.copytree(folder, tmp_path / "idea")
    with pytest.raises(BuildError, match="which role"):
        build_component(moved, tmp_path / "out")


def test_parameters_can_be_set_within_their_range_until_initialization_ends_and_outputs_never(fmu):
    unit = Unit(fmu, yaw_rate_ref=0.1, proportional_gain=1000.0)
    assert unit.outputs() == [100.0]
    unit.set(yaw_rate_ref=0.2)
    with pytest.raises(Refused):
        unit.set(yaw_moment=1.0)
    unit.start()
    assert unit.outputs() == [200.0]
    with pytest.raises(Refused):
        unit.set(integral_gain=1.0)
    assert mentions(unit.messages[-1], "integral_gain", "set", "initialization")
    unit = Unit(fmu, proportional_gain=-1.0)
    with pytest.raises(Refused):
        unit.start()
    assert each_mentions(unit.messages, ("proportional_gain", "0", "-1"))


def test_it_runs_in_a_c_host_without_python(fmu, tmp_path, host):
    program = [str(host), str(fmu.binary), (fmu.folder / "resources").as_uri(), fmu.guid]
    done = run([*program, "0", "6", "0=0.1"], tmp_path)
    assert done.returncode == 0, done.stderr
    moment = float(done.stdout.split()[2])
    assert moment == pytest.approx(20000.0 * 0.1 + 50000.0 * 0.1 * 0.01)
    if shutil.which("valgrind"):
        strict = ["valgrind", "-q", "--leak-check=full", "--error-exitcode=9"]
        assert run([*strict, *program, "0", "6", "0=0.1"], tmp_path).returncode == 0


@pytest.mark.skipif(shutil.which(MINGW) is None, reason=f"there is no {MINGW}")
def test_a_unit_in_c_gets_a_library_for_windows_where_a_compiler_makes_one(tmp_path):
    folder = begun(tmp_path)
    first = build_component(folder, tmp_path / "a")
    with zipfile.ZipFile(first) as fmu:
        names = {name for name in fmu.namelist() if name.startswith("binaries/")}
        assert names == {"binaries/linux64/controller_idea.so", "binaries/win64/controller_idea.dll"}
        for name in names:
            (tmp_path / Path(name).name).write_bytes(fmu.read(name))
    objdump = MINGW.replace("gcc", "objdump")
    linux, windows = (
        subprocess.run([*map(str, command)], capture_output=True, text=True, check=True).stdout
        for command in (
            ("nm", "-D", "--defined-only", tmp_path / "controller_idea.so"),
            (objdump, "-p", tmp_path / "controller_idea.dll"),
        )
    )
    exported = {line.split()[-1] for line in linux.splitlines() if "fmi2" in line}
    assert exported
    assert exported <= set(windows.split("[Ordinal/Name Pointer] Table")[1].split())
    assert "libgcc" not in windows
    once = first.read_bytes()
    assert build_component(folder, tmp_path / "a", force=True).read_bytes() == once


@in_windows
def test_the_library_for_windows_steps_as_the_one_for_linux(unpack, tmp_path, wine_prefix):
    edition = Edition(platforms=(TO_WINDOWS.name,))
    archive = build_component(begun(tmp_path), tmp_path / "out", edition=edition)
    fmu = Fmu(unpack(archive))
    inputs = {"yaw_rate_ref": 0.1, "yaw_rate": 0.02}
    assert in_wine([(fmu, inputs)], tmp_path, wine_prefix) == [ten_steps(fmu, inputs)]
