"""Results of a sample: what runs come to whose conditions are drawn, with how sure each number is.

A group has all points drawn, for one combination of the listed values; every group has the same points. Its
numbers are those of runs that have one; the others are counted, and never count as within a limit.

| number | interval, 95 % | holds the truth |
|---|---|---|
| mean, difference of means | Student (`confidence.interval`) | 95 % of normal numbers, else about |
| standard deviation | jackknife (`confidence.jackknife`) | 80 to 97 % |
| percentile | order statistics, by the binomial distribution | at least 95 % |
| probability | Clopper and Pearson (`confidence.share_bounds`) | at least 95 % |
| distribution function | Dvoretzky, Kiefer, Wolfowitz: ± sqrt(ln 40 / 2n) | at least 95 %, all of it |
| rank correlation | Fisher's z, variance of Bonett and Wright | about 95 % |
| Sobol index | linearized (delta method), Student | about 95 %, of many points |

All hold for independent points. Those of a Latin hypercube and of a Sobol sequence lie more evenly, so the
numbers are better than their intervals say, the most for what is a sum of effects of single quantities.

Sobol indices are shares of the variance that a quantity explains alone (first), and with all others (total):

    S_i = mean of f_B (f_ABi - f_A) / V        S_Ti = mean of (f_A - f_ABi)² / 2 V        V: variance of A, B

for numbers f around their mean, at points A, B, and A with the values of B on axis i.

Sources: H. A. David, H. N. Nagaraja, Order Statistics, 3rd ed., Wiley (2003), section 7.1. P. Massart, The
tight constant in the Dvoretzky-Kiefer-Wolfowitz inequality, Annals of Probability 18 (1990) 1269-1283. D. G.
Bonett, T. A. Wright, Sample size requirements for estimating Pearson, Kendall and Spearman correlations,
Psychometrika 65 (2000) 23-28. A. Saltelli, P. Annoni, I. Azzini, F. Campolongo, M. Ratto, S. Tarantola,
Variance based sensitivity analysis of model output, Computer Physics Communications 181 (2010) 259-270,
table 2 (b) and (f). A. B. Owen, Monte Carlo variance of scrambled net quadrature, SIAM J. Numerical Analysis
34 (1997) 1884-1910: a Latin hypercube of n points is never worse than n - 1 random ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import numpy as np

from yawbench.metrics.expressions import MetricValue, metric
from yawbench.metrics.measures import si

from .axes import RUN, Level
from .claims import judge
from .confidence import TAIL, ConfidenceInterval, interval, jackknife, share_bounds
from .experiment import Case, NamedRun
from .experiment_result import ExperimentResult, within
from .sampling import runs_of_design
from .tables import Cell, Kind, Table, column

PERCENTILES = (1, 5, 10, 25, 50, 75, 90, 95, 99)
"""Percentiles in files; chosen: quartiles, and the tails that are usually asked for."""
SHOWN = (5, 50, 95)
"""Percentiles in tables for people."""
MOST_EXACT = 2000
"""Numbers up to which the interval of a deviation leaves out each in turn; of more, it is linearized."""


Drawn = TypeVar("Drawn", np.ndarray, Sequence[Case])
"""What there is one of for each point."""


class Estimate(NamedTuple):
    """A number with the bounds of its interval; None: there is no bound."""

    number: float
    low: float | None
    high: float | None

    @classmethod
    def of(cls, mean: ConfidenceInterval) -> Estimate:
        """Return a mean with its interval."""
        return cls(mean.mean, mean.mean - mean.half, mean.mean + mean.half)


@dataclass(frozen=True)
class Group:
    """Runs that differ only in what is drawn."""

    run: NamedRun
    levels: tuple[tuple[str, Level], ...]  # of the listed axes
    cases: Sequence[Case]  # in the order in which their points are drawn

    @property
    def words(self) -> list[str]:
        """Its run, if named, and its listed values in words."""
        return [*([self.run.row] if self.run.name else []), *(level.words for _, level in self.levels)]


def groups_of(findings: ExperimentResult) -> list[Group]:
    """Return the groups of a sample, in the order of the design; none if nothing was drawn."""
    experiment, spec = findings.experiment, findings.spec
    if not spec.drawn or experiment.design:
        return []
    number = runs_of_design(spec.design, len(spec.drawn), spec.points or 0)
    groups = []
    for first in range(0, len(experiment.cases), number):
        cases = [*experiment.cases[first : first + number]]  # each made once: a point asks every distribution
        pairs = zip(spec.axes, cases[0].point, strict=True)
        levels = tuple((name, level) for name, level in pairs if name not in spec.drawn)
        groups.append(Group(cases[0].run, levels, cases))
    return groups


def numbers_of(findings: ExperimentResult, group: Group, key: str) -> np.ndarray:
    """Return a metric of a group's runs in SI, shape (points,); NaN where a run has none."""
    values = (findings.value(case, key) for case in group.cases)
    return np.array([value.number if value else math.nan for value in values])


