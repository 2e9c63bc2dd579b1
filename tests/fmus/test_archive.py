"""Archives that the build writes: valid, minimal, the same bytes everywhere, and written only if changed."""

from __future__ import annotations

import os
import posixpath
import shutil
import subprocess
import sys
import zipfile
from dataclasses import replace
from importlib.metadata import version
from xml.etree import ElementTree

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.util import read_csv, read_ref_opt_file
from lxml import html

from tests.fmus.test_rebuild_stale import without_native_libraries
from tests.refusals import each_mentions, mentions, refused, texts_of
from yawbench.fmus import build, compiler
from yawbench.fmus.archive import open_fmu
from yawbench.fmus.build import COMPONENTS, build_all, build_component, find_components, put
from yawbench.fmus.build import HERE as FMUS
from yawbench.fmus.build_stamp import read_stamp
from yawbench.fmus.check import reference_files
from yawbench.fmus.compiler import compile_launcher
from yawbench.fmus.packing import set_guid, to_bytes
from yawbench.fmus.reference_result import FOLDER
from yawbench.foundation.errors import BuildError
from yawbench.foundation.workers import Finished, Pool
from yawbench.orchestrator.plan import Instance
from yawbench.vocabulary.roles import role_in

NAMES = list(find_components())
SOME = ["controller_off", "driver_sine", "tyre_linear"]


class Here(Pool):
    """A pool that makes its calls in this process, on recipes as they are now."""

    def each(self, function, calls, **_):
        build._recipes.cache_clear()
        return (Finished(k, 0.0, function(*one)) for k, one in enumerate(calls))


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A copy of three components and of what they need, in a folder of another name, built here and soon."""
    monkeypatch.setattr(build, "Pool", Here)
    without_native_libraries(monkeypatch)
    root = tmp_path / "another checkout" / "components"
    for room in ("fmi", "mathematics", "driving", "tyre_models"):
        shutil.copytree(COMPONENTS / room, root / room, ignore=shutil.ignore_patterns("__pycache__"))
    (root / "__init__.py").write_bytes((COMPONENTS / "__init__.py").read_bytes())
    for path in ("controllers/off.py", "drivers/sine.py", "tyres/linear.py"):
        target = root / path
        target.parent.mkdir()
        for source in (COMPONENTS / path, (COMPONENTS / path).parent / "__init__.py"):
            (target.parent / source.name).write_bytes(source.read_bytes())
    return root


def touch(root, path, text="\n# touched\n"):
    file = root / path
    file.write_text(file.read_text("utf-8") + text, "utf-8")


def described(fmu):
    """Return the root of an FMU's model description."""
    with zipfile.ZipFile(fmu) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml"))


@pytest.mark.parametrize("name", NAMES)
def test_every_variable_carries_unit_description_and_dependencies(archive, name):
    root = described(archive(name))
    units = {unit.get("name") for unit in root.iter("Unit")}
    variables = list(root.iter("ScalarVariable"))
    for variable in variables:
        assert (variable.get("description") or "").strip(), variable.get("name")
        if variable[0].tag == "Real":
            assert variable[0].get("unit") in units, variable.get("name")
    outputs = {str(i) for i, v in enumerate(variables, 1) if v.get("causality") == "output"}
    listed = list(root.iterfind("ModelStructure/Outputs/Unknown"))
    assert {unknown.get("index") for unknown in listed} == outputs
    assert all(unknown.get("dependencies") is not None for unknown in listed)
    assert {u.get("index") for u in root.iterfind("ModelStructure/InitialUnknowns/Unknown")} == outputs
    capabilities = root.find("CoSimulation").attrib
    assert capabilities["canGetAndSetFMUstate"] == capabilities["canSerializeFMUstate"] == "true"


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.sampled(5)
def test_a_host_is_shown_who_made_an_fmu_what_it_is_and_that_it_needs_no_tool(archive, name):
    root = described(archive(name))
    with zipfile.ZipFile(archive(name)) as fmu:
        page = html.fromstring(fmu.read("documentation/index.html"))
        icon = fmu.read("model.png")
    assert root.find("CoSimulation").get("needsExecutionTool") == "false"
    assert root.find("VendorAnnotations/Tool[@name='yawbench']/role").get("name") == role_in(name)
    shown = ("author", "copyright", "license", "version", "description", "generationDateAndTime")
    assert [key for key in shown if not root.get(key)] == []
    assert root.get("generationTool") == f"yawbench {version('yawbench')}"
    assert icon.startswith(b"\x89PNG")
    assert len(icon) < 6000
    rows = {row[0].text_content(): row for row in page.iter("tr") if len(row) > 3}
    for variable in root.iter("ScalarVariable"):
        row = [cell.text_content() for cell in rows[variable.get("name")]]
        said = variable.find("Annotations/Tool[@name='yawbench']/variable")
        source = [said.get("source")] if variable.get("causality") == "parameter" else []
        assert row[-1 - len(source) :] == [variable.get("description"), *source]
        assert row[1] == variable[0].get("unit", "")
    assert "class " in page.xpath("//h3/following-sibling::pre")[0].text_content()


