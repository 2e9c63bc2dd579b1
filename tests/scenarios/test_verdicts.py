"""What the docs tell of the papers, against runs made now."""

from __future__ import annotations

import os
import shutil

import pytest

from docs.generate import papers
from docs.generate.__main__ import PUBLISHED
from docs.generate.papers import KINDS, OTHERS, STUDIES, Numbers, numbers_of, record, recorded, study_of
from tests.checkout import ROOT
from tests.evidence import RECORD
from tests.judged_studies import check_figures, judge_all
from tests.scenarios.recorded_numbers import assert_recorded
from yawbench.orchestrator.results.folder_names import default_folder
from yawbench.studies.claim_schema import MetricReference
from yawbench.studies.journal import FILE as JOURNAL
from yawbench.studies.load_experiment import found_studies, load_experiment


@pytest.fixture(scope="module")
def known() -> dict[str, Numbers]:
    return recorded()


@pytest.mark.exhaustive
@pytest.mark.parametrize("name", [*STUDIES, *OTHERS])
def test_every_recorded_number_and_verdict_is_what_all_runs_come_to(name, tmp_path):
    file = study_of(name).path
    made = ROOT / default_folder(file) / JOURNAL
    if (
        made.is_file() and name in STUDIES
    ):  # by `make report`: each run is known by the hash of all that it follows from
        shutil.copyfile(made, tmp_path / JOURNAL)
    study = judge_all(file, tmp_path)
    if os.environ.get(RECORD):
        record(name, numbers_of(tmp_path, name))
    found = assert_recorded(name, study)
    assert recorded()[name].claims == found.claims, f"{RECORD}=1 writes {papers.FILE.name} anew"
    assert recorded()[name].verdicts == found.verdicts
    assert found.runs.keys() == recorded()[name].runs.keys()
    check_figures(study, *(figure.name for figure in study_of(name).spec.figures))


@pytest.mark.parametrize(
    "pages",
    [papers.pages_with_numbers, *(one.pages_with_tables for one in PUBLISHED)],
    ids=lambda f: f.__module__,
)
def test_the_pages_follow_from_what_is_recorded_and_published(pages):
    for page, text in pages().items():
        assert text == page.read_text(encoding="utf-8"), f"python -m docs.generate writes {page.name} anew"


def test_the_record_has_every_claim_of_every_study_with_a_region(known, monkeypatch):
    monkeypatch.chdir(ROOT)
    found = map(load_experiment, found_studies())
    assert {study.path.absolute() for study in found if study.spec.region} == {
        study_of(name).path for name in STUDIES
    }
    for name in STUDIES:
        assert [claim.says for claim in known[name].claims] == [
            one.says for one in study_of(name).spec.claims
        ]
        assert {claim.verdict for claim in known[name].claims} <= set(KINDS)


def test_the_record_has_every_run_and_derived_number_of_the_studies(known):
    for name in STUDIES | OTHERS:
        assert known[name].runs.keys() == set(study_of(name).runs)
        assert known[name].derived.keys() == set(study_of(name).spec.derived)


def test_what_the_words_of_the_pages_rest_on_is_so(known):
    lower = [claim for claim in known["C"].claims if claim.says.endswith("has lower peaks than PID.")]
    assert {claim.verdict for claim in lower} == {"depends on open values"}
    assert {claim.flips_by for claim in lower} == {"share of the friction"}
    assert "rear" in known["B"].claim("severe lateral instability").flips_by
    for words in ("is within 5 % at 15 m/s", "is within 5 % at 25 m/s", "is within 5 % at 40 m/s"):
        assert known["A"].claim(words).verdict == "depends on open values"
    for words in ("path that the driver wants", "yaw rate practically coincides", "nonlinearity decides"):
        assert known["D"].claim(words).verdict == "depends on open values"
    means = known["table_3"].over("one_side_braked/*", "mean")
    assert min(means) == known["table_3"]["one_side_braked/by_load"]["mean"]
    for speed in (15, 25, 40):
        fuzzy, network = (known["A"][f"{speed}mps/{law}"]["chatter"] for law in ("fuzzy_sideslip", "fnn"))
        assert 0.8 * network < fuzzy < network


def test_what_the_words_of_the_theory_pages_rest_on_is_so(known):
    known_car = known["integral_sliding_mode"]
    for car in ("known", "heavier", "worn", "slippery", "slow"):
        assert known_car[f"{car}/integral"]["rms"] < known_car[f"{car}/pi"]["rms"]
    for mode in ("sport", "safe"):
        step = known["feedforward_pi"]
        assert step[f"step/{mode}/feedforward_pi"]["rms"] < step[f"step/{mode}/pi_alone"]["rms"]
    both = known["steering_and_braking"]
    assert both["90/steering_and_braking"]["yaw_rate_error"] < both["90/phase_plane"]["yaw_rate_error"]
    assert both["270/steering_and_braking"]["sideslip"] < both["270/phase_plane"]["sideslip"]
    for name in ("super_twisting", "envelope_mpc"):
        assert {*known[name].judged(WORDS[name])} == {"does not reproduce"}
    envelope, wheels = known["envelope_mpc"], known["weighted_least_squares"]
    assert envelope["straight/envelope_mpc"]["added"] == envelope["straight/envelope_mpc"]["asked"] == 0.0
    assert known["weighted_least_squares"].judged("No wheel is asked for more than its grip") == ["holds"]
    assert wheels["270/single_wheel"]["lost"] < wheels["270/weighted_least_squares"]["lost"]


WORDS = {"super_twisting": "does not chatter", "envelope_mpc": "Steering by the program"}


def test_with_motors_that_lag_the_network_has_the_best_gains_of_all_and_the_widest_luck():
    laws = papers.found_by_seeds()["tuning_with_actuators"]
    network = laws.pop("fuzzy neural network")
    assert len(network) == 5
    assert min(network) < min(map(min, laws.values()))
    assert max(network) > max(map(max, laws.values()))


LESS, MORE = 0.99, 1.01
"""Factors on another run's number: a difference of less than 1 % counts as none (docs/regions.md)."""


@pytest.mark.parametrize("name", STUDIES)
def test_where_a_claim_compares_runs_less_than_one_per_cent_counts_as_none(name):
    for claim in study_of(name).spec.claims:
        for condition in claim.holds_if:
            if isinstance(condition.bound, MetricReference):
                factor = condition.bound.times
                small = factor > LESS if condition.relation in ("below", "at_most") else factor < MORE
                assert not small, (claim.says, str(condition))
