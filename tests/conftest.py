"""The two tiers of the tests, the order in which their files begin, and folders of FMUs.

`exhaustive` marks what the second tier adds. `sampled(n)`, on a test or a module, leaves n cases of
every parametrized test in the first tier, evenly spread; the others are marked `exhaustive`.
"""

from __future__ import annotations

import gc
import os
import shlex
import signal
import subprocess
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.command_line import status_of
from tests.fmu_copies import put_fmus
from tests.fmus import models3
from tests.reports import browser as browsers
from yawbench.fmus import recipe
from yawbench.fmus.build import build_component
from yawbench.foundation.workers import default_workers

TESTS = Path(__file__).parent
FMUS = TESTS / "fmus"
"""Folder of FMUs and components in C that are made for tests."""
STEP = "if (fabs(law(s, v)) < v->moment_limit)"
"""Line at which a new controller in C is given something to do that it should not."""
LONGEST_FIRST = (
    *("scenarios", "trials", "studies", "ranking", "reports", "bench", "docs", "orchestrator", "commands"),
    *("interop", "measured_cars", "yawbench", "fmus"),
    *("components/test_conformance.py", "components/test_car_on_tyres.py", "components/test_w"),
    "components",
)
"""Beginnings of paths: long runs come first, so that no worker is left alone with one at the end."""

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
"""numpy and scipy, imported later, use no threads: these would wait for a small matrix in loops that cost as
much again."""

os.environ.pop("COLUMNS", None)  # pytest-xdist says 80, whatever the terminal

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as a shell has it for what runs in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)

gc.set_threshold(50_000, 20, 20)
"""Python looks for garbage less often: thousands of tests keep much, and leave little."""
gc.disable()  # until all tests are collected


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Return the number of workers for `-n auto`: one more than cores, as tests wait for processes."""
    return default_workers() + 1


def pytest_collection_finish() -> None:
    """Look for garbage from now on, but never among modules and tests, which all last."""
    gc.freeze()
    gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: place_in_order(item.path))
    sampled: dict[tuple[str, str], list[pytest.Item]] = {}
    for item in items:
        if item.get_closest_marker("sampled"):
            sampled.setdefault((str(item.path), getattr(item, "originalname", item.name)), []).append(item)
    for cases in sampled.values():
        (number,) = cases[0].get_closest_marker("sampled").args  # type: ignore[union-attr]
        kept = evenly(number, len(cases))
        for k, item in enumerate(cases):
            if k not in kept:
                item.add_marker(pytest.mark.exhaustive)


@cache
def place_in_order(file: Path) -> int:
    """Return how early the tests of a file begin."""
    path = file.relative_to(TESTS).as_posix()
    before = (k for k, start in enumerate(LONGEST_FIRST) if path.startswith(start))
    return next(before, len(LONGEST_FIRST))


@pytest.fixture(scope="module")
def fmus(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the FMUs that a file of tests names as its UNITS, or with all."""
    folder = tmp_path_factory.mktemp("fmus")
    put_fmus(folder, components=getattr(request.module, "UNITS", None))
    return folder


@pytest.fixture
def yawbench(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run the command line; return its exit status, its output and what it said on stderr."""

    def run(*arguments: object) -> tuple[int, str, str]:
        return status_of(*arguments), *capsys.readouterr()

    return run


def evenly(number: int, total: int) -> set[int]:
    """Return `number` indices, the first and the last among them, of `total`."""
    return {k * (total - 1) // max(number - 1, 1) for k in range(number)}


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of unpacked FMUs, in place of the user's."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("YAWBENCH_CACHE", str(folder))
    return folder


@pytest.fixture(scope="session")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache for many tests: equal FMUs are unpacked and described once."""
    return tmp_path_factory.mktemp("unpacked")


@pytest.fixture
def common_cache(unpacked: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The cache for many tests, in place of the user's."""
    monkeypatch.setenv("YAWBENCH_CACHE", str(unpacked))


def build_controller_in_c(folder: Path, act: str, name: str = "idea") -> Path:
    """Build the controller in C that `yawbench new` begins with; first of all it does `act` in every step.

    Without its library for Windows, which takes as long as that for Linux.
    """
    from yawbench.commands.new import begin

    for path, text in begin("controller", name, "c", in_checkout=True).files.items():
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        if file.suffix == ".c":
            assert STEP in text
            headers = "".join(
                f"#include <{header}.h>\n" for header in ("signal", "stdio", "stdlib", "unistd")
            )
            text = headers + text.replace(STEP, f"{act}\n    {STEP}")
        file.write_text(text)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recipe, "MINGW", "no-compiler-for-windows")
        return build_component(folder / "components" / "controllers" / name, folder / "built")


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A compiled FMU library from elsewhere: it doubles its inputs, and answers a step as it is told."""
    return compiled(FMUS / "foreign.c", tmp_path_factory.mktemp("foreign") / "foreign.so")


@pytest.fixture(scope="session")
def bare_library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same without the functions that many FMUs leave out, those for texts among them."""
    return compiled(FMUS / "foreign.c", tmp_path_factory.mktemp("bare") / "foreign.so", "-DBARE")


@pytest.fixture(scope="session")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The compiled library of all models of FMI 3."""
    folder = tmp_path_factory.mktemp("models3")
    (folder / "stubs.h").write_text(models3.stubs(), encoding="utf-8")
    return compiled(models3.HERE / "models3.c", folder / "models3.so", f"-I{folder}")


def compiled(source: Path, target: Path, *options: str) -> Path:
    """Return the library that is made of a file of C."""
    compiler = shlex.split(os.environ.get("CC", "cc"))
    include = TESTS.parent / "fmus"
    flags = ["-shared", "-fPIC", "-w", f"-I{include}", *options]
    subprocess.run([*compiler, *flags, source, "-o", target, "-lm"], check=True)
    return target


@pytest.fixture(scope="session")
def window() -> Iterator[browsers.Browser]:
    """A browser, one for all tests of a worker."""
    browser = browsers.start()
    try:
        yield browser
    finally:
        browser.driver.quit()


@pytest.fixture(scope="module")
def chromium(window: browsers.Browser) -> Iterator[browsers.Browser]:
    """The browser, left without a page and without messages on its console at the end of a file."""
    yield window
    window.driver.get("about:blank")
    window.console()
