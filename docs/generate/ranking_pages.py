"""Pages on the ranking, from published results: `python -m docs.generate.ranking_pages`.

Templates in `pages/ranking/` with numbers from scenarios/proving_ground/: matrix.csv, nuisance.csv and
settings.csv, which `--runs TABLE` takes from cells.csv and from beside it; threat_levels.csv and
discipline_quantities.csv, copies of what a ranking by threats writes; the gains of the common search.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache, cached_property, partial
from pathlib import Path
from statistics import fmean, geometric_mean, median, variance
from typing import Any, NamedTuple

import numpy as np

from yawbench.foundation.messages import in_text, listed
from yawbench.ranking import ranking_page
from yawbench.ranking.disciplines import disciplines
from yawbench.ranking.gains_and_laws import ComparedGains, compared_gains
from yawbench.ranking.nuisance import nuisance_sentence
from yawbench.ranking.ranking import load_ranking
from yawbench.ranking.ranking_scores import IDLE, EntryScore, RankedState, apart_by_conditions
from yawbench.ranking.settings import settings_sentence
from yawbench.ranking.threat_runs import Survived, ThreatResult, published_result
from yawbench.ranking.threat_scores import (
    Moves,
    ScoreTable,
    compared_setting,
    moves_between,
    scored,
    scores_without,
)
from yawbench.ranking.threat_tables import titles_of
from yawbench.ranking.threats import REFERENCE, SearchPlace, load_threats
from yawbench.ranking.whole_ranking import WholeRanking
from yawbench.studies.confidence import CONFIDENCE
from yawbench.studies.pair_comparisons import ToldApart, sign_test
from yawbench.studies.tables import Table

from . import matrix_tables, threat_tables
from .published import markdown, replaced, write_pages
from .templates import DOCS, rendered

PROVING_GROUND = DOCS / "proving_ground.md"


class Matrix:
    """What templates name of the matrix, nuisance and settings."""

    def __init__(self, result: WholeRanking) -> None:
        self.result = result
        self.laws: list[EntryScore] = [score for score in result.scores if score.spec.fmu != IDLE]
        self.conditions = len(result.ranking.conditions)
        self.pairs = math.comb(len(self.laws), 2)
        self.settings = settings_sentence(result.settings)
        self.nuisance = nuisance_sentence(result.nuisance) if result.nuisance else ""
        self.answer = ranking_page.answer(result)
        self.matrix = markdown(matrix_tables.matrix(result))
        self.means = markdown(matrix_tables.numbers(result))
        self.seeds = matrix_tables.seeds_sentence(result)

    @property
    def sharing(self) -> int:
        """How many entries share the first place."""
        return sum(score.place == 1 for score in self.result.scores)

    @cached_property
    def apart(self) -> ToldApart:
        """Which of the laws are told apart by the conditions passed."""
        return apart_by_conditions(self.laws)

    @property
    def clear(self) -> int:
        """How many pairs of laws are clearly different by the conditions passed."""
        return int(self.apart.better.sum())

    @property
    def alone(self) -> dict[str, int]:
        """Title of a law -> of how many pairs with it one is better, each pair taken alone; those of most."""
        alone = self.apart.alone
        found = {
            in_text(score.spec.title): int(alone[k].sum() + alone[:, k].sum())
            for k, score in enumerate(self.laws)
        }
        return dict(sorted(found.items(), key=lambda one: -one[1]))

    @property
    def runs(self) -> int:
        """How many runs the ranking makes: matrix, settings, ordinary driving."""
        cells = [score.cells.values() for score in self.result.scores]
        cells += [score.cells.values() for one in self.result.settings if one.name for score in one.scores]
        made = sum(cell.counts[1] for row in cells for cell in row)
        ordinary = self.result.nuisance.scores.values() if self.result.nuisance else ()
        return made + sum(len(score.runs) for score in ordinary)

    @property
    def better(self) -> int:
        """How many laws are clearly better than no control by the conditions passed."""
        placed = [score for score in self.result.scores if score.place]
        idle = [score.spec.fmu == IDLE for score in placed]
        return int(apart_by_conditions(placed).better[:, idle].sum())

    @property
    def steering(self) -> list[str]:
        """The entries whose controllers steer, too."""
        steers = {
            f"controller_{file.stem}"
            for file in (DOCS.parent / "components" / "controllers").glob("*.py")
            if "added_steer_angle_request" in file.read_text(encoding="utf-8")
        }
        return [score.entry for score in self.laws if score.spec.fmu in steers]

    @property
    def sharing_out(self) -> list[str]:
        """The entries with an allocator of their own."""
        return [score.entry for score in self.laws if "allocator" in score.spec.swap]

    def named(self, entries: Iterable[str]) -> str:
        """Return entries' titles as a list in a sentence."""
        return names(score for score in self.laws if score.entry in entries)

    @property
    def pairs_alone(self) -> int:
        """Of how many pairs of laws one is better by the conditions passed, each pair taken alone."""
        return int(self.apart.alone.sum())

    @property
    def needed(self) -> int:
        """By how many conditions that only one of two passes the first pair is told apart, of all pairs."""
        bound = (1.0 - CONFIDENCE) / self.pairs
        return next(n for n in range(1, 1000) if sign_test(n, 0) < bound)

    @property
    def most_passed(self) -> int:
        """How many conditions the first of the order passes."""
        return self.passed(self.laws[0])

    @property
    def fewest(self) -> EntryScore:
        """The law that passes the fewest conditions."""
        return min(self.laws, key=self.passed)

    def title(self, score: EntryScore) -> str:
        """Return an entry's title inside a sentence."""
        return in_text(score.spec.title)

    def passed(self, score: EntryScore) -> int:
        """Return how many conditions an entry passes."""
        return score.count(RankedState.PASSED)

    @property
    def brakings(self) -> list[float]:
        """Shares of ordinary driving in which laws brake."""
        return [score.braking for score in self.laws if score.braking is not None]

    def braking_of(self, entry: str) -> float:
        """Return the share of ordinary driving in which a law brakes."""
        return next(score.braking or 0.0 for score in self.laws if score.entry == entry)

    @property
    def twice(self) -> list[str]:
        """FMUs of the laws that are ranked with both gains."""
        return [score.spec.fmu for score in self.laws if score.spec.gains == "tuned"]

    def by_regulation(self, score: EntryScore) -> int:
        """Return how many conditions an entry passes by the regulation's criteria alone."""
        return score.count(RankedState.PASSED) + score.count(RankedState.SPUN)

    def meeting(self, condition: str) -> int:
        """Return how many laws meet the regulation's criteria in a condition, whatever the sideslip."""
        states = (RankedState.PASSED, RankedState.SPUN)
        return sum(score.cells[condition].state in states for score in self.laws)

    @property
    def told_apart(self) -> dict[str, int]:
        """Column of the table for choosing a law -> how many pairs it tells apart, the most first."""
        choosing = ranking_page.beside_matrix(self.result)[0]
        counts = {
            heading.partition(" [")[0]: int(str(cell).split()[0])
            for heading, cell in zip(choosing.headings[1:], choosing.rows[-1][1:], strict=True)
            if cell is not None
        }
        return dict(sorted(counts.items(), key=lambda one: -one[1]))

    def passing(self, condition: str) -> str:
        """Return the titles of the laws that pass a condition."""
        return names(score for score in self.laws if score.cells[condition].passed)

    def failing(self, *conditions: str) -> str:
        """Return the titles of the laws that fail one of some conditions."""
        return names(
            score for score in self.laws if not all(score.cells[condition].passed for condition in conditions)
        )

    def number(self, least: int) -> int:
        """Return how many laws pass at least so many conditions."""
        return sum(score.count(RankedState.PASSED) >= least for score in self.laws)

    def passing_fewer(self, than: int) -> str:
        """Return the titles of the laws that pass fewer conditions."""
        return names(score for score in self.laws if score.count(RankedState.PASSED) < than)

    def braking(self, most: float) -> str:
        """Return the titles of the laws that brake for at most a share of ordinary driving."""
        return names(score for score in self.laws if score.braking is not None and score.braking <= most)

    def calmer(self, fmus: Iterable[str]) -> int:
        """Return how many laws, by their FMUs, brake less in ordinary driving with tuned gains."""
        found = {
            (score.spec.fmu, score.spec.gains): score.braking or 0.0
            for score in self.laws
            if not score.spec.swap
        }
        return sum(found[fmu, "tuned"] < found[fmu, "authors"] for fmu in fmus)

    def braking_mean(self, gains: str) -> float:
        """Return the mean share of ordinary driving in which laws brake, of those with both gains."""
        both = {score.spec.fmu for score in self.laws if score.spec.gains == "tuned"}
        return fmean(
            score.braking or 0.0
            for score in self.laws
            if score.spec.gains == gains and score.spec.fmu in both and not score.spec.swap
        )

    @property
    def beside(self) -> str:
        """Tables of the page for choosing a law."""
        tables = ranking_page.beside_matrix(self.result)
        return "\n\n".join(f"## {table.title}\n\n{markdown(table)}" for table in tables)


