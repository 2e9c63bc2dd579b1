"""Tables of docs/monitors.md and docs/real_signals.md: `python -m docs.generate.monitor_tables`.

They come from scenarios/real_signals/monitor_runs.csv, every run of `yawbench study real_signals/faults`,
which `--runs TABLE` takes from the study's table.csv.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from yawbench.studies.confidence import share_bounds
from yawbench.studies.tables import Table

from .published import markdown, pages_with, rows_in, wrapped, write_pages

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROOT = Path(__file__).resolve().parents[2]
RUNS = ROOT / "scenarios" / "real_signals" / "monitor_runs.csv"
PAGE = ROOT / "docs" / "monitors.md"
SIDESLIP_PAGE = ROOT / "docs" / "real_signals.md"
FIGURE = ROOT / "docs" / "monitors"
COLUMNS = ("run", "seed", "found [1]", "after [s]", "blamed [1]", "alarm [1]", "sideslip [rad]")
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
BESIDE = {
    "none": "nothing is wrong", "wrong_alarm": "healthy, the moment taken away",
    "brake": "one wheel not braked",
}  # fmt: skip
"""Runs of the study without a fault of a sensor."""
SPIN = 45.0
"""Sideslip angle beyond which a car spins [deg]; as of the warning `car-spins`."""
OFF = {"B": "off/lane_change_80kmh", "C": "off/double_lane_change"}


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
    """Return the outcome of every run of the study, over its seeds; without a monitor nothing is found."""
    groups: dict[str, list[dict[str, str]]] = {}
    for row in rows:
        groups.setdefault(row["run"], []).append(row)
    found = {name: [row for row in group if float(row["found [1]"] or 0.0)] for name, group in groups.items()}
    return {
        name: Outcome(
            len(group),
            [float(row["after [s]"]) for row in found[name]],
            [round(float(row["blamed [1]"])) for row in found[name]],
            [math.degrees(float(row["sideslip [rad]"])) for row in group],
        )
        for name, group in groups.items()
    }


def published() -> dict[str, Outcome]:
    """Return the published outcomes of all runs."""
    return outcomes(rows_in(RUNS))


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


def faults_table(results: dict[str, Outcome], paper: str) -> str:
    """Return the table of the faults in a paper's lane change: a fault per row, a group per monitor."""
    heads = [
        f"{what}, {monitor}"
        for monitor in MONITORS.values()
        for what in ("detected [%]", "after [s]", "blamed")
    ]
    rows = []
    for title, name, _ in rows_of_faults():
        if f"without/{paper}/{name}" not in results:
            continue
        cells = []
        for key in MONITORS:
            outcome = results[f"{key}/{paper}/{name}"]
            cells += [
                share_text(len(outcome.delays), outcome.number),
                median_text(outcome.delays, 2),
                blamed_text(outcome),
            ]
        rows.append([title, *cells])
    numbers = {1 + k for k in range(len(heads)) if k % 3 < 2}
    return markdown(Table("", [f"{paper}, from 1.5 s on", *heads], rows, numbers=numbers))


def totals_table(results: dict[str, Outcome]) -> str:
    """Return the table of what the monitors reach over all faults together."""
    rows, faults = [], rows_of_faults()
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
        rows.append([f"{title}, of {len(faults)}", *map(str, counts)])
    return markdown(Table("", ["over all faults", *MONITORS.values()], rows, numbers={1, 2}))


def blind_table(results: dict[str, Outcome]) -> str:
    """Return the table of the faults that no run or only some runs find, kinds by sizes."""
    heads = [f"{word}, {m}" for m in MONITORS.values() for word in ("in no run", "in some runs")]
    rows = []
    groups = [
        (f"{kind.title}{'' if kind.unit == '1' else f' [{kind.unit}]'}",
         [(f"{size:g}", name) for size, name in zip(kind.sizes, kind.names(), strict=True)])
        for kind in KINDS
    ]  # fmt: skip
    groups += [(title, [("yes", name)]) for name, (title, _) in OTHERS.items()]
    for title, sizes in groups:
        cells = []
        for key in MONITORS:
            found = {size: results[f"{key}/B/{name}"] for size, name in sizes}
            never = [size for size, outcome in found.items() if not outcome.delays]
            some = [size for size, outcome in found.items() if 0 < len(outcome.delays) < outcome.number]
            cells += [", ".join(never) or "-", ", ".join(some) or "-"]
        if set(cells) != {"-"}:
            rows.append([title, *cells])
    return markdown(Table("", ["fault", *heads], rows))


def blame_table(results: dict[str, Outcome]) -> str:
    """Return the table of the faults of which some run blames a wrong signal or cannot tell."""
    rows = []
    for paper in OFF:
        for title, name, signal in rows_of_faults():
            found = [results.get(f"{key}/{paper}/{name}") for key in MONITORS]
            if any(outcome and outcome.located(signal) < len(outcome.blamed) for outcome in found):
                rows.append([f"{paper}, {title}", *(blamed_text(outcome) for outcome in found if outcome)])
    return markdown(Table("", ["fault", *MONITORS.values()], rows))


def harm_table(results: dict[str, Outcome]) -> str:
    """Return the table of the largest sideslip angles in B where the monitors differ."""
    titles = {**BESIDE, **{name: title for title, name, _ in rows_of_faults()}}
    return _sideslip("B, largest sideslip angle [deg]", [
        [titles[name], *_with_monitors(results, f"B/{name}")]
        for name in ("none", "gyro_noise_3", "gyro_frozen", "gyro_bias_20", "gyro_drift_10")
    ])  # fmt: skip


