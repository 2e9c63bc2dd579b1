"""Fixtures of the orchestrator's tests."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of unpacked FMUs, in place of the user's."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("YAWBENCH_CACHE", str(folder))
    return folder
