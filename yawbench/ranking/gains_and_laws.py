"""Whether gains matter more than control laws, and laws more than the luck of the search for gains."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from yawbench.foundation.messages import in_text, listed
from yawbench.studies.confidence import TAIL, Bounds, crossed_probability, jackknife
from yawbench.studies.pair_comparisons import holm
from yawbench.studies.tables import Table

from .ranking import EntrySpec
from .threat_runs import ThreatResult
from .threat_scores import mean_positions

FIRST_SEED = "1"
"""Seed of the tuned entries of a ranking itself."""
FEWEST = 3
"""Laws of which a spread is taken; chosen: fewer say nothing about laws."""


class Spread(NamedTuple):
    """A standard deviation of mean positions, or a ratio of two, with its interval."""

    value: float
    bounds: Bounds


@dataclass(frozen=True)
class GainsAndLaws:
    """Spread of the mean positions by gains and by laws, on the threats and cars that were driven.

    `laws`, `seeds`: of laws tuned with several seeds, the standard deviation between laws and that of the
    luck of the search within them, components of variance; `ratio`: laws / seeds, whose interval lies above 0
    if laws differ by more than that luck, as the test by F = `f`, with `degrees` of freedom, says. `gains`:
    between authors' and tuned gains of a law; `between`: between the means of laws over both. `difference`:
    gains - between; gains matter more than laws if its interval is above 0. It rests on the laws `resting`:
    without these, which gain most by tuning, it is not above 0 any more; empty if it never is.
    """

    laws: float
    seeds: Spread
    ratio: Spread
    f: float
    degrees: tuple[int, int]
    gains: Spread
    between: Spread
    difference: Spread
    resting: tuple[int, ...]


def gains_and_laws(tuned: np.ndarray, authors: np.ndarray) -> GainsAndLaws:
    """Compare spreads of laws, seeds of their search, and gains.

    Args:
        tuned: mean positions of law and seed.
        authors: mean positions of laws, with the authors' gains.

    Laws are a sample of those that could be compared, threats and cars are those driven. The intervals of
    seeds and ratio are exact for normally distributed laws and seeds, the others of a jackknife over laws.
    """
    laws, seeds = tuned.shape
    means, within = tuned.mean(axis=1), tuned.var(axis=1, ddof=1)

    def spreads(some: np.ndarray) -> np.ndarray:
        of_gains = math.sqrt(float((0.5 * (means[some] - authors[some]) ** 2).mean()))
        both = float((0.5 * (means + authors)[some]).var(ddof=1)) - 0.25 * float(within[some].mean()) / seeds
        of_laws = math.sqrt(max(0.0, both))
        return np.array([of_gains, of_laws, of_gains - of_laws])

    def over(some: np.ndarray) -> list[Spread]:
        values, halves = jackknife(lambda chosen: spreads(some[chosen]), len(some))
        pairs = zip(map(float, values), map(float, halves), strict=True)
        return [Spread(value, Bounds(value - half, value + half)) for value, half in pairs]

    of_gains, between, difference = over(np.arange(laws))
    by_gain = np.argsort(-np.abs(means - authors), kind="stable")
    resting: tuple[int, ...] = ()
    if difference.bounds.low > 0.0:
        left_out = (n for n in range(1, laws - 2) if over(np.sort(by_gain[n:]))[2].bounds.low <= 0.0)
        resting = tuple(int(k) for k in by_gain[: next(left_out, 0)])
    ratio, f = ratio_of_spreads(tuned)
    of_seeds = spread_within(tuned)
    return GainsAndLaws(
        ratio.value * of_seeds.value if of_seeds.value else float(means.std(ddof=1)),
        of_seeds, ratio, f, (laws - 1, laws * (seeds - 1)), of_gains, between, difference, resting,
    )  # fmt: skip


def spread_within(groups: np.ndarray) -> Spread:
    """Return the standard deviation within groups, shape (groups, n), with its interval by chi square."""
    from scipy.special import chdtri

    degrees = groups.shape[0] * (groups.shape[1] - 1)
    value = math.sqrt(float(groups.var(axis=1, ddof=1).mean()))
    low, high = (value * math.sqrt(degrees / float(chdtri(degrees, tail))) for tail in (TAIL, 1.0 - TAIL))
    return Spread(value, Bounds(low, high))


def ratio_of_spreads(groups: np.ndarray) -> tuple[Spread, float]:
    """Return the standard deviation between groups over that within them, with its interval, and F.

    Components of variance of a balanced one-way analysis: F is the mean square between groups over that
    within, (1 + n ratio^2) times a number that follows the F distribution.

    Args:
        groups: n numbers of each; shape (groups, n).

    Source: S. R. Searle, G. Casella, C. E. McCulloch, Variance Components, Wiley 1992.
    """
    from scipy.special import fdtri  # what scipy.stats.f uses, without its slow import

    number, n = groups.shape
    within = float(groups.var(axis=1, ddof=1).mean())
    if within == 0.0:
        return Spread(math.inf, Bounds(math.inf, math.inf)), math.inf
    observed = n * float(groups.mean(axis=1).var(ddof=1)) / within
    quantiles = fdtri(number - 1, number * (n - 1), [1.0 - TAIL, TAIL])
    value, low, high = (math.sqrt(max(0.0, observed / q - 1.0) / n) for q in (1.0, *map(float, quantiles)))
    return Spread(value, Bounds(low, high)), observed


@dataclass(frozen=True)
class ComparedGains:
    """Gains and laws by a setting whose laws were tuned with several seeds.

    Attributes:
        setting: its name.
        means: law, by its entry with the studies' gains -> mean position with these, and with each seed.
        groups: title of a group of laws -> spreads; all laws first.
        laws: title of a group -> its laws, in the order of its spreads.
        helped: law -> probability of a difference as large between its tuned gains, means over seeds, and
            those of the study, if they are alike: first taken alone, then corrected for the number of laws.
            Only laws whose tuned gains are better.
    """

    setting: str
    means: dict[str, list[float]]
    groups: dict[str, GainsAndLaws]
    laws: Mapping[str, Sequence[str]]
    helped: dict[str, tuple[float, float]]


def _law(entry: EntrySpec) -> tuple[str, dict[str, str]]:
    return entry.fmu, entry.swap


def compared_gains(result: ThreatResult) -> ComparedGains | None:
    """Compare gains and laws by the setting with seeds; None if there is none with all levels."""
    threats = result.threats
    setting = next((name for name, described in threats.spec.settings.items() if described.seeds), None)
    if setting is None:
        return None
    spec, entries = threats.spec.settings[setting], threats.ranking.entries
    tuned = {
        name: [
            other
            for other in result.complete[setting]
            if entries[other][0].gains == "tuned" and _law(entries[other][0]) == _law(entries[name][0])
        ]
        for name in result.complete[threats.main]
        if entries[name][0].gains == "authors"
    }
    laws = {name: others for name, others in tuned.items() if len(others) == 1 + len(spec.seeds)}
    groups = {f"all {len(laws)} laws": [*laws], **spec.groups}
    tuned_positions = {name: result.positions(setting, others) for name, others in laws.items()}
    studies = {name: result.positions(threats.main, [name], like=setting) for name in laws}
    means = {
        name: [float(x) for x in mean_positions(np.concatenate([studies[name], tuned_positions[name]]))]
        for name in laws
    }
    kept = {title: names for title, names in groups.items() if len(names) >= FEWEST and {*names} <= {*laws}}
    compared = {}
    for title, names in kept.items():
        table = np.array([means[name] for name in names])
        compared[title] = gains_and_laws(table[:, 1:], table[:, 0])
    gained = {name: tuned_positions[name].mean(axis=0) - studies[name][0] for name in laws}
    alone = [crossed_probability(table) for table in gained.values()]
    helped = {
        name: both
        for name, both in zip(laws, zip(alone, holm(alone), strict=True), strict=True)
        if np.nanmean(gained[name]) > 0.0
    }
    return ComparedGains(setting, means, compared, kept, helped) if compared else None


def gains_table(result: ThreatResult, compared: ComparedGains) -> Table:
    """Return the table of spreads, in per cent of a threat's range, a group of laws per pair of columns."""
    threats = result.threats
    groups = compared.groups.values()
    parts = {
        "between seeds of the search, within a law": [gains.seeds for gains in groups],
        "between the studies' and tuned gains, within a law": [gains.gains for gains in groups],
        "between laws, means of both gains": [gains.between for gains in groups],
        "the third less the fourth": [gains.difference for gains in groups],
    }

    def cells(spreads: Sequence[Spread], factor: float = 1.0) -> list[str | None]:
        """Return the value and the interval of each spread."""
        numbers = [[factor * x for x in (spread.value, *spread.bounds)] for spread in spreads]
        return [text for x, low, high in numbers for text in (f"{x:.1f}", f"{low:.1f} to {high:.1f}")]

    between = [cell for gains in groups for cell in (f"{100.0 * gains.laws:.1f}", None)]
    rows = [["between laws, tuned", *between]]
    rows += [[words, *cells(spreads, 100.0)] for words, spreads in parts.items()]
    rows.append(["ratio of the first to the second", *cells([gains.ratio for gains in groups])])
    headings = ["standard deviation of the mean level, % of a range"]
    for title in compared.groups:
        headings += [title, "95 % interval"]
    seeds = 1 + len(threats.spec.settings[compared.setting].seeds)
    searched = threats.threats_in(compared.setting), threats.cars_in(compared.setting), seeds
    notes = [
        f"Threats: {', '.join(searched[0])}; cars: {', '.join(searched[1])}; {searched[2]} seeds of the "
        "search. Intervals hold on these threats and cars: those of seeds and of the ratio are exact if laws "
        "and seeds are samples of normal distributions, the others of a jackknife over laws, which holds the "
        "truth in 80 to 97 % of samples of so few. The first two are components of variance."
    ]
    return Table("", headings, [*rows], notes, {*range(1, len(headings))})


