"""The built docs: complete, self-contained; that links lead somewhere, mkdocs and test_links.py tell."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest
from lxml import html

from docs.generate.formulas import to_mathml
from tests.checkout import ROOT
from yawbench.fmus.build import HERE, build_all


@pytest.mark.exhaustive  # test_links.py looks at the pages as they are written
def test_the_site_is_built_without_a_warning_loads_nothing_from_elsewhere_and_draws_formulas(tmp_path):
    build_all(HERE)
    site = tmp_path / "site"
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", site]
    environment = os.environ | {"NO_MKDOCS_2_WARNING": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")  # warned of: links to nowhere, pages outside the menu
    assert not list(site.rglob("*.py"))
    for file in site.rglob("*.html"):
        text = file.read_text("utf-8")
        page = html.fromstring(text)
        loads = page.xpath("//@src | //link[@rel='stylesheet' or @rel='icon' or @rel='preload']/@href")
        assert [load for load in loads if "//" in load] == []
        assert "\\frac" not in text
    styles = "".join(file.read_text("utf-8") for file in site.rglob("*.css"))
    assert re.findall(r"url\([\"']?https?:|@import", styles) == []
    for letter in "abcd":
        text = (site / f"theory/paper_{letter}.html").read_text("utf-8")
        assert text.count("<math") > 5 and "arithmatex" not in text


def test_a_formula_that_cannot_be_shown_fails_the_build():
    with pytest.raises(ValueError, match="this formula cannot be shown"):
        to_mathml(r'<span class="arithmatex">\(\left( a\)</span>')


def test_the_docs_name_nothing_that_is_not_in_the_repository():
    folders = "components|foundation|fmus|vocabulary|orchestrator|scenarios|tests|docs|yawbench"
    made_by_reader = ("yaw_follow", "slip_guard", "how_fast", "how_gentle", "yaw_rate.py")
    named = 0
    for file in [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]:
        for path in re.findall(rf"`((?:{folders})/[\w/.]+?\.\w+)`", file.read_text("utf-8")):
            if not any(word in path for word in ("NAME", *made_by_reader)) and not path.endswith(".fmu"):
                assert (ROOT / path).exists(), f"{file.name}: {path}"
                named += 1
    assert named > 50
