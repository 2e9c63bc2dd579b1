"""The pages of all studies as `yawbench report` writes them: first screens and budgets at full size."""

from __future__ import annotations

from pathlib import Path

import pytest

from yawbench.cli import main
from yawbench.orchestrator.scenario.loader import files

from .flaws import SCREENS, check_budgets, check_first_screen

pytestmark = pytest.mark.exhaustive

STUDIES = [path for path, _ in files(Path(__file__).parents[2] / "scenarios", ["a study file"], depth=2)]


@pytest.mark.parametrize("study", STUDIES, ids=lambda file: f"{file.parent.name}-{file.stem}")
def test_a_page_keeps_its_budgets_and_its_first_screen(chromium, tmp_path, fmus, study):
    with pytest.raises(SystemExit):
        main(["study", str(study), "--out", str(tmp_path), "--fmus", str(fmus)])
    page = tmp_path / "report.html"
    for width, height in SCREENS:
        check_first_screen(chromium, page, width, height)
        check_budgets(chromium, page)
    assert page.stat().st_size <= 2_500_000
