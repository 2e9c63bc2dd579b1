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


@pytest.mark.exhaustive
@pytest.mark.skipif(sys.platform != "linux" or shutil.which("cc") is None, reason="compiles for Linux")
def test_an_fmu_in_c_is_ranked_by_the_commands_of_the_docs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for block in blocks(PAGE):
        if block.path.startswith("yaw_guard/"):
            Path(block.path).parent.mkdir(exist_ok=True)
            Path(block.path).write_text(block.text, encoding="utf-8")
    shown = re.search(r"```text\n(cd yaw_guard .*?)```", (ROOT / PAGE).read_text(encoding="utf-8"), re.DOTALL)
    assert shown is not None
    *building, last = shown[1].strip().splitlines()
    subprocess.run(["sh", "-ec", "\n".join(building)], check=True)
    program, command, *options = last.split()
    assert (program, command) == (".venv/bin/yawbench", "rank")
    Path("small.yaml").write_text(SMALL)
    assert status_of("rank", "small.yaml", *options, "--condition", "dry", "--jobs", 1, "--out", "out") == 0
    found = {row["entry"]: row["state"] for row in rows(Path("out/cells.csv"))}
    assert found == {"yaw_guard": "passed", "fuzzy_pid": "passed", "none": "failed"}
    assert "yaw_guard" in Path("out/report.html").read_text(encoding="utf-8")