class Threats:
    """What templates name of the threats."""

    def __init__(self, result: ThreatResult) -> None:
        self.result, self.threats = result, result.threats
        self.titles: dict[str, str] = titles_of(result)
        self.scores: ScoreTable = scored(result)
        self.entries = self.scores.order()
        self.tables = threat_tables.tables_text(result)
        self.setting = cache(partial(compared_setting, result))

    def title(self, entry: str) -> str:
        """Return an entry's title inside a sentence."""
        return in_text(self.titles[entry])

    def named(self, entries: Iterable[str]) -> str:
        """Return entries' titles as a list in a sentence, `none` without any."""
        return listed([self.title(entry) for entry in entries]) or "none"

    @property
    def first(self) -> str:
        """The entry with the best score."""
        return self.entries[0]

    @property
    def first_by_rank(self) -> str:
        """The entry with the best mean rank."""
        return next(score.entry for score in self.scores.scores if score.by_rank == 1)

    @property
    def sharing(self) -> int:
        """How many entries share the first place, beside the first."""
        return sum(score.place == 1 for score in self.scores.scores) - 1

    @property
    def behind(self) -> list[str]:
        """The entries that do not share the first place."""
        return [score.entry for score in self.scores.scores if score.place > 1]

    @cached_property
    def others_first(self) -> dict[str, str]:
        """Threat or car left out -> entry that is first then, where it is another."""
        main = self.threats.main
        without = scores_without(self.entries, self.result.positions(main, self.entries), REFERENCE)
        spec = self.threats.spec
        words = {
            ("threat", k): spec.threats[name].short or spec.threats[name].title
            for k, name in enumerate(self.threats.threats_in(main))
        } | {("car", k): f"the car {name}" for k, name in enumerate(self.threats.cars_in(main))}
        return {
            words[place]: first
            for place, order in without.items()
            if (first := next(iter(order))) != self.first
        }

    @cached_property
    def gains(self) -> ComparedGains:
        """Gains and laws, by the setting with several seeds."""
        found = compared_gains(self.result)
        assert found
        return found

    def helped(self, corrected: bool) -> list[str]:
        """Return the laws that tuning clearly helps, each alone or corrected for their number."""
        return [law for law, p in self.gains.helped.items() if p[corrected] < 1.0 - CONFIDENCE]

    @property
    def lower(self) -> list[str]:
        """FMUs of the laws whose mean level is lower tuned than with the gains of the study."""
        entries = self.threats.ranking.entries
        return [entries[law][0].fmu for law, rise in self.rises if rise < 0.0]

    def spreads(self) -> list[tuple[str, float]]:
        """Return threat and standard deviation of laws' mean levels [1 = its range], the largest first."""
        main = self.threats.main
        laws = [entry for entry in self.entries if entry != REFERENCE]
        positions = np.nanmean(self.result.positions(main, laws), axis=2)
        threats = self.threats.threats_in(main)
        found = {
            self.threats.spec.threats[name].short or self.threats.spec.threats[name].title: float(spread)
            for name, spread in zip(threats, positions.std(axis=0, ddof=1), strict=True)
        }
        return sorted(found.items(), key=lambda one: -one[1])

    def alike(self, threat: str) -> int:
        """Return how many entries survive the same level of a threat, of those that most survive."""
        levels = [f"{self.mean_level(threat, entry):.3g}" for entry in self.entries]
        return max(map(levels.count, levels))

    @property
    def rises(self) -> list[tuple[str, float]]:
        """Law and rise of its mean level by tuning, mean over seeds, the largest first."""
        rise = {law: fmean(tuned) - study for law, (study, *tuned) in self.gains.means.items()}
        return sorted(rise.items(), key=lambda one: -one[1])

    @property
    def luckiest(self) -> tuple[str, float]:
        """The law whose level depends most on the seed of the search, and its share of that variance."""
        found = {law: variance(tuned) for law, (_, *tuned) in self.gains.means.items()}
        law = max(found, key=lambda name: found[name])
        return law, found[law] / sum(found.values())

    def surviving(self, threat: str) -> list[str]:
        """Return the entries that survive a threat to the hard end on every car."""
        return [
            entry for entry in self.entries if {one.end for one in self._levels(threat, entry)} == {"hard"}
        ]

    def levels(self, threat: str, entry: str) -> list[float]:
        """Return the levels of a threat that an entry survives, one for each car."""
        return [self.threats.spec.threats[threat].level(one.position) for one in self._levels(threat, entry)]

    def mean_level(self, threat: str, entry: str) -> float:
        """Return the level of a threat that an entry survives, geometric mean over cars."""
        return geometric_mean(self.levels(threat, entry))

    def level_on(self, threat: str, entry: str, car: str) -> float:
        """Return the level of a threat that an entry survives with a car."""
        place = SearchPlace(self.threats.main, threat, car, entry)
        return self.threats.spec.threats[threat].level(self.result.survived[place].position)

    def differ(self, one: str, other: str) -> bool:
        """Return whether two entries are clearly different."""
        return one in self.scores.behind(other) or other in self.scores.behind(one)

    def _levels(self, threat: str, entry: str) -> list[Survived]:
        main = self.threats.main
        cars = self.threats.cars_facing(main, threat)
        return [self.result.survived[SearchPlace(main, threat, car, entry)] for car in cars]

    def moves(self, name: str) -> Moves:
        """Return how the order moves from main to a setting."""
        compared = self.setting(name)
        assert compared.main
        return moves_between(compared.main.by_entry(), compared.table.by_entry(), REFERENCE)

    def lost(self, table: ScoreTable) -> int:
        """Return how many entries lose all cars at the easy end."""
        return sum(score.score == 0.0 for score in table.scores)

    def clear_pairs(self, table: ScoreTable) -> int:
        """Return how many pairs of controllers are clearly different."""
        laws = [k for k, entry in enumerate(table.order()) if entry != REFERENCE]
        return int(table.apart.better[laws][:, laws].sum())

    @cached_property
    def speeds(self) -> dict[str, dict[str, float]]:
        """Car -> entry -> highest clean entry speed [km/h]."""
        setting = "lane_change"
        (threat,) = self.threats.threats_in(setting)
        spec = self.threats.spec.threats[threat]
        return {
            car: {
                entry: spec.level(self.result.survived[SearchPlace(setting, threat, car, entry)].position)
                for entry in self.result.complete[setting]
            }
            for car in self.threats.cars_in(setting)
        }

    def gained(self, car: str) -> list[float]:
        """Return by how much control changes the entry speed of a car [km/h], one for each law."""
        speeds = self.speeds[car]
        return [speed - speeds[REFERENCE] for entry, speed in speeds.items() if entry != REFERENCE]

    def spread(self, car: str) -> float:
        """Return by how much laws differ in the entry speed of a car [km/h]."""
        return max(self.gained(car)) - min(self.gained(car))

    def median(self, discipline: str, entry: str, key: str) -> float:
        """Return the median of a discipline's quantity over cars; a car lost counts as infinity."""
        return median(self._quantities(discipline, entry, key))

    def beyond(self, discipline: str, entry: str, key: str, bound: float) -> int:
        """Return on how many cars a quantity is beyond a bound."""
        return sum(x > bound for x in self._quantities(discipline, entry, key))

    def _quantities(self, discipline: str, entry: str, key: str) -> list[float]:
        cars = self.threats.spec.disciplines[discipline].cars or self.threats.spec.cars
        found = [self.result.quantities[discipline, car, entry][key] for car in cars]
        return [math.inf if x is None else x for x in found]

    @cached_property
    def straight(self) -> list[float]:
        """Median stopping distances of the laws that keep the yaw angle below 2 degrees on split friction."""
        return [
            self.median("braking", entry, "distance")
            for entry in self.entries
            if math.degrees(self.median("braking", entry, "yaw_angle")) < 2.0
        ]

    def better_than_none(self, title: str) -> int:
        """Return how many controllers are clearly better than no control in a discipline."""
        (scores,) = (test.scores for test in disciplines(self.result) if test.title == title)
        order = scores.order()
        return int(scores.apart.better[:, order.index(REFERENCE)].sum())

    def between(self, most: float) -> str:
        """Return the law that stops shortest on split friction and turns by at most an angle [°]."""
        laws = [
            entry
            for entry in self.entries
            if math.degrees(self.median("braking", entry, "yaw_angle")) <= most
        ]
        return min(laws, key=lambda entry: self.median("braking", entry, "distance"))

    def firmest(self, number: int) -> list[str]:
        """Return the laws that a gust of wind pushes least aside."""
        return sorted(self.entries, key=lambda entry: self.median("wind", entry, "deviation"))[:number]

    @cached_property
    def tests(self) -> dict[str, tuple[float, int]]:
        """Title of a discipline -> rank correlation with the threats, and how many pairs differ clearly."""
        return {
            test.title: (
                moves_between(self.scores.by_entry(), test.scores.by_entry(), REFERENCE).correlation,
                self.clear_pairs(test.scores),
            )
            for test in disciplines(self.result)
        }


