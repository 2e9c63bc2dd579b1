"""A controller in C from outside, as the docs show it, stands in a ranking by the command that they show."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.checkout import ROOT
from tests.command_line import status_of
from tests.docs.test_commands import blocks
from tests.ranking.test_ranking import SMALL, rows

PAGE = "docs/own_controller.md"


@pytest.fixture
def typed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Write and type what the page shows, go where that leads; return the last command."""
    for block in blocks(PAGE):
        if block.path.startswith("yaw_guard/"):
            (tmp_path / block.path).parent.mkdir(exist_ok=True)
            (tmp_path / block.path).write_text(block.text, encoding="utf-8")
    shown = re.search(r"```text\n(cd yaw_guard .*?)```", (ROOT / PAGE).read_text(encoding="utf-8"), re.DOTALL)
    assert shown is not None
    *building, last = shown[1].strip().splitlines()
    subprocess.run(["sh", "-ec", "\n".join(building)], cwd=tmp_path, check=True)
    monkeypatch.chdir(tmp_path)
    return last


@pytest.mark.exhaustive
@pytest.mark.skipif(sys.platform != "linux" or shutil.which("cc") is None, reason="compiles for Linux")
def test_an_fmu_in_c_is_ranked_by_the_command_of_the_docs(typed, tmp_path):
    program, command, *options = typed.split()
    assert (program, command) == (".venv/bin/yawbench", "rank")
    file, out = tmp_path / "small.yaml", tmp_path / "out"
    file.write_text(SMALL)
    assert status_of("rank", file, *options, "--condition", "dry", "--jobs", 1, "--out", out) == 0
    found = {row["entry"]: row for row in rows(out / "cells.csv")}
    assert {name: row["state"] for name, row in found.items()} == {
        "yaw_guard": "passed", "fuzzy_pid": "passed", "none": "failed",
    }  # fmt: skip
    assert "yaw_guard" in (out / "report.html").read_text(encoding="utf-8")