def test_an_fmu_declares_its_role_whatever_its_file_is_called(archive, tmp_path):
    (copy := tmp_path / "sensor_of_ours.fmu").write_bytes(archive("driver_sine").read_bytes())
    fmu = open_fmu(copy)
    assert fmu.role == "driver"
    for role, name, of_instance in (
        ("driver", "", "driver"),
        ("", "sensor_of_ours", "sensor"),
        ("", "body", "car"),
    ):
        assert Instance("car", replace(fmu, role=role, name=name), 1, {}, {}).role == of_instance


def test_credits_of_a_users_own_component_are_those_that_it_declares(tmp_path, monkeypatch):
    without_native_libraries(monkeypatch)
    file = tmp_path / "controllers" / "idea.py"
    file.parent.mkdir()
    text = (COMPONENTS / "controllers" / "off.py").read_text().replace("from ..", "from yawbench.components.")
    for credits in ({}, {"author": "Ada", "license": "CC0-1.0"}):
        declared = "".join(f"    {key} = {value!r}\n" for key, value in credits.items())
        file.write_text(text.replace("    outputs =", f"{declared}    outputs ="))
        root = described(build_component(file, tmp_path / "out"))
        assert {key: root.get(key) for key in ("author", "copyright", "license") if root.get(key)} == credits


def test_an_archive_holds_what_the_fmu_needs_and_nothing_else(archive):
    with zipfile.ZipFile(archive("controller_off")) as fmu:
        names = fmu.namelist()
        module = fmu.read("resources/slavemodule.txt").decode()
    package = module.replace("controller_off_", "yawbench_")
    assert names == sorted(names)
    assert [name for name in names if not name.startswith(f"resources/{package}/")] == [
        "binaries/linux64/controller_off.so",
        "binaries/linux64/libpythonfmu-export.so",
        "binaries/linux64/native.so",
        "binaries/win64/controller_off.dll",
        "documentation/index.html",
        *(f"{FOLDER}/{file}" for file in ("controller_off_in.csv", "controller_off_ref.csv")),
        *(f"{FOLDER}/{file}" for file in ("controller_off_ref.opt", "fmi-ls-manifest.xml")),
        "extra/org.yawbench.native/native.txt",
        "model.png",
        "modelDescription.xml",
        f"resources/{module}.py",
        "resources/guid.txt",
        "resources/slavemodule.txt",
    ]
    inside = {name.removeprefix(f"resources/{package}/") for name in names if f"/{package}/" in name}
    assert {"controllers/off.py", "fmi/component.py", "pythonfmu/fmi2slave.py"} <= inside
    assert not {"mathematics/fuzzy.py", "pythonfmu/builder.py", "pythonfmu/deploy.py"} & inside


@pytest.mark.exhaustive
def test_the_same_sources_give_the_same_bytes_from_another_folder(checkout, tmp_path):
    build_all(tmp_path / "here", components=SOME)
    build_all(tmp_path / "there", root=checkout)
    for name in SOME:
        here, there = (tmp_path / place / f"{name}.fmu" for place in ("here", "there"))
        assert here.read_bytes() == there.read_bytes()


def test_the_same_sources_give_the_same_bytes_in_another_process(tmp_path):
    """With another hash seed, so no order of a set or dictionary leaks into the archive."""
    here, there = tmp_path / "here", tmp_path / "there"
    some = SOME[1:]
    build_all(here, components=some)
    script = f"from yawbench.fmus.build import *; build_all(Path({str(there)!r}), components={some})"
    environment = os.environ | {"PYTHONHASHSEED": "1"}
    subprocess.run([sys.executable, "-c", script], env=environment, cwd=COMPONENTS.parent, check=True)
    for name in some:
        assert (here / f"{name}.fmu").read_bytes() == (there / f"{name}.fmu").read_bytes()


