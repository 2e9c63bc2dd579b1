"""Tables of the matrix, nuisance and settings from published cells, for the pages on the ranking."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from yawbench.ranking.nuisance import Nuisance, OrdinaryRun, nuisance_of
from yawbench.ranking.ranking import LoadedRanking, load_ranking
from yawbench.ranking.ranking_scores import EntryScore, RankedState, RankingCell, RankingResult, placed
from yawbench.ranking.ranking_tables import interval_words, sign_of
from yawbench.ranking.settings import AS_IT_IS, SettingScores
from yawbench.ranking.whole_ranking import WholeRanking, with_braking
from yawbench.studies.confidence import ConfidenceInterval
from yawbench.studies.jobs import STEP_TIME
from yawbench.studies.tables import Table

from .published import rows_in, take

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "scenarios" / "proving_ground" / "ranking.yaml"
RUNS = FILE.parent / "matrix.csv"
NUISANCE = FILE.parent / "nuisance.csv"
SETTINGS = FILE.parent / "settings.csv"
NOISY = "hard_sensors"
"""The condition whose seeds are told in a sentence."""
TOLD = ("sliding_mode", "dead_band", "fnn")
"""Entries in that sentence beside the first of the order: three kinds of laws."""
COLUMNS = (
    "entry", "condition", "state", "runs", "passed", "headroom [points]", "headroom_half_width [points]",
    "sideslip [rad]", "sideslip_half_width [rad]", "speed_lost [m/s]", "intervention [N.m.s]",
    "chatter [N.m/s]", f"{STEP_TIME} [s]",
)  # fmt: skip


OF_NUISANCE = ("entry", "situation", "car", "repeat", "braking [1]", "pressure [Pa]", "speed_end [m/s]")
OF_SETTINGS = ("setting", "entry", "condition", "state", "runs", "passed", "sideslip [rad]")
BESIDE = {NUISANCE: OF_NUISANCE, SETTINGS: OF_SETTINGS}
"""Published tables beside the cells -> their columns."""


@dataclass(frozen=True)
class PublishedCell(RankingCell):
    """A cell as it is published, without its runs."""

    row: Mapping[str, str] = field(default_factory=dict)

    @property
    def state(self) -> RankedState:
        """The published state."""
        return RankedState(self.row["state"])

    @property
    def passed(self) -> bool:
        """Whether all runs passed."""
        return self.state is RankedState.PASSED

    @property
    def counts(self) -> tuple[int, int]:
        """The number of runs that passed, and of all."""
        return int(self.row["passed"]), int(self.row["runs"])

    def number(self, key: str) -> float | None:
        """Return a published number in SI units, or points."""
        column = next(name for name in COLUMNS if name.partition(" ")[0] == key)
        return float(self.row[column]) if self.row.get(column) else None

    def over_seeds(self, key: str) -> ConfidenceInterval:
        """Return the mean of headroom or sideslip over seeds with its interval."""
        return ConfidenceInterval(self.number(key) or 0.0, self.number(f"{key}_half_width") or 0.0)


def published() -> WholeRanking:
    """Return the ranking that follows from the published cells, without what has none yet."""
    ranking = load_ranking(FILE)
    cells = {
        (row["entry"], row["condition"]): PublishedCell(row["entry"], row["condition"], [], row)
        for row in rows_in(RUNS)
    }
    known = {key for _, key in cells}
    entries = {name: entry for name, entry in ranking.entries.items() if any(name == e for e, _ in cells)}
    ranking = replace(
        ranking, entries=entries, chosen=tuple(name for name in ranking.spec.conditions if name in known)
    )
    nuisance, scores = _nuisance(ranking), _scores(ranking, cells)
    return WholeRanking(ranking, {}, [], with_braking(scores, nuisance), nuisance, _settings(ranking))


def _scores(ranking: LoadedRanking, cells: Mapping[tuple[str, str], RankingCell]) -> list[EntryScore]:
    return placed([
        EntryScore(name, spec, {key: cells[name, key] for key in ranking.conditions})
        for name, (spec, _) in ranking.entries.items()
    ])  # fmt: skip


def _nuisance(ranking: LoadedRanking) -> Nuisance | None:
    """Return the published nuisance; None without any."""
    if not NUISANCE.is_file():
        return None
    runs = [
        OrdinaryRun(
            row["entry"], row["situation"], row["car"], row["repeat"] or None, None,
            {key.partition(" ")[0]: float(row[key]) for key in OF_NUISANCE[4:] if row[key]},
        )
        for row in rows_in(NUISANCE)
    ]  # fmt: skip
    return nuisance_of(ranking, runs)


def _settings(ranking: LoadedRanking) -> list[SettingScores]:
    """Return the published scores under settings, the ranking's own first; none without any."""
    if not SETTINGS.is_file():
        return []
    rows, found = rows_in(SETTINGS), []
    for name in dict.fromkeys(row["setting"] for row in rows):
        if name and name not in ranking.spec.settings:
            continue
        under = ranking.under(name)
        own = {(row["entry"], row["condition"]): row for row in rows if row["setting"] == name}
        title = ranking.spec.settings[name].title if name else AS_IT_IS
        cells = {
            (entry, key): PublishedCell(entry, key, [], own.get((entry, key), MISSING))
            for entry in ranking.entries
            for key in under.conditions
        }
        found.append(SettingScores(name, title, under, _scores(under, cells)))
    return found


