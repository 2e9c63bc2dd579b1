"""The table of tests with wrong parameters in docs/estimators.md: `python -m docs.generate.blind_tables`.

It comes from scenarios/real_signals/blind_runs.csv, every run of
`yawbench sweep real_signals/blind_estimators`, which `--runs TABLE` takes from the sweep's table.csv.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from yawbench.studies.confidence import Bounds, crossed_interval
from yawbench.studies.tables import Table

from .published import markdown, pages_with, rows_in, wrapped, write_pages

ROOT = Path(__file__).resolve().parents[2]
RUNS = ROOT / "scenarios" / "real_signals" / "blind_runs.csv"
PAGE = ROOT / "docs" / "estimators.md"
ESTIMATORS = ("observer", "kinematic")
RIGHT = "nothing"
"""The level of the sweep without an error."""
COLUMNS = (
    "run", "error", "seed", "observer [rad]", "observer_worst [rad]", "kinematic [rad]",
    "kinematic_worst [rad]", "sideslip [rad]",
)  # fmt: skip

Errors = dict[str, np.ndarray]
"""Effect unknown to the estimators -> their errors, by manoeuvre and seed [deg]."""


def published() -> dict[str, Errors]:
    """Return the numbers of all published runs by their metric."""
    rows = rows_in(RUNS)
    runs, seeds = ([*dict.fromkeys(row[key] for row in rows)] for key in ("run", "seed"))
    metrics: dict[str, Errors] = {}
    for row in rows:
        for name in COLUMNS[3:]:
            of_errors = metrics.setdefault(name.partition(" ")[0], {})
            table = of_errors.setdefault(row["error"], np.full((len(runs), len(seeds)), np.nan))
            table[runs.index(row["run"]), seeds.index(row["seed"])] = math.degrees(float(row[name]))
    return metrics


def mean_bounds(errors: np.ndarray) -> Bounds:
    """Return the bounds of the mean over manoeuvres and seeds, samples both."""
    mean, half = crossed_interval(errors)
    return Bounds(mean - half, mean + half)


def added(errors: Errors) -> Errors:
    """Return by how much every error is worse than none, run by run."""
    return {name: table - errors[RIGHT] for name, table in errors.items() if name != RIGHT}


def table_text(metrics: Mapping[str, Errors]) -> str:
    """Return the table as Markdown: an error per row, with mean, interval and worst second."""
    heads = [
        f"{name}, {what}" for name in ESTIMATORS for what in ("rms", "more than if told", "worst second")
    ]
    rows = []
    for error in metrics["observer"]:
        cells = []
        for name in ESTIMATORS:
            more = "-" if error == RIGHT else _with_bounds(added(metrics[name])[error], "+")
            worst = metrics[f"{name}_worst"][error].max()
            cells += [f"{metrics[name][error].mean():.2f}°", more, f"{worst:.2f}°"]
        rows.append([error, *cells])
    return markdown(Table("", ["not told", *heads], rows, numbers={*range(1, 1 + len(heads))}))


def _with_bounds(errors: np.ndarray, sign: str = "") -> str:
    low, high = mean_bounds(errors)
    return f"{errors.mean():{sign}.2f}° ({low:{sign}.2f} to {high:{sign}.2f})"


def worst_sentences(metrics: Mapping[str, Errors]) -> str:
    """Return which error does most harm to each estimator, and which are not separable from it."""
    sentences = []
    for name in ESTIMATORS:
        more = added(metrics[name])
        worst, *others = sorted(more, key=lambda error: -more[error].mean())
        sentence = f"{name.capitalize()}: a {worst} adds {_with_bounds(more[worst])} to the rms"
        differences = {error: more[worst] - more[error] for error in others}
        near = [error for error in others if mean_bounds(differences[error]).low <= 0.0]
        if near:
            listed = ", ".join(f"{error} by {_with_bounds(differences[error], '+')}" for error in near)
            sentences.append(f"{sentence}, not separable from the next (paired: worse than {listed}).")
        else:
            listed = f"{_with_bounds(differences[others[0]], '+')} more than {others[0]}"
            sentences.append(f"{sentence}, more than any other (paired: {listed}).")
    return " ".join(sentences)


def parameters_sentence(metrics: Mapping[str, Errors]) -> str:
    """Return what a wrong stiffness or mass adds to the observer's error at most."""
    more = {error: table for error, table in added(metrics["observer"]).items() if "bank" not in error}
    worst = max(more, key=lambda error: more[error].mean())
    largest = max(table.max() for table in more.values())
    return (
        f"A wrong stiffness or mass adds at most {_with_bounds(more[worst])} to the observer's mean rms "
        f"({worst}), {largest:.2f}° in the worst run."
    )


def pages_with_tables() -> dict[Path, str]:
    """Return the page with its table written anew."""
    metrics = published()
    manoeuvres, seeds = metrics["observer"][RIGHT].shape
    note = (
        f"Errors of the sideslip angle over whole runs: means over {manoeuvres} manoeuvres and {seeds} seeds "
        "of the noise, with 95 % intervals for which both are samples (Satterthwaite); with so few "
        "manoeuvres they are wide. Worst second: the largest rms over a second."
    )
    first = (
        f"Over these {manoeuvres} manoeuvres a bank that is not measured harms most. "
        f"{worst_sentences(metrics)} {parameters_sentence(metrics)}"
    )
    text = "\n\n".join([wrapped(first), table_text(metrics), wrapped(note)])
    return pages_with({PAGE: {"blind tests": text}})


if __name__ == "__main__":
    write_pages(__doc__, RUNS, COLUMNS, pages_with_tables)