def names(scores: Iterable[EntryScore]) -> str:
    """Return titles as a list in a sentence, `none` without any."""
    return listed([in_text(score.spec.title) for score in scores]) or "none"


class Tuned(NamedTuple):
    """What the common search has found for a law: its objective, that amid the ranges, the parameters."""

    least: float
    amid: float
    parameters: Mapping[str, Any]


def tuned_laws() -> dict[str, Tuned]:
    """Return law -> what the common search has found, the least objective first."""
    ranking = load_ranking(matrix_tables.FILE)
    found = {}
    for spec, _ in ranking.entries.values():
        if told := re.search(r"cost ([\d.]+), ([\d.]+) amid the ranges", spec.source):
            least, amid = map(float, told.groups())
            found[spec.title.removeprefix("tuned ")] = Tuned(least, amid, spec.parameters)
    return dict(sorted(found.items(), key=lambda one: one[1][:2]))


def tuned_gains() -> Table:
    """Return the objective of the common search, law by law, the least first."""
    rows = [[law, f"{tuned.amid:.1f}", f"{tuned.least:.1f}"] for law, tuned in tuned_laws().items()]
    return Table("", ["law", "study gains, 10 kN.m", "tuned"], [*rows], numbers={1, 2})


def pages_with_tables() -> dict[Path, str]:
    """Return the pages written anew."""
    levels = replace(
        published_result(load_threats(threat_tables.FILE)), published=frozenset()
    )  # all of them are
    pages = rendered(
        "ranking/*.md.jinja",
        {"M": Matrix(matrix_tables.published()), "T": Threats(levels), "idle": REFERENCE},
    )
    page = PROVING_GROUND.read_text(encoding="utf-8")
    return {**pages, PROVING_GROUND: replaced(page, "tuned gains", markdown(tuned_gains()))}


if __name__ == "__main__":
    write_pages(
        __doc__, matrix_tables.RUNS, matrix_tables.COLUMNS, pages_with_tables, matrix_tables.publish_beside
    )
