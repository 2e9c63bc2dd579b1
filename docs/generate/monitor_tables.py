"""Tables and figure of docs/monitors.md from published runs: `python -m docs.generate.monitor_tables`.

Runs of monitor_parity are in scenarios/real_signals/monitor_runs.csv, taken by `--runs TABLE` from the
table.csv of `yawbench study real_signals/faults`. What monitor_redundancy does is read from the table in
docs/real_signals.md.
"""

from __future__ import annotations

import argparse
import csv
import math
import re
import statistics
import textwrap
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from orchestrator.experiments.confidence import share_bounds

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROOT = Path(__file__).resolve().parents[2]
RUNS = ROOT / "scenarios" / "real_signals" / "monitor_runs.csv"
BEFORE = ROOT / "docs" / "real_signals.md"
PAGE = ROOT / "docs" / "monitors.md"
FIGURE = ROOT / "docs" / "monitors"
BEGIN, END = "<!-- written by docs.generate.monitor_tables -->", "<!-- end of tables -->"
SEEDS_BEFORE = 10
"""Of the table in docs/real_signals.md."""
COLUMNS = ("run", "seed", "found [1]", "after [s]", "blamed [1]", "sideslip [rad]")
MONITORS = {"with": "monitor_redundancy", "parity": "monitor_parity"}
GYRO, ACCELEROMETER, HAND_WHEEL, WHEEL, UNLOCATED = 1, 2, 3, 4, 5
BLAMED = {GYRO: "gyro", ACCELEROMETER: "a_y", HAND_WHEEL: "hand wheel", WHEEL: "wheel", UNLOCATED: "unclear"}


@dataclass(frozen=True)
class Kind:
    """A kind of fault in growing sizes: prefix of its names, title, unit, number of the signal, sizes."""

    prefix: str
    title: str
    unit: str
    signal: int
    sizes: tuple[float, ...]

    def names(self) -> list[str]:
        """Return the names of the faults, as in the study."""
        return [f"{self.prefix}_{size:g}".replace(".", "_") for size in self.sizes]


KINDS = (
    Kind("gyro_bias", "gyro: bias", "deg/s", GYRO, (0.5, 1, 2, 3, 5, 10, 20)),
    Kind("gyro_gain", "gyro: gain", "1", GYRO, (0.5, 0.7, 0.85, 1.15, 1.3, 1.5)),
    Kind("gyro_drift", "gyro: drift", "deg/s²", GYRO, (0.3, 1, 3, 10)),
    Kind("gyro_delay", "gyro: delay", "ms", GYRO, (50, 100, 200)),
    Kind("gyro_noise", "gyro: noise", "deg/s", GYRO, (1, 3, 10)),
    Kind("a_y_bias", "accelerometer: bias", "m/s²", ACCELEROMETER, (0.3, 1, 2, 3, 5)),
    Kind("a_y_gain", "accelerometer: gain", "1", ACCELEROMETER, (0.5, 0.7, 1.3, 1.5)),
    Kind("hand_wheel_bias", "hand wheel: offset", "deg", HAND_WHEEL, (0.5, 1, 2, 5, 10)),
    Kind("hand_wheel_delay", "hand wheel: delay", "ms", HAND_WHEEL, (100, 200)),
    Kind("wheel_gain", "a wheel speed: gain", "1", WHEEL, (0.5, 0.7, 0.9, 1.1, 1.3, 1.5)),
)
OTHERS = {
    "gyro_frozen": ("gyro: frozen", GYRO), "gyro_zero": ("gyro: zero", GYRO),
    "a_y_zero": ("accelerometer: zero", ACCELEROMETER), "hand_wheel": ("hand wheel: frozen", HAND_WHEEL),
    "wheel": ("a wheel speed: zero", WHEEL),
}  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """Detections, delays and blame of a fault, over runs that differ in the seed of the noise."""

    number: int
    delays: list[float]  # of runs with an alarm after the fault [s]
    blamed: list[int]  # of the same runs
    sideslip: list[float]  # largest of every run [deg]

    def located(self, signal: int) -> int:
        """Return in how many runs the right signal is blamed at the end."""
        return sum(number == signal for number in self.blamed)


def outcomes(rows: Iterable[dict[str, str]]) -> dict[str, Outcome]:
    """Return the outcome of every run of the study, over its seeds."""
    groups: dict[str, list[dict[str, str]]] = {}
    for row in rows:
        groups.setdefault(row["run"], []).append(row)
    return {
        name: Outcome(
            len(group),
            [float(row["after [s]"]) for row in group if float(row["found [1]"])],
            [round(float(row["blamed [1]"])) for row in group if float(row["found [1]"])],
            [math.degrees(float(row["sideslip [rad]"])) for row in group],
        )
        for name, group in groups.items()
    }