def independent(findings: ExperimentResult, drawn: Drawn) -> Drawn:
    """Return those of a group's points that do not repeat values of others."""
    points = findings.spec.points or 0
    return drawn[: 2 * points] if findings.spec.design == "saltelli" else drawn


def mean(numbers: np.ndarray) -> Estimate | None:
    """Return the mean of finite numbers with its interval; None without numbers."""
    over = interval(numbers.tolist())
    return Estimate.of(over) if over and math.isfinite(over.mean) else None


def deviation(numbers: np.ndarray) -> Estimate | None:
    """Return the standard deviation of finite numbers with its interval; None of fewer than three."""
    n = len(numbers)
    if n < 3:
        return None
    found = float(np.std(numbers, ddof=1))
    if n <= MOST_EXACT:
        half = float(jackknife(lambda of: np.array([np.std(numbers[of], ddof=1)]), n)[1][0])
    else:
        squares = (numbers - numbers.mean()) ** 2
        over = interval((squares / (2.0 * found)).tolist()) if found else None
        half = over.half if over else 0.0
    return Estimate(found, max(0.0, found - half), found + half)


def percentile(numbers: np.ndarray, per_cent: float) -> Estimate:
    """Return a percentile of finite numbers, with the order statistics between which it lies."""
    from scipy.stats import binom

    ordered, n, share = np.sort(numbers), len(numbers), per_cent / 100
    below, above = int(binom.ppf(TAIL, n, share)), int(binom.ppf(1.0 - TAIL, n, share)) + 1
    low = float(ordered[below - 1]) if below >= 1 else None
    return Estimate(
        float(np.quantile(ordered, share)), low, float(ordered[above - 1]) if above <= n else None
    )


def probability(count: int, number: int) -> Estimate:
    """Return a share with its interval by Clopper and Pearson."""
    return Estimate(count / number, *share_bounds(count, number))


def band(number: int) -> float:
    """Return half the height of the band that holds a whole distribution function."""
    return math.sqrt(math.log(2.0 / (2.0 * TAIL)) / (2.0 * number))


def rank_correlation(x: np.ndarray, y: np.ndarray) -> Estimate | None:
    """Return Spearman's rank correlation of finite numbers with its interval; None if one does not vary."""
    from scipy.special import ndtri
    from scipy.stats import rankdata

    if len(x) < 4 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return None
    found = float(np.clip(np.corrcoef(rankdata(x), rankdata(y))[0, 1], -1.0, 1.0))
    if abs(found) == 1.0:
        return Estimate(found, found, found)
    half = -float(ndtri(TAIL)) * math.sqrt((1.0 + found**2 / 2.0) / (len(x) - 3))
    return Estimate(found, math.tanh(math.atanh(found) - half), math.tanh(math.atanh(found) + half))


class SobolIndices(NamedTuple):
    """The share of the variance that a quantity explains alone, and together with all others."""

    first: Estimate
    total: Estimate


def sobol_indices(a: np.ndarray, b: np.ndarray, mixed: np.ndarray) -> SobolIndices | None:
    """Return the Sobol indices of a quantity.

    Args:
        a, b, mixed: numbers at the points A, B, and A with the values of B for the quantity, shape (points,);
            NaN where a run has none.

    None if the numbers do not vary, or fewer than three points have all of them.
    """
    known = np.isfinite(a) & np.isfinite(b) & np.isfinite(mixed)
    a, b, mixed = a[known], b[known], mixed[known]
    if len(a) < 3:
        return None
    centre = (a.mean() + b.mean()) / 2
    a, b, mixed = a - centre, b - centre, mixed - centre
    squares = (a**2 + b**2) / 2
    variance = float(squares.mean())
    if variance == 0.0:
        return None

    def index(terms: np.ndarray) -> Estimate:
        found = float(terms.mean()) / variance
        over = interval(((terms - found * squares) / variance).tolist())
        half = over.half if over else 0.0
        return Estimate(found, found - half, found + half)

    return SobolIndices(index(b * (mixed - a)), index((a - mixed) ** 2 / 2))


