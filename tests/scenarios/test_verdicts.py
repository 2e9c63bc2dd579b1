"""Statements of the docs and the README on how far the verdicts on the papers carry."""

from __future__ import annotations

import os
import shutil

import pytest

from tests.checkout import ROOT
from tests.evidence import RECORD
from tests.studies import judge_all
from tests.verdicts import FILE, page, recorded, rows_of, studies
from yawbench.orchestrator.results.run_folder import default_folder
from yawbench.studies.journal import FILE as JOURNAL
from yawbench.studies.load_experiment import load_experiment

FILES = (
    "fnn_sideslip/study", "fuzzy_sliding_mode/study", "fuzzy_sliding_mode/distribution", "fuzzy_pid/study",
    "fuzzy_feedback/study",
)  # fmt: skip


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", FILES)
def test_the_page_tells_what_becomes_of_every_claim_over_the_region(name, tmp_path):
    file = ROOT / "scenarios" / f"{name}.yaml"
    made = ROOT / default_folder(file) / JOURNAL
    if made.is_file():  # by `make report`: each run is known by the hash of all that it follows from
        shutil.copyfile(made, tmp_path / JOURNAL)
    judge_all(file, tmp_path)
    title = load_experiment(file).spec.title
    found = rows_of(tmp_path / "verdicts.csv")
    if os.environ.get(RECORD):
        order = list(studies())
        every = recorded() | {title: found}
        FILE.write_text(page({one: every[one] for one in order if one in every}), encoding="utf-8")
    assert recorded()[title] == found, f"{RECORD}=1 writes {FILE.name} anew"


def test_the_page_has_every_claim_of_every_study_and_sums_them_up():
    found = recorded()
    assert {title: study.path.relative_to(ROOT / "scenarios").with_suffix("").as_posix()
            for title, study in studies().items()} == dict(zip(found, FILES, strict=True))  # fmt: skip
    for title, study in studies().items():
        assert [row.says for row in found[title]] == [one.says for one in study.spec.claims]
    assert FILE.read_text(encoding="utf-8") == page(found)