MISSING = {"state": RankedState.MISSING.value, "runs": "1", "passed": "0"}
"""A cell that is not published."""


def matrix(result: RankingResult) -> Table:
    """Return who passes which condition: a row per controller, the first of the order at the top."""
    conditions = result.ranking.conditions
    rows = []
    for score in result.scores:
        cells = (sign_of(cell) + " spun" * (cell.state is RankedState.SPUN) for cell in score.cells.values())
        passed = str(score.count(RankedState.PASSED))
        rows.append([str(score.rank), score.spec.title, passed, interval_words(score), *cells])
    headings = [condition.heading.replace("*", r"\*") for condition in conditions.values()]
    return Table("", ["", "controller", "passed", "95 % interval", *headings], [*rows], numbers={0, 2})


def numbers(result: RankingResult) -> Table:
    """Return the means over conditions."""
    headings = [
        "", "controller", "runs that pass", "headroom", "peak sideslip [°]", "speed lost [km/h]",
        "intervention [N·m·s]", "chatter [kN·m/s]", "time per step [µs]",
    ]  # fmt: skip
    rows = []
    for score in result.scores:
        mean = {key: score.mean(key) or 0.0 for key in ("headroom", "speed_lost", "intervention", "chatter")}
        rows.append([
            str(score.rank), score.spec.title, f"{100 * score.share:.0f} %", f"{mean['headroom']:.1f}",
            f"{math.degrees(score.mean('sideslip') or 0.0):.1f}", f"{3.6 * mean['speed_lost']:.1f}",
            f"{mean['intervention']:.0f}", f"{1e-3 * mean['chatter']:.1f}",
            f"{1e6 * (score.step_time or 0.0):.0f}",
        ])  # fmt: skip
    return Table("", headings, [*rows], numbers={0, *range(2, len(headings))})


def seeds_sentence(result: RankingResult) -> str:
    """Return the peak sideslip of some entries over seeds of the sensors' noise."""
    ranking = result.ranking
    (seeds,) = ranking.conditions[NOISY].repeats.values()
    by_name = {score.entry: score for score in result.scores}
    told = []
    for name in (result.scores[0].entry, *TOLD):
        cell = by_name[name].cells[NOISY]
        assert isinstance(cell, PublishedCell)
        mean, half = map(math.degrees, cell.over_seeds("sideslip"))
        told.append(f"{mean:.1f}° ± {half:.1f}° for {by_name[name].spec.title}")
    return (
        f"Largest sideslip on `hard` with sensors, mean over {len(seeds)} seeds with 95 % confidence: "
        f"{', '.join(told)}."
    )


def publish_beside(cells: Path) -> None:
    """Take the tables beside the cells of a ranking, if they are there."""
    for published_file, columns in BESIDE.items():
        if (table := cells.parent / published_file.name).is_file():
            take(table, published_file, columns)
