"""The hash of the program's own code."""

from __future__ import annotations

import shutil

import pytest

from tests.test_layers import FILES, imports_of
from yawbench.foundation import cache as module
from yawbench.foundation.cache import OF_METRICS, OF_RESULTS, sources_hash


@pytest.fixture
def copy(tmp_path, monkeypatch):
    """A copy of the code in place of the program's own."""
    here = module._HERE
    shutil.copytree(
        here, tmp_path / "copy", ignore=shutil.ignore_patterns("__pycache__", "*.fmu", "scenarios")
    )
    monkeypatch.setattr(module, "_HERE", tmp_path / "copy")
    sources_hash.cache_clear()
    yield tmp_path / "copy"
    sources_hash.cache_clear()


def hashes():
    sources_hash.cache_clear()
    return sources_hash(OF_RESULTS), sources_hash(OF_METRICS)


def test_code_that_has_a_say_in_the_numbers_changes_the_hash_and_no_other(copy):
    results, metrics = hashes()
    (copy / "reports" / "report.py").write_text("")
    assert hashes() == (results, metrics)
    with (copy / "metrics" / "measures.py").open("a") as file:
        file.write("# changed")
    assert hashes()[0] == results
    assert hashes()[1] != metrics
    (copy / "orchestrator" / "master" / "fmi.py").rename(copy / "orchestrator" / "master" / "fmi_2.py")
    assert hashes()[0] != results


def test_all_that_these_parts_import_has_a_say_or_cannot_change_a_number():
    """FMUs are hashed by themselves, so what makes them has no say; figures are drawn of results."""
    own = tuple(f"yawbench.{part.removesuffix('.py').replace('/', '.')}" for part in OF_RESULTS)
    harmless = ("foundation", "vocabulary", "fmus", "figures", "components")
    known = (*own, *(f"yawbench.{room}" for room in harmless))
    for name in FILES:
        if name.startswith(own):
            assert not {other for _, other in imports_of(name) if not other.startswith(known)}, name