def gains_sentence(result: ThreatResult, compared: ComparedGains) -> str:
    """Return whether gains matter more than laws, and laws more than the luck of their search."""
    titles = {name: spec.title for name, (spec, _) in result.threats.ranking.entries.items()}
    return " ".join(
        _gains_of_group(title, gains, [in_text(titles[compared.laws[title][k]]) for k in gains.resting])
        for title, gains in compared.groups.items()
    )


def _gains_of_group(title: str, gains: GainsAndLaws, resting: Sequence[str]) -> str:
    low, high = gains.difference.bounds
    if low > 0.0:
        verdict = "gains matter more than laws: the interval of the difference is above zero"
    elif high < 0.0:
        verdict = "laws matter more than gains: the interval of the difference is below zero"
    else:
        verdict = (
            "whether gains matter more than laws is undecided: the interval of the difference holds zero"
        )
    if resting:
        verdict += f", but it rests on the study gains of {listed(resting)}, without which it is not"
    ratio = gains.ratio
    luck = (
        "more than the luck of the search" if ratio.bounds.low > 0.0 else "no more than the search's luck may"
    )
    times = f"{ratio.value:.1f} times ({ratio.bounds.low:.1f} to {ratio.bounds.high:.1f})"
    by = f"F({gains.degrees[0]}, {gains.degrees[1]}) = {gains.f:.1f}"
    return f"Among {title}, {verdict}; tuned alike, laws vary {luck} ({by}), {times} as much as seeds of it."


def seeds_table(result: ThreatResult, compared: ComparedGains) -> Table:
    """Return the table of mean levels of each law with the gains of its study and of every seed."""
    threats = result.threats
    seeds = [FIRST_SEED, *threats.spec.settings[compared.setting].seeds]
    headings = ["mean level, % of a range", "study", *(f"seed {seed}" for seed in seeds)]
    rows = [
        [threats.ranking.entries[law][0].title, *(f"{100 * mean:.1f}" for mean in means)]
        for law, means in compared.means.items()
    ]
    return Table("", headings, [*rows], numbers={*range(1, len(headings))})
