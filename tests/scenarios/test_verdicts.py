"""Statements of the docs and the README on how far the verdicts on the papers carry."""

from __future__ import annotations

import os
import shutil

import pytest

from tests.checkout import ROOT
from tests.evidence import RECORD
from tests.judged_studies import judge_all
from tests.refusals import sentence_has
from tests.verdicts import FILE, KINDS, page, recorded, rows_of, studies, summary, table_in
from yawbench.orchestrator.results.folder_names import default_folder
from yawbench.studies.claim_schema import MetricReference
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


def test_the_page_on_papers_tells_of_verdicts_what_the_page_does():
    section = (
        (ROOT / "docs" / "papers.md").read_text(encoding="utf-8").partition("## How far the verdicts")[2]
    )
    told = table_in(section.partition("\n##")[0])
    found = {title.partition(":")[0]: rows for title, rows in recorded().items()}
    assert [tuple(row) for row in told[1 : 1 + len(found)]] == summary(found)
    decided = [
        [paper.removeprefix("Paper "), *row]
        for paper, rows in found.items()
        for row in rows
        if row.verdict in KINDS[:2]
    ]
    assert told[2 + len(found) :] == decided
    counts = [sum(int(row[k]) for row in summary(found)) for k in range(2, 2 + len(KINDS))]
    words = "{} hold, {} do not reproduce, {} depend on these values, {} are undecided".format(*counts)
    assert words in " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    total = sum(map(len, found.values()))
    assert sentence_has(section, "Most", "claims", "values")
    assert total - len(decided) > total / 2


def test_the_page_on_papers_tells_how_far_the_best_of_26_carries():
    title = next(title for title in recorded() if "table 3" in title)
    (best,) = (
        row for row in recorded()[title] if row.says.endswith("the one in proportion to load is the best.")
    )
    section = (ROOT / "docs" / "papers.md").read_text(encoding="utf-8").partition("## Paper B")[2]
    told = " ".join(section.partition("\n## ")[0].split())
    assert sentence_has(told, best.margin, "best")
    assert sentence_has(told, best.verdict, best.region, best.flip)


LESS, MORE = 0.99, 1.01
"""Factors on another run's number: a difference of less than 1 % counts as none (docs/regions.md)."""


@pytest.mark.parametrize("name", FILES)
def test_where_a_claim_compares_runs_less_than_one_per_cent_counts_as_none(name):
    for claim in load_experiment(ROOT / "scenarios" / f"{name}.yaml").spec.claims:
        for condition in claim.holds_if:
            if isinstance(condition.bound, MetricReference):
                factor = condition.bound.times
                small = factor > LESS if condition.relation in ("below", "at_most") else factor < MORE
                assert not small, (claim.says, str(condition))
