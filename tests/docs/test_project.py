"""Facts of the project: one version, one date, lists of files that exist."""

from __future__ import annotations

import re
import sys

import pytest
from ruamel.yaml import YAML

from docs.generate.rooms import pages
from tests.checkout import ROOT

if sys.version_info >= (3, 11):
    import tomllib
else:
    tomllib = pytest.importorskip("tomllib")

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
CITATION = YAML(typ="safe").load(ROOT / "CITATION.cff")
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
ARCHITECTURE = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")


def test_project_changelog_and_citation_name_one_version_and_its_date():
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    released = re.findall(r"^## (\d+\.\d+\.\d+) \((\d{4}-\d\d-\d\d)\)$", changelog, re.MULTILINE)
    assert released[0] == (CITATION["version"], str(CITATION["date-released"]))
    assert PROJECT["project"]["version"] == CITATION["version"]


def test_the_architecture_links_the_page_of_every_room():
    assert {page for page in pages() if f"({page})" not in ARCHITECTURE} == set()


def test_make_has_every_target_that_the_contributing_guide_and_the_readme_name():
    text = CONTRIBUTING + (ROOT / "README.md").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    assert set(re.findall(r"^    make ([\w-]+)", text, re.MULTILINE)) <= targets


def test_tests_that_the_security_policy_names_exist():
    text = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
    named = re.findall(r"`(tests/[\w/]+\.py)::(test_\w+)`", text)
    assert len(named) > 8
    for file, test in named:
        assert f"def {test}(" in (ROOT / file).read_text(encoding="utf-8"), f"{file}::{test}"