# ---- tables ----


@dataclass(frozen=True)
class _Row:
    """Estimates of a group: of a metric or a probability; what else is told of them, by headings."""

    group: Group
    of: str
    about: dict[str, str | int]
    estimates: dict[str, Estimate | None]


SHARES = ("probability", "share smaller", "rank correlation", "first", "total")
"""Headings of estimates that have no unit of a metric."""


def sample_tables(
    findings: ExperimentResult, names: Iterable[str] = (), keys: Iterable[str] = ()
) -> list[Table]:
    """Return the tables of a sample for people, one per metric or probability and name.

    Args:
        findings: of the experiment.
        names: of `SAMPLE_TABLES`; default: all. Statistics leave out metrics that are 0 or 1, which have
            probabilities.
        keys: of metrics and probabilities; default: all.
    """
    tables, only = [], [*keys]
    for name, rows in _rows(findings, names).items():
        for key in dict.fromkeys(row.of for row in rows):
            if (key in only or not only) and not (name == "statistics" and key in findings.whether):
                shown = SAMPLE_TABLES[name][1]
                tables.append(shown(findings, key, [row for row in rows if row.of == key]))
    return [table for table in tables if table.rows]


def sample_columns(findings: ExperimentResult, names: Iterable[str] = ()) -> dict[str, Table]:
    """Return name -> columns of a sample for programs and files, in SI units.

    Args:
        findings: of the experiment.
        names: of `SAMPLE_TABLES`; default: all. Tables without rows are left out.
    """
    return {name: _columns(findings, name, rows) for name, rows in _rows(findings, names).items() if rows}


def _rows(findings: ExperimentResult, names: Iterable[str]) -> dict[str, list[_Row]]:
    """Return the rows of tables of a sample; none if nothing was drawn."""
    groups = groups_of(findings)
    made = names or SAMPLE_TABLES if groups else ()
    return {name: [*SAMPLE_TABLES[name][0](findings, groups)] for name in made}


def _columns(findings: ExperimentResult, name: str, rows: Sequence[_Row]) -> Table:
    """Return columns of the rows of a table: groups, metrics, numbers with bounds of intervals."""
    names, words = _names(findings), [row.group.words for row in rows]
    groups = [column(name, "string", [row[k] for row in words]) for k, name in enumerate(names)]
    of = [row.of for row in rows]
    if name == "probabilities":
        first = [column("probability of", "string", of), *groups]
    else:
        about = {"description": "of the numbers beside it, where they are no shares"}
        units = column("unit", "string", [si(findings.unit(key)) for key in of], about)
        first = [*groups, column("metric", "string", of), units]
    for heading, told in rows[0].about.items():
        kind: Kind = "int64" if isinstance(told, int) else "string"
        first.append(column(heading, kind, [row.about[heading] for row in rows]))
    for heading in rows[0].estimates:
        estimates = [row.estimates[heading] for row in rows]
        for k, end in enumerate(("", " low", " high")):
            numbers = [None if one is None else one[k] for one in estimates]
            unit = {"unit": "1"} if heading in SHARES else None
            first.append(column(f"{heading}{end}", "float64", numbers, unit))
    return Table.of_columns(first)


def _names(findings: ExperimentResult) -> list[str]:
    """Return the headings that tell groups apart."""
    spec = findings.spec
    return [*([RUN] if spec.runs else []), *(name for name in spec.axes if name not in spec.drawn)]


def _heading(findings: ExperimentResult, key: str) -> str:
    spec = findings.spec.metrics[key]
    return spec.heading or f"{metric(spec.metric).title}{spec.during()}"


def _cell(findings: ExperimentResult, key: str, estimate: Estimate | None) -> Cell:
    """Return an estimate of a metric with its interval."""
    return _with_bounds(estimate, findings.unit(key))


def _with_bounds(estimate: Estimate | None, unit: str) -> MetricValue | None:
    if estimate is None:
        return None
    number, low, high = estimate
    if low is None or high is None:
        return MetricValue(number, unit)
    return within(number, unit, low, high)


def _finite(findings: ExperimentResult, group: Group, key: str) -> tuple[np.ndarray, int]:
    """Return the numbers of a metric that runs of a group have, and how many have none."""
    every = independent(findings, numbers_of(findings, group, key))
    numbers: np.ndarray = every[np.isfinite(every)]
    return numbers, len(every) - len(numbers)


