"""The two tiers of the tests, the order in which their files begin, and folders of FMUs.

`exhaustive` marks what the second tier adds. `sampled(n)`, on a test or a module, leaves n cases of
every parametrized test in the first tier, evenly spread; the others are marked `exhaustive`.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from tests.commands import status_of
from tests.fmu_copies import put_fmus
from yawbench.foundation.workers import default_workers

TESTS = Path(__file__).parent
LONGEST_FIRST = (
    *("scenarios", "trials", "pages", "docs", "orchestrator", "yawbench", "fmus"),
    *("components/test_conformance.py", "components/test_car_on_tyres.py", "components/test_w"),
    "components",
)
"""Beginnings of paths: long runs come first, so that no worker is left alone with one at the end."""

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
"""numpy and scipy, imported later, use no threads: these would wait for a small matrix in loops that cost as
much again."""

os.environ.pop("COLUMNS", None)  # pytest-xdist says 80, whatever the terminal

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
