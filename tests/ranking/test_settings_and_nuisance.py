"""Settings and nuisance of a ranking: what is kept of an order, and what brakes in ordinary driving cost."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from yawbench.ranking.nuisance import OrdinaryRun, nuisance_of, nuisance_table
from yawbench.ranking.ranking import load_ranking
from yawbench.ranking.ranking_scores import RankingCell, placed
from yawbench.ranking.settings import SettingScores, order_kept, settings_sentence, settings_table

from .test_ranking import SMALL, driven, standing

MORE = """
settings:
  slow: {title: slow, set: {wheel_control.pressure_rise_limit: 5.0e6}}
setting_conditions: [dry]
ordinary:
  sine: {title: sine, scenario: ordinary_sine.yaml, lateral: 2.0}
  stop: {title: stop, scenario: split_braking.yaml, driver_brakes: true}
"""


@pytest.fixture
def ranking(tmp_path: Path):
    file = tmp_path / "small.yaml"
    file.write_text(SMALL + MORE)
    return load_ranking(file)


def test_a_setting_judges_its_conditions_again_with_its_own_overrides_last(ranking):
    under = ranking.under("slow")
    assert (list(under.conditions), under.quick, under.whole) == (["dry"], True, False)
    last = under.changes_of_condition("dry")[-1]
    assert (str(last.target), last.value) == ("wheel_control.pressure_rise_limit", 5.0e6)
    assert last not in ranking.changes_of_condition("dry")


def under(ranking, title: str, **passes: int) -> SettingScores:
    """Return scores of entries that pass so many of four conditions."""
    scores = [standing(n, *([driven(stability=float(k < x))] for k in range(4))) for n, x in passes.items()]
    return SettingScores(title, title, ranking, placed(scores))


def test_an_order_is_kept_that_no_setting_turns_round(ranking):
    settings = [under(ranking, "as it is", a=4, b=3, c=2, d=2), under(ranking, "slow", a=3, b=3, c=4, d=4)]
    order = order_kept(settings)
    assert order.kept == [("a", "b")]
    assert (order.changed, order.equal, order.pairs) == (4, 1, 6)
    assert "1 of 6 pairs" in settings_sentence(settings)


def test_the_table_of_settings_counts_the_controllers_that_pass(ranking):
    own = []
    for title, passes in (("own", True), ("slow", False)):
        cell = RankingCell("0", "dry", [driven(stability=float(passes))])
        score = replace(standing("0"), cells={"dry": cell})
        own.append(SettingScores(title, title, ranking.under(""), placed([score])))
    assert [row[1] for row in settings_table(own).rows] == ["1 of 1", "0 of 1"]


def run(entry: str, situation: str, braking: float, speed: float) -> OrdinaryRun:
    measured = {"braking": braking, "pressure": 1e6, "speed_end": speed}
    return OrdinaryRun(entry, situation, "s", None, None, measured)


def test_nuisance_is_braking_and_speed_against_no_control_where_the_driver_does_not_brake(ranking):
    runs = [
        run("none", "sine", 0.0, 22.0), run("fuzzy_pid", "sine", 0.5, 20.0),
        run("none", "stop", 1.0, 3.0), run("fuzzy_pid", "stop", 1.0, 5.0),
    ]  # fmt: skip
    score = nuisance_of(ranking, runs).scores["fuzzy_pid"]
    assert (score.braking(), score.speed_lost, score.speed_kept) == (0.5, 2.0, 2.0)
    assert [row[0] for row in nuisance_table(nuisance_of(ranking, runs)).rows] == ["no control", "fuzzy PID"]
    assert not nuisance_of(ranking, runs[:1]).scores["fuzzy_pid"].runs
