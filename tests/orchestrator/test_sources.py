"""The hash of the program's own code."""

from __future__ import annotations

import shutil

import pytest

from yawbench.foundation import cache as module
from yawbench.foundation.cache import OF_METRICS, OF_RESULTS, sources_hash

from .test_imports import ORCHESTRATOR, SOURCES, imported_by, stage_of


@pytest.fixture
def copy(tmp_path, monkeypatch):
    """A copy of the code in place of the program's own."""
    here = module._HERE
    shutil.copytree(here, tmp_path / "copy", ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(module, "_HERE", tmp_path / "copy")
    sources_hash.cache_clear()
    yield tmp_path / "copy"
    sources_hash.cache_clear()


def hashes():
    sources_hash.cache_clear()
    return sources_hash(OF_RESULTS), sources_hash(OF_METRICS)


def test_code_that_has_a_say_in_the_numbers_changes_the_hash_and_no_other(copy):
    results, metrics = hashes()
    (copy / "pages" / "report.py").write_text("")
    assert hashes() == (results, metrics)
    with (copy / "metrics" / "measures.py").open("a") as file:
        file.write("# changed")
    assert hashes()[0] == results
    assert hashes()[1] != metrics
    (copy / "master" / "fmi.py").rename(copy / "master" / "fmi_2.py")
    assert hashes()[0] != results


def test_all_that_these_parts_import_has_a_say_or_cannot_change_a_number():
    harmless = {"cache", "errors", "safe_files", "messages", "measured"}
    harmless |= {"interrupts", "fork_server", "supervised_process", "workers"}
    own = {part.removesuffix(".py") for part in OF_RESULTS}
    for path in SOURCES:
        if path.relative_to(ORCHESTRATOR).parts[0].removesuffix(".py") in own:
            used = {stage_of(dotted) for _, dotted in imported_by(path)} - {None, "metrics", "figures"}
            assert used <= own | harmless, path