def _percentiles(numbers: np.ndarray, wanted: Sequence[int]) -> dict[str, Estimate | None]:
    return {f"p{p}": percentile(numbers, p) if len(numbers) else None for p in wanted}


def _statistics(findings: ExperimentResult, groups: Sequence[Group]) -> Iterator[_Row]:
    for group in groups:
        for key in findings.spec.metrics:
            numbers, missing = _finite(findings, group, key)
            share = key in findings.whether and len(numbers)
            average = probability(int(numbers.sum()), len(numbers)) if share else mean(numbers)
            moments = {"mean": average, "deviation": deviation(numbers)}
            counts: dict[str, str | int] = {"runs": len(numbers), "missing": missing}
            yield _Row(group, key, counts, moments | _percentiles(numbers, PERCENTILES))


def _shown_statistics(findings: ExperimentResult, key: str, rows: Sequence[_Row]) -> Table:
    headings = ["runs", "mean", "standard deviation", *(f"{p} %" for p in SHOWN)]
    table = Table(f"{_heading(findings, key)}, over what is drawn", [*_names(findings), *headings])
    for row in rows:
        runs, missing = int(row.about["runs"]), int(row.about["missing"])
        if runs:
            shown = (row.estimates[heading] for heading in ("mean", "deviation", *(f"p{p}" for p in SHOWN)))
            count = f"{runs} of {runs + missing}" if missing else f"{runs}"
            table.rows.append([*row.group.words, count, *(_cell(findings, key, one) for one in shown)])
            if missing:
                table.notes = ["runs without a number are not in these numbers"]
    return table


def holding(findings: ExperimentResult, group: Group, name: str) -> tuple[int, int, int]:
    """Return in how many of a group's runs something holds, how many have no number, and how many count.

    A run without a number, because it failed say, does not meet conditions; whether something happens in it
    is unknown, and it does not count.
    """
    assertion = findings.spec.probabilities.get(name)
    if assertion is None:
        numbers, missing = _finite(findings, group, name)
        return int(numbers.sum()), missing, len(numbers)
    cases = independent(findings, group.cases)
    labels = {group.run.name: group.run.row}
    verdicts = [
        judge(assertion, findings.at.get(findings.experiment.setting(case.point), {}), labels)
        for case in cases
    ]
    return sum(one.holds is True for one in verdicts), sum(one.holds is None for one in verdicts), len(cases)


def _probabilities(findings: ExperimentResult, groups: Sequence[Group]) -> Iterator[_Row]:
    """Yield rows of conditions, and of metrics that are 0 or 1."""
    spec = findings.spec
    happening = (key for key in spec.metrics if key in findings.whether)
    for name in dict.fromkeys((*spec.probabilities, *happening)):
        for group in groups:
            count, missing, number = holding(findings, group, name)
            if number:
                counts: dict[str, str | int] = {"runs": number, "meeting": count, "missing": missing}
                yield _Row(group, name, counts, {"probability": probability(count, number)})


def _shown_probability(findings: ExperimentResult, name: str, rows: Sequence[_Row]) -> Table:
    assertion = findings.spec.probabilities.get(name)
    says = assertion.says.rstrip(".") if assertion else _heading(findings, name)
    table = Table(f"Probability: {says}", [*_names(findings), "runs", "probability"])
    for row in rows:
        count = f"{row.about['meeting']} of {row.about['runs']}"
        table.rows.append([*row.group.words, count, _with_bounds(row.estimates["probability"], "%")])
        if row.about["missing"]:
            without = "counts as one that does not meet the conditions" if assertion else "does not count"
            table.notes = [f"a run without a number {without}"]
    return table


class Difference(NamedTuple):
    """Two groups of the same points that differ in one listed value."""

    axis: str  # "run" for named runs
    group: Group
    baseline: Group
    words: str  # the value
    than: str  # the first value of the axis


def differences_of(findings: ExperimentResult, groups: Sequence[Group]) -> list[Difference]:
    """Return each group with that of the first value of each listed axis, all others alike."""
    found = []
    for name in _names(findings):
        firsts: dict[Any, Group] = {}
        for group in groups:
            if name == RUN:
                others: Any = group.levels
                here = group.run.row
            else:
                others = (group.run.name, tuple(pair for pair in group.levels if pair[0] != name))
                here = dict(group.levels)[name].words
            first = firsts.setdefault(others, group)
            if first is not group:
                than = first.run.row if name == RUN else dict(first.levels)[name].words
                found.append(Difference(name, group, first, here, than))
    return found