def published() -> dict[str, Outcome]:
    """Return the published outcomes of both monitors."""
    with RUNS.open(encoding="utf-8", newline="") as lines:
        return {**outcomes(csv.DictReader(lines)), **outcomes_before()}


ROW = re.compile(r"^\| [BC], (with/\S+) \| (\d\S*) \(.*?\) % \| (\S+).*? \| (\S+).*? \| (\S+)", re.MULTILINE)


def outcomes_before() -> dict[str, Outcome]:
    """Return the outcomes of monitor_redundancy in docs/real_signals.md: shares of ten runs and medians."""
    before = {}
    for name, share, after, blamed, sideslip in ROW.findall(BEFORE.read_text(encoding="utf-8")):
        alarms = round(float(share) / 100 * SEEDS_BEFORE)
        before[name] = Outcome(
            SEEDS_BEFORE,
            [float(after)] * alarms if alarms else [],
            [round(float(blamed))] * alarms if alarms else [],
            [float(sideslip)],
        )
    return before


def share_text(count: int, number: int) -> str:
    """Return a share in percent with its 95 % interval of Clopper and Pearson."""
    low, high = share_bounds(count, number)
    return f"{100 * count / number:.0f} ({100 * low:.0f} to {100 * high:.0f})"


def median_text(numbers: Sequence[float], digits: int) -> str:
    """Return a median with the range; a dash without numbers."""
    if not numbers:
        return "-"
    middle = f"{statistics.median(numbers):.{digits}f}"
    low, high = f"{min(numbers):.{digits}f}", f"{max(numbers):.{digits}f}"
    return middle if low == high else f"{middle} ({low} to {high})"


def blamed_text(outcome: Outcome) -> str:
    """Return who is blamed in how many runs, the most frequent first."""
    numbers = sorted(set(outcome.blamed), key=lambda number: (-outcome.blamed.count(number), number))
    return ", ".join(f"{BLAMED[number]} {outcome.blamed.count(number)}" for number in numbers) or "-"


def rows_of_faults() -> list[tuple[str, str, int]]:
    """Return title, name and signal of every fault, kinds in growing sizes first."""
    sized = [
        (f"{kind.title} {size:g} {kind.unit}".removesuffix(" 1"), name, kind.signal)
        for kind in KINDS
        for size, name in zip(kind.sizes, kind.names(), strict=True)
    ]
    return [*sized, *((title, name, signal) for name, (title, signal) in OTHERS.items())]


def faults_table(results: dict[str, Outcome]) -> str:
    """Return the table of all faults in paper B's lane change: a fault per row, a group per monitor."""
    heads = [
        f"{what}, {monitor}"
        for monitor in MONITORS.values()
        for what in ("detected [%]", "after [s]", "blamed")
    ]
    lines = [f"| from 1.5 s on | {' | '.join(heads)} |", f"|---|{'---:|---:|---|' * len(MONITORS)}"]
    for title, name, _ in rows_of_faults():
        cells = []
        for key in MONITORS:
            outcome = results.get(f"{key}/B/{name}")
            if outcome is None:
                cells += ["-"] * 3
                continue
            cells += [
                share_text(len(outcome.delays), outcome.number),
                median_text(outcome.delays, 2),
                blamed_text(outcome),
            ]
        lines.append(f"| {title} | {' | '.join(cells)} |")
    return "\n".join(lines)


def totals_table(results: dict[str, Outcome]) -> str:
    """Return the table of what the monitors reach over all faults together."""
    lines = ["| over all faults | " + " | ".join(MONITORS.values()) + " |", f"|---|{'---:|' * len(MONITORS)}"]
    faults = [row for row in rows_of_faults() if f"with/B/{row[1]}" in results]
    measures: dict[str, Callable[[Outcome, int], bool]] = {
        "faults found in every run": lambda o, s: len(o.delays) == o.number,
        "faults found in no run": lambda o, s: not o.delays,
        "faults of which every run blames the right signal": lambda o, s: o.located(s) == o.number,
        "faults of which some run blames a wrong signal": lambda o, s: any(
            blamed not in (s, UNLOCATED) for blamed in o.blamed
        ),
    }
    for title, holds in measures.items():
        counts = [
            sum(holds(results[f"{key}/B/{name}"], signal) for _, name, signal in faults) for key in MONITORS
        ]
        lines.append(f"| {title}, of {len(faults)} | {' | '.join(map(str, counts))} |")
    return "\n".join(lines)