def _with_monitors(results: dict[str, Outcome], run: str) -> list[str]:
    return [sideslip_text(results[f"{key}/{run}"]) for key in ("without", *MONITORS)]


def _sideslip(what: str, rows: Sequence[Sequence[str]]) -> str:
    heads = [what, "without a monitor", *MONITORS.values()]
    return markdown(Table("", heads, rows, numbers={*range(1, len(heads))}))


def sideslip_text(outcome: Outcome) -> str:
    """Return the median of the largest sideslip angles with their range; of runs that spin, how many."""
    kept = [angle for angle in outcome.sideslip if angle <= SPIN]
    spins = outcome.number - len(kept)
    if not spins:
        return median_text(kept, 2)
    return f"spins ({spins} of {outcome.number}){f', else {median_text(kept, 2)}' if kept else ''}"


def sideslip_table(results: dict[str, Outcome]) -> str:
    """Return the table of the largest sideslip angles of every run of both papers."""
    rows: list[list[str]] = []
    titles = {**BESIDE, **{name: title for title, name, _ in rows_of_faults()}}
    for paper, off in OFF.items():
        rows.append([f"{paper}, no control at all", sideslip_text(results[off]), "-", "-"])
        rows += [
            [f"{paper}, {title}", *_with_monitors(results, f"{paper}/{name}")]
            for name, title in titles.items()
            if f"without/{paper}/{name}" in results
        ]
    return _sideslip("largest sideslip angle [deg]", rows)


def tables(results: dict[str, Outcome]) -> dict[Path, dict[str, str]]:
    """Return all tables as Markdown: page -> name -> text."""
    number = results["parity/B/none"].number
    most = f"{100 * share_bounds(0, number).high:.0f} %"
    blind = (
        f"Sizes that the monitor finds in none of {number} runs, and those that it finds in some, in the "
        f"lane change of paper B (80 km/h, mu 0.3). None of {number} still allows a share of {most} (95 %, "
        "Clopper and Pearson)."
    )
    note = (
        "Lane change of paper B (80 km/h, mu 0.3) and double lane change of paper C (90 km/h, mu 0.4), "
        f"{number} seeds of the noise. Detected: share of runs with an alarm after the fault, and its 95 % "
        "interval of Clopper and Pearson. After: median (range). Blamed: at the end, in how many runs; "
        "unclear: `monitor_parity` says that it cannot tell."
    )
    of_faults = [faults_table(results, paper) for paper in OFF]
    of_detection = [totals_table(results), *of_faults, wrapped(note)]
    sideslip = (
        f"Medians (ranges) over {number} seeds of the noise, the same with the monitors and without. Spins: "
        f"beyond {SPIN:g}°, in how many runs. The moment taken away: nothing is wrong, but from 1.5 s on the "
        "controller's moment is set to zero, as by a wrong alarm. One wheel not braked: from 1.5 s on the "
        "brake of the left front wheel does nothing."
    )
    blame = (
        f"Blamed at the end, in how many runs of {number}; unclear: `monitor_parity` says that it cannot "
        "tell. All other faults are blamed on the right signal wherever they are found."
    )
    harm = f"Medians (ranges) over {number} seeds; spins: beyond {SPIN:g}°."
    return {
        PAGE: {
            "blind": f"{blind_table(results)}\n\n{wrapped(blind)}",
            "blame": f"{blame_table(results)}\n\n{wrapped(blame)}",
            "detection": "\n\n".join(of_detection),
            "harm": f"{harm_table(results)}\n\n{wrapped(harm)}",
        },
        SIDESLIP_PAGE: {"sideslip": f"{sideslip_table(results)}\n\n{wrapped(sideslip)}"},
    }


def pages_with_tables() -> dict[Path, str]:
    """Return the pages with their tables written anew."""
    return pages_with(tables(published()))


def draw(results: dict[str, Outcome]) -> None:
    """Draw detection, delay and blame over the size of every kind of fault with four sizes or more."""
    from yawbench.figures.style import new_figure, save

    kinds = [kind for kind in KINDS if len(kind.sizes) >= 4]
    with new_figure() as figure:
        figure.set_size_inches(2.1 * len(kinds), 6.2)
        axes = figure.subplots(3, len(kinds), sharex="col", sharey="row", squeeze=False)
        for column, kind in enumerate(kinds):
            for number, key in enumerate(MONITORS):
                _draw_kind(
                    list(axes[:, column]),
                    kind,
                    [results[f"{key}/B/{name}"] for name in kind.names()],
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


def _draw_kind(axes: Sequence[Axes], kind: Kind, known: Sequence[Outcome], number: int) -> None:
    from yawbench.figures.style import line_style

    style = {**line_style(number), "marker": "os"[number], "markersize": 4}
    sizes = kind.sizes
    shares = ([len(o.delays) for o in known], [o.located(kind.signal) for o in known])
    for place, counts in zip((0, 2), shares, strict=True):
        bounds = [share_bounds(count, o.number) for count, o in zip(counts, known, strict=True)]
        values = [count / o.number for count, o in zip(counts, known, strict=True)]
        axes[place].plot(sizes, values, label=list(MONITORS.values())[number], **style)
        low, high = [b.low for b in bounds], [b.high for b in bounds]
        axes[place].fill_between(sizes, low, high, color=style["color"], alpha=0.12, lw=0)
    delays = [statistics.median(o.delays) if o.delays else math.nan for o in known]
    axes[1].plot(sizes, delays, **style)


if __name__ == "__main__":
    write_pages(__doc__, RUNS, COLUMNS, pages_with_tables)
    draw(published())