def subtracted(findings: ExperimentResult, one: Group, other: Group, key: str) -> np.ndarray:
    """Return the differences of a metric at the same points, where both groups have it."""
    every = numbers_of(findings, one, key) - numbers_of(findings, other, key)
    drawn: np.ndarray = independent(findings, every)
    kept: np.ndarray = drawn[np.isfinite(drawn)]
    return kept


def _differences(findings: ExperimentResult, groups: Sequence[Group]) -> Iterator[_Row]:
    for of in differences_of(findings, groups):
        for key in findings.spec.metrics:
            numbers = subtracted(findings, of.group, of.baseline, key)
            smaller = probability(int(np.sum(numbers < 0)), len(numbers)) if len(numbers) else None
            yield _Row(
                of.group, key, {"axis": of.axis, "less that of": of.than, "runs": len(numbers)},
                {"mean": mean(numbers), "deviation": deviation(numbers)}
                | _percentiles(numbers, SHOWN) | {"share smaller": smaller},
            )  # fmt: skip


def _shown_differences(findings: ExperimentResult, key: str, rows: Sequence[_Row]) -> Table:
    title = f"{_heading(findings, key)}, differences at the same points"
    table = Table(title, [*_names(findings), "less that of", "runs", "mean", "5 %", "95 %", "smaller in"])
    for row in rows:
        if row.about["runs"]:
            shown = (_cell(findings, key, row.estimates[heading]) for heading in ("mean", "p5", "p95"))
            of = [str(row.about["less that of"]), str(row.about["runs"])]
            smaller = _with_bounds(row.estimates["share smaller"], "%")
            table.rows.append([*row.group.words, *of, *shown, smaller])
    return table


def sensitivities(
    findings: ExperimentResult, group: Group, key: str
) -> dict[str, tuple[Estimate | None, SobolIndices | None]]:
    """Return axis -> rank correlation and Sobol indices of a metric of a group, as far as there are any."""
    spec, numbers = findings.spec, numbers_of(findings, group, key)
    points, places = spec.points or 0, {name: k for k, name in enumerate(spec.axes)}
    own = independent(findings, numbers)
    known = np.isfinite(own)
    found, cases = {}, independent(findings, group.cases)
    for k, name in enumerate(spec.drawn):
        levels = [float(case.point[places[name]].value) for case in cases]
        indices = None
        if spec.design == "saltelli":
            a, b, *mixed = (numbers[i * points : (i + 1) * points] for i in range(len(spec.drawn) + 2))
            indices = sobol_indices(a, b, mixed[k])
        found[name] = (rank_correlation(np.array(levels)[known], own[known]), indices)
    return found


def _sensitivities(findings: ExperimentResult, groups: Sequence[Group]) -> Iterator[_Row]:
    whole = findings.spec.design == "saltelli"
    for group in groups:
        for key in findings.spec.metrics:
            for name, (rank, found) in sensitivities(findings, group, key).items():
                indices = {"first": found and found.first, "total": found and found.total} if whole else {}
                yield _Row(group, key, {"axis": name}, {"rank correlation": rank, **indices})


def _shown_sensitivities(findings: ExperimentResult, key: str, rows: Sequence[_Row]) -> Table:
    whole = findings.spec.design == "saltelli"
    headings = ["rank correlation", *(["Sobol index, alone", "with others"] if whole else [])]
    table = Table(f"{_heading(findings, key)}, what it depends on", [*_names(findings), "drawn", *headings])
    for row in rows:
        name, cells = str(row.about["axis"]), [_with_bounds(one, "1") for one in row.estimates.values()]
        if any(cell is not None for cell in cells):
            table.rows.append([*row.group.words, findings.spec.axes[name].says or name, *cells])
    return table


SAMPLE_TABLES: dict[
    str,
    tuple[
        Callable[[ExperimentResult, Sequence[Group]], Iterator[_Row]],
        Callable[[ExperimentResult, str, Sequence[_Row]], Table],
    ],
] = {
    "statistics": (_statistics, _shown_statistics),
    "probabilities": (_probabilities, _shown_probability),
    "differences": (_differences, _shown_differences),
    "sensitivity": (_sensitivities, _shown_sensitivities),
}
"""Name of a table -> what makes its rows, and the table for people of those of a metric or a probability."""