def test_the_launcher_compiles_to_the_same_bytes_again(tmp_path, monkeypatch):
    monkeypatch.setattr(compiler, "FLAGS", ["-O0" if flag == "-O2" else flag for flag in compiler.FLAGS])
    made = []
    for cache in ("a", "b"):
        monkeypatch.setenv("YAWBENCH_CACHE", str(tmp_path / cache))
        compiler._launcher.cache_clear()
        made.append(compile_launcher()[0])
        assert len(list(tmp_path.glob(f"{cache}/launcher/*"))) == 1
    compiler._launcher.cache_clear()
    assert made[0] is not None
    assert made[0] == made[1]


def test_an_fmu_whose_binary_ends_the_process_is_refused_in_one_sentence(checkout, tmp_path):
    build_all(tmp_path, components=["controller_off"], root=checkout)
    target = tmp_path / "controller_off.fmu"
    good = target.read_bytes()
    with zipfile.ZipFile(target) as fmu:
        files = {name: fmu.read(name) for name in fmu.namelist()}
    binary = "binaries/linux64/controller_off.so"
    spoilt = files | {binary: files[binary][: len(files[binary]) // 2]}
    for _ in range(2):  # what looks at FMUs is there again for the next
        with refused(BuildError, "component-invalid", names=("SIGBUS", "load", "process")):
            put(target, to_bytes(spoilt, read_stamp(target)))
    assert target.read_bytes() == good
    put(target, to_bytes(files, read_stamp(target)))
    assert [file.name for file in tmp_path.iterdir() if file.suffix != ".fmu"] == ["another checkout"]


def test_the_launcher_compiles_without_a_warning():
    flags = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Werror", "-fsyntax-only"]
    done = subprocess.run(["cc", *flags, "launcher.c"], cwd=FMUS, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_windows_line_ends_make_no_difference(checkout, tmp_path):
    build_all(tmp_path / "unix", root=checkout)
    for file in checkout.rglob("*.py"):
        file.write_bytes(file.read_bytes().replace(b"\n", b"\r\n"))
    assert build_all(tmp_path / "unix", root=checkout).built == []


def test_only_what_has_changed_is_built(checkout, tmp_path):
    out = tmp_path / "out"
    assert build_all(out, root=checkout).built == SOME
    assert build_all(out, root=checkout).current == SOME
    guid = described(out / "driver_sine.fmu").get("guid")
    touch(checkout, "drivers/sine.py")
    assert build_all(out, root=checkout).built == ["driver_sine"]
    assert described(out / "driver_sine.fmu").get("guid") != guid
    touch(checkout, "mathematics/fuzzy.py")  # nobody of these uses it
    assert build_all(out, root=checkout).built == []
    touch(checkout, "fmi/component.py")
    assert build_all(out, root=checkout).built == SOME
    assert build_all(out, root=checkout, components=["tyre_linear"], force=True).built == ["tyre_linear"]


def test_a_module_that_is_imported_anew_counts_from_then_on(checkout, tmp_path):
    out = tmp_path / "out"
    build_all(out, root=checkout)
    late = "def late():\n    from ..mathematics import fuzzy\n\n    return fuzzy\n"
    touch(checkout, "drivers/sine.py", f"\n\n{late}")
    build_all(out, root=checkout)
    touch(checkout, "mathematics/fuzzy.py")
    assert build_all(out, root=checkout).built == ["driver_sine"]


def test_fmus_of_components_that_are_gone_are_removed_and_no_others(checkout, tmp_path):
    out = tmp_path / "out"
    build_all(out, root=checkout)
    own = build_component(checkout / "drivers" / "sine.py", out, name="driver_own")
    foreign = out / "foreign.fmu"
    with zipfile.ZipFile(foreign, "w") as fmu:
        fmu.writestr("modelDescription.xml", "<foreign/>")
    (out / "broken.fmu").write_bytes(b"no archive")
    (checkout / "drivers" / "sine.py").unlink()
    assert build_all(out, root=checkout, components=["tyre_linear"]).removed == []
    assert build_all(out, root=checkout).removed == ["driver_sine"]
    assert {file.name for file in out.iterdir()} == {
        "broken.fmu", "controller_off.fmu", own.name, foreign.name, "tyre_linear.fmu"
    }  # fmt: skip


def test_a_component_that_no_longer_builds_keeps_its_fmu_and_the_others_are_built(checkout, tmp_path):
    out = tmp_path / "out"
    build_all(out, root=checkout)
    good = (out / "driver_sine.fmu").read_bytes()
    touch(checkout, "drivers/sine.py", "\n1 +\n")
    touch(checkout, "tyres/linear.py")
    seen = []
    with pytest.raises(BuildError) as caught:
        build_all(out, root=checkout, progress=lambda name, what: seen.append((name, what)))
    lines = len((checkout / "drivers" / "sine.py").read_text("utf-8").splitlines())
    assert [*texts_of(caught.value)] == [f"driver_sine: drivers/sine.py:{lines}: SyntaxError: invalid syntax"]
    assert seen == [("controller_off", "current"), ("driver_sine", "failed"), ("tyre_linear", "built")]
    assert (out / "driver_sine.fmu").read_bytes() == good
    (checkout / "controllers" / "off.py").unlink()
    with pytest.raises(BuildError):
        build_all(out, root=checkout)
    assert (out / "controller_off.fmu").exists()


def test_an_unknown_component_is_an_error_that_lists_the_known_ones(checkout, tmp_path):
    with refused(BuildError, "component-unknown", names=("'driver_sin'", *SOME)):
        build_all(tmp_path, components=["driver_sin"], root=checkout)


def test_a_folder_that_cannot_be_written_is_an_error(checkout, tmp_path):
    (tmp_path / "out").write_text("a file in the way")
    with refused(BuildError, "component-unreadable") as caught:
        build_all(tmp_path / "out", root=checkout)
    assert each_mentions(caught.value, *((name, "[Errno 17]", tmp_path / "out") for name in SOME))


def test_building_leaves_no_module_and_no_path_behind(checkout, tmp_path):
    modules, path = set(sys.modules), list(sys.path)
    build_all(tmp_path / "out", root=checkout)
    ours = {name for name in set(sys.modules) - modules if name.startswith(("yawbench_", "driver_sine"))}
    assert ours == set()
    assert sys.path == path


def test_without_a_compiler_the_stock_library_is_used_and_the_reason_given(checkout, tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    report = build_all(tmp_path / "out", root=checkout, components=["controller_off"])
    assert mentions(report.warning, "no-such-compiler", "CC")
    with zipfile.ZipFile(tmp_path / "out" / "controller_off.fmu") as fmu:
        assert "binaries/linux64/libpythonfmu-export.so" not in fmu.namelist()
        assert b"fmi2Instantiate" in fmu.read("binaries/linux64/controller_off.so")
    monkeypatch.setenv("CC", "false")
    assert mentions(compile_launcher()[1], "status 1", "compiler", "exit")


@pytest.mark.sampled(5)
@pytest.mark.parametrize("name", NAMES)
def test_an_fmu_repeats_its_reference_result(archive, tmp_path, name):
    with zipfile.ZipFile(archive(name)) as fmu:
        fmu.extractall(tmp_path)
    folder = tmp_path / FOLDER
    settings = read_ref_opt_file(folder / f"{name}_ref.opt")
    reference = read_csv(folder / f"{name}_ref.csv")
    inputs = read_csv(folder / f"{name}_in.csv")
    result = simulate_fmu(
        str(archive(name)),
        stop_time=settings["StopTime"],
        output_interval=settings["StepSize"],
        input=inputs if inputs.dtype.names[1:] else None,
        output=reference.dtype.names[1:],
    )
    assert len(reference) == 101
    for column in reference.dtype.names:
        error = abs(result[column] - reference[column]).max()
        assert error <= settings["RelTol"] * abs(reference[column]).max(), column
    moving = [c for c in reference.dtype.names[1:] if np.ptp(reference[c]) > 0.0]
    assert moving or name in ("controller_off", "road_patchwork")  # no moment; a road without patches


def test_a_manifest_names_the_files_that_come_with_an_fmu(archive):
    with zipfile.ZipFile(archive("tyre_dugoff")) as fmu:
        manifest = ElementTree.fromstring(fmu.read(f"{FOLDER}/fmi-ls-manifest.xml"))
        roles = {posixpath.normpath(f"{FOLDER}/{one.get('source')}"): one.get("role") for one in manifest}
        assert roles.keys() <= set(fmu.namelist())
    assert manifest.tag == "fmiReferences"
    assert manifest.get("{http://fmi-standard.org/fmi-ls-manifest}fmi-ls-name") == FOLDER.partition("/")[2]
    assert sorted(roles.values()) == ["configuration", "document", "result", "testcase"]


def test_an_fmu_whose_run_fails_has_no_reference_result(tmp_path):
    fmu = tmp_path / "none.fmu"
    fmu.write_bytes(b"no FMU")
    assert reference_files(fmu) == {}


def test_the_guid_follows_the_description_and_the_files():
    descriptions = [ElementTree.Element("fmiModelDescription", modelName=name) for name in "ab"]
    made = {set_guid(one, {"binary": content}) for one in descriptions for content in (b"1", b"2")}
    assert len(made) == 4