def cost_table(results: dict[str, Outcome]) -> str:
    """Return the table of what a healthy monitor costs: largest sideslip angles, medians."""
    lines = [
        "| largest sideslip angle [deg] | " + " | ".join(MONITORS.values()) + " |",
        f"|---|{'---:|' * len(MONITORS)}",
    ]
    for paper in "BC":
        cells = [f"{statistics.median(results[f'{key}/{paper}/none'].sideslip):.2f}" for key in MONITORS]
        lines.append(f"| {paper}, nothing is wrong | {' | '.join(cells)} |")
    return "\n".join(lines)


def tables_text(results: dict[str, Outcome]) -> str:
    """Return all tables as Markdown."""
    number = results["parity/B/none"].number
    note = (
        f"Lane change of paper B, 80 km/h, mu 0.3, {number} seeds of the noise. Detected: share of runs with "
        "an alarm after the fault, and its 95 % interval of Clopper and Pearson. After: median (range). "
        "Blamed: at the end, in how many runs; unclear: `monitor_parity` says that it cannot tell. Of "
        f"`monitor_redundancy` {SEEDS_BEFORE} seeds, with medians of delay and blame."
    )
    return "\n\n".join(
        [
            totals_table(results),
            cost_table(results),
            faults_table(results),
            "\n".join(textwrap.wrap(note, 118)),
        ]
    )


def page_with_tables() -> str:
    """Return docs/monitors.md with its tables written anew."""
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    return f"{before}{BEGIN}\n\n{tables_text(published())}\n\n{END}{after}"


def draw(results: dict[str, Outcome]) -> None:
    """Draw detection, delay and blame over the size of every kind of fault with four sizes or more."""
    from orchestrator.figures.style import new_figure, save

    kinds = [kind for kind in KINDS if len(kind.sizes) >= 4]
    with new_figure() as figure:
        figure.set_size_inches(2.1 * len(kinds), 6.2)
        axes = figure.subplots(3, len(kinds), sharex="col", sharey="row", squeeze=False)
        for column, kind in enumerate(kinds):
            for number, key in enumerate(MONITORS):
                _draw_kind(
                    list(axes[:, column]),
                    kind,
                    [results.get(f"{key}/B/{name}") for name in kind.names()],
                    number,
                )
            axes[0, column].set_title(kind.title, fontsize=9)
            axes[2, column].set_xlabel("factor" if kind.unit == "1" else kind.unit)
            if kind.unit != "1":
                axes[2, column].set_xscale("log")
                axes[2, column].set_xticks(kind.sizes, [f"{size:g}" for size in kind.sizes])
                axes[2, column].minorticks_off()
        for row, label in enumerate(("detected", "median delay [s]", "right signal blamed")):
            axes[row, 0].set_ylabel(label)
        for row in (0, 2):
            axes[row, 0].set_ylim(-0.05, 1.05)
        figure.legend(
            *axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False
        )
        save(figure, FIGURE)


def _draw_kind(axes: Sequence[Axes], kind: Kind, of_sizes: Sequence[Outcome | None], number: int) -> None:
    from orchestrator.figures.style import line_style

    style = {**line_style(number), "marker": "os"[number], "markersize": 4}
    pairs = [(size, o) for size, o in zip(kind.sizes, of_sizes, strict=True) if o is not None]
    sizes, known = [size for size, _ in pairs], [o for _, o in pairs]
    shares = ([len(o.delays) for o in known], [o.located(kind.signal) for o in known])
    for place, counts in zip((0, 2), shares, strict=True):
        bounds = [share_bounds(count, o.number) for count, o in zip(counts, known, strict=True)]
        values = [count / o.number for count, o in zip(counts, known, strict=True)]
        axes[place].plot(sizes, values, label=list(MONITORS.values())[number], **style)
        low, high = [b.low for b in bounds], [b.high for b in bounds]
        axes[place].fill_between(sizes, low, high, color=style["color"], alpha=0.12, lw=0)
    delays = [statistics.median(o.delays) if o.delays else math.nan for o in known]
    axes[1].plot(sizes, delays, **style)


def take_runs(table: Path) -> None:
    """Write the published runs from the table of a study: those of monitor_parity."""
    with table.open(encoding="utf-8", newline="") as lines:
        rows = [row for row in csv.DictReader(lines) if row["run"].startswith("parity/")]
    with RUNS.open("w", encoding="utf-8", newline="") as out:
        writer = csv.DictWriter(out, COLUMNS, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--runs", type=Path)
    chosen = options.parse_args()
    if chosen.runs:
        take_runs(chosen.runs)
    PAGE.write_text(page_with_tables(), encoding="utf-8")
    draw(published())
