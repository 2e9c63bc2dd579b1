"""Native units in hosts that have no Python: libc and libm alone, many threads, Windows, an old glibc."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.fmus.bare import Fmu
from tests.fmus.programs import (
    expected_outputs,
    host_command,
    host_outputs,
    in_windows,
    in_wine,
    ten_steps,
    unpacked_inputs,
)
from tests.fmus.test_calling_sequence import in_c
from tests.refusals import mentions
from yawbench.fmus.archive import runs_as
from yawbench.fmus.build import HERE as FMUS
from yawbench.fmus.build import find_components, has_native_library
from yawbench.fmus.compiler import PLATFORMS, TO_WINDOWS, compiler_for

OLDEST_GLIBC = (2, 14)
"""As docs/other_tools.md says."""
CHROOT = shutil.which("chroot")
SHARES = pytest.mark.parametrize(
    "share", [slice(0, None, 8), pytest.param(slice(None), marks=pytest.mark.exhaustive)]
)
"""Every eighth unit in the first tier, all in the second."""
TO_ARM, ARM_LIBC = PLATFORMS["aarch64-linux"], Path("/usr/aarch64-linux-gnu")


@pytest.fixture(scope="module")
def native(archive, unpack) -> list[Path]:
    """Folders of all unpacked native FMUs."""
    archives = [archive(name) for name in find_components()]
    return [unpack(fmu) for fmu in archives if (how := runs_as(fmu)) and how.native]


@pytest.fixture(scope="module")
def libraries(native, archive, unpack, tmp_path_factory) -> list[Path]:
    """Every library for Linux that a host without Python opens: launchers, native units, a unit in C."""
    of_units = [folder / "binaries" / "linux64" / "native.so" for folder in native]
    unit_in_c = unpack(in_c(tmp_path_factory.mktemp("c")))
    return [*of_units, Fmu(native[0]).binary, Fmu(unit_in_c).binary]


def needed(*binaries: Path) -> dict[str, str]:
    """Return name -> path of every library that programs or libraries need."""
    said = subprocess.run(["ldd", *binaries], capture_output=True, text=True, check=True).stdout
    found = (re.search(r"(\S+)(?: => (\S+))? \(0x", line) for line in said.splitlines())
    return {Path(match[1]).name: match[2] or match[1] for match in found if match}


def test_all_units_but_three_are_native(native):
    python = set(find_components()) - {Fmu(folder).name for folder in native}
    assert python <= {"controller_envelope_mpc", "controller_mpc", "road_patchwork"}


def test_native_libraries_need_libc_and_libm_alone(libraries):
    assert needed(*libraries).keys() <= {"linux-vdso.so.1", "ld-linux-x86-64.so.2", "libc.so.6", "libm.so.6"}


@pytest.mark.skipif(shutil.which("objdump") is None, reason="there is no objdump")
def test_native_libraries_run_with_the_oldest_glibc_that_is_stated(libraries):
    said = subprocess.run(["objdump", "-T", *libraries], capture_output=True, text=True, check=True).stdout
    versions = {tuple(map(int, v.split("."))) for v in re.findall(r"GLIBC_([\d.]+)", said)}
    assert max(versions)[:2] <= OLDEST_GLIBC
    stated = f"glibc {'.'.join(map(str, OLDEST_GLIBC))}"
    assert stated in (FMUS.parent / "docs" / "other_tools.md").read_text()


@SHARES
@pytest.mark.skipif(CHROOT is None or os.geteuid() != 0, reason="only root may chroot")
def test_every_native_unit_runs_where_there_is_nothing_but_libc_and_libm(
    native, share, host, archive, unpack, tmp_path
):
    """As host.c has it: two instances step, save, serialize, restore, are reset and freed."""
    for library in {*needed(host, native[0] / "binaries/linux64/native.so").values()}:
        if library.startswith("/"):
            place = tmp_path / library[1:]
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(library, place)
    shutil.copy(host, tmp_path / "host")

    def run(folder: Path) -> subprocess.CompletedProcess[str]:
        inside = shutil.copytree(folder / "binaries", tmp_path / Fmu(folder).name / "binaries").parent
        shutil.copytree(folder / "resources", inside / "resources")
        arguments = [
            word.replace(str(folder), f"/{inside.name}") for word in host_command(Path("/host"), folder)
        ]
        return subprocess.run(
            [CHROOT, tmp_path, *arguments], env={}, capture_output=True, text=True, check=False
        )

    for folder in native[share]:
        done = run(folder)
        assert (done.returncode, done.stderr) == (0, ""), folder
        assert host_outputs(done, folder) == expected_outputs(folder)
    done = run(unpack(archive("controller_mpc")))
    assert done.returncode == 3
    assert mentions(done.stderr, "no Python found")


@SHARES
def test_fifty_instances_in_fifty_threads_give_what_each_gives_alone(native, share, tmp_path):
    program = tmp_path / "host_threads"
    source = Path(__file__).with_name("host_threads.c")
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-O1", f"-I{FMUS}"]
    subprocess.run(["cc", *flags, source, "-o", program, "-ldl", "-pthread"], check=True)
    for folder in native[share]:
        _, library, _, guid, _, reals, *inputs = host_command(program, folder)
        done = subprocess.run(
            [program, library, guid, reals, *inputs], capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stderr) == (0, ""), folder


@in_windows
def test_on_windows_native_units_agree_with_linux_to_a_trillionth(native, tmp_path, wine_prefix):
    on_windows = {name for name in find_components() if has_native_library(FMUS / f"{name}.fmu", TO_WINDOWS)}
    units = [(Fmu(folder), unpacked_inputs(folder)) for folder in native if Fmu(folder).name in on_windows]
    if not units:
        pytest.skip("no FMU is built for Windows: yawbench build --platform x86_64-windows")
    for (fmu, inputs), found in zip(units, in_wine(units, tmp_path, wine_prefix), strict=True):
        for row, expected in zip(found, ten_steps(fmu, inputs), strict=True):
            assert row == pytest.approx(expected, rel=1e-12, abs=1e-12), fmu.name


@pytest.mark.skipif(
    shutil.which("qemu-aarch64") is None or not ARM_LIBC.is_dir() or compiler_for(TO_ARM) is None,
    reason="needs qemu-user, a libc for ARM and a cross compiler",
)
def test_on_arm_native_units_give_the_bits_of_this_computer(native, tmp_path):
    command, _ = compiler_for(TO_ARM)
    host = tmp_path / "host"
    source = Path(__file__).parents[1] / "host.c"
    subprocess.run([*command, "-std=c11", "-O1", f"-I{FMUS}", source, "-o", host, "-ldl"], check=True)
    on_arm = [folder for folder in native if has_native_library(FMUS / f"{Fmu(folder).name}.fmu", TO_ARM)]
    if not on_arm:
        pytest.skip("no FMU is built for ARM: yawbench build --platform aarch64-linux")
    for folder in on_arm:
        (library,) = (folder / "binaries" / TO_ARM.name).glob("*.so")
        program, _, *arguments = host_command(host, folder)
        done = subprocess.run(
            ["qemu-aarch64", "-L", ARM_LIBC, program, library, *arguments],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert (done.returncode, done.stderr) == (0, ""), folder
        assert host_outputs(done, folder) == expected_outputs(folder), folder
