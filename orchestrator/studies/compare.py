"""One scenario with several FMUs for a unit: what runs, and what the runs come to side by side."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..errors import ScenarioError
from ..figures.panels import Run, shown_by
from ..figures.plots import draw
from ..figures.style import save
from ..metrics.run_metrics import STANDARD, Value, evaluate_all, metric
from ..plan import Change
from ..scenario.load import load_scenario
from ..scenario.overrides import is_path, swap_of
from ..writing import write_whole
from .jobs import Job, Outcome, read_back
from .study_schema import text_of
from .tables import Cell, Table, for_markdown, harmless, marked, remarks, si, write_csv

PANELS = (
    "steer_angle",
    "sideslip",
    "sideslip_error",
    "yaw_rate",
    "acceleration_y",
    "yaw_moment",
    "path",
)
FIGURES = {"overview": PANELS, "wheel_torques": ("wheel_torque_*",)}
"""Name of the file -> panels."""
METRICS, REPORT = "metrics.csv", "compare.md"


def variants(
    scenario: Path, swaps: Sequence[str], changes: Sequence[Change], out: Path, fmus: Path | None
) -> list[Job]:
    """Return one job for every combination of the FMUs that `swaps` names.

    Args:
        scenario: the scenario file.
        swaps: `unit=fmu,fmu,...`; a unit may be named more than once. An FMU may bring parameters,
            `fmu:parameter=value:parameter=value`, so that one FMU can be compared with itself. If only
            one FMU is named in all, the scenario as it stands is the other variant.
        changes: for all.
        out: folder of all results; each variant has a folder below, named like it.
        fmus: folder of FMUs given by name.

    Raises:
        ScenarioError: the scenario or an option is wrong, or there is nothing to compare.
    """
    choices = _choices(swaps)
    if all(len(names) == 1 for names in choices.values()):
        swapped = [swap_of(unit, names[0], "--swap")[0] for unit, names in choices.items()]
        own = load_scenario(scenario, changes=[*swapped, *changes]).replaced
        for unit, names in choices.items():
            fmu = str(scenario.absolute().parent / own[unit]) if is_path(own[unit]) else own[unit]
            names[:0] = [fmu] if fmu not in names else []
    named = [unit for unit, names in choices.items() if len(names) > 1]
    if not named:
        raise ScenarioError("nothing to compare: name several FMUs, for example --swap controller=a,b")
    jobs: list[Job] = []
    for combination in itertools.product(*choices.values()):
        chosen = dict(zip(choices, combination, strict=True))
        label = " + ".join(_label(chosen[unit], choices[unit]) for unit in named)
        repeated = sum(job.label.partition(" (")[0] == label for job in jobs)
        label += f" ({repeated + 1})" if repeated else ""
        folder = out / re.sub(r"[^\w.+=-]+", "_", label.replace(" + ", "+")).strip("_")
        if any(job.out == folder for job in jobs):
            folder = folder.with_name(f"{folder.name}_{len(jobs) + 1}")
        own_changes = [one for unit, text in chosen.items() for one in swap_of(unit, text, "--swap")]
        jobs.append(Job(label, scenario, folder, (*changes, *own_changes), fmus))
    return jobs


def _choices(swaps: Sequence[str]) -> dict[str, list[str]]:
    """Return unit -> FMUs, each once, in the order of the options."""
    choices: dict[str, list[str]] = {}
    for text in swaps:
        unit, equals, fmus = text.partition("=")
        names = [fmus] if Path(fmus).is_file() else [name.strip() for name in fmus.split(",")]
        if not (unit.strip() and equals and all(names)):
            raise ScenarioError(f"--swap {text}: write --swap UNIT=FMU or --swap UNIT=FMU,FMU,...")
        known = choices.get(unit.strip(), [])
        choices[unit.strip()] = list(dict.fromkeys([*known, *names]))
    return choices


def _label(text: str, choices: Sequence[str]) -> str:
    """Return what tells a choice from the others: its FMU, unless all have it, and what they do not share."""
    fmu, *brought = swap_of("", text, "--swap")
    others = [swap_of("", other, "--swap") for other in choices]
    name = str(fmu.value)
    shared = [one for one in brought if all(one in other for other in others)]
    values = [f"{one.place[1:]}={text_of(one.value)}" for one in brought if one not in shared]
    one_fmu = all(other[0] == fmu for other in others)
    return " ".join([*([] if one_fmu and values else [Path(name).stem if is_path(name) else name]), *values])


@dataclass(frozen=True)
class Comparison:
    """The runs that reached their end, why the others did not, and the metrics of each."""

    runs: list[Run]
    failed: dict[str, str]
    values: dict[str, dict[str, Value]]  # label -> metric -> value


def judge_comparison(outcomes: Sequence[Outcome]) -> Comparison:
    """Read the results back from disk and compute the standard metrics."""
    found = [(one.job.label, one.reason or read_back(one.job.out, one.value)) for one in outcomes]
    runs = [Run(label, results) for label, results in found if not isinstance(results, str)]
    failed = {label: reason for label, reason in found if isinstance(reason, str)}
    return Comparison(runs, failed, {run.label: evaluate_all(run.results) for run in runs})


def metric_table(comparison: Comparison, title: str, changed: str = "") -> Table:
    """Return a table with one row per metric and one column per run; `changed` for all stands below."""
    labels = [*(marked(run.label, run.results) for run in comparison.runs), *comparison.failed]
    notes = [f"changed: {changed}"] if changed else []
    notes += remarks((run.label, run.results) for run in comparison.runs)
    table = Table(title, ["metric", "", *labels], notes=notes)
    for name in STANDARD:
        cells: list[Cell] = [values.get(name) for values in comparison.values.values()]
        if any(cell is not None for cell in cells):
            chosen = metric(name)
            table.rows.append([chosen.title, chosen.formula, *cells, *("failed" for _ in comparison.failed)])
    table.notes += [f"{run.label}: {run.results.ended}" for run in comparison.runs if run.results.ended]
    return table


def write_comparison(comparison: Comparison, table: Table, out: Path, changed: str = "") -> list[str]:
    """Write figures and tables into `out`, under the table's title; return the names of the files."""
    drawable = [name for name, panels in FIGURES.items() if shown_by(comparison.runs, panels)]
    figures = {
        name: draw(comparison.runs, FIGURES[name], title=table.title, changed=changed) for name in drawable
    }
    written = [path.name for name, figure in figures.items() for path in save(figure, out / name)]
    names = [name for name in STANDARD if any(name in v for v in comparison.values.values())]
    units = {name: value.unit for values in comparison.values.values() for name, value in values.items()}
    early = {run.label: run.results.ended for run in comparison.runs}
    rows: list[list[Cell]] = [
        [label, early[label] or "completed", *(values.get(name) for name in names)]
        for label, values in comparison.values.items()
    ]
    rows += [[label, f"failed: {why}", *(None for _ in names)] for label, why in comparison.failed.items()]
    write_csv(out / METRICS, ["run", "status", *(f"{name} [{si(units[name])}]" for name in names)], rows)
    failed = "".join(f"\n{label} failed: {why}\n" for label, why in comparison.failed.items())
    pictures = "".join(f"\n![{name}]({name})\n" for name in written if name.endswith(".png"))
    write_whole(out / REPORT, harmless(f"{for_markdown(table)}{failed}{pictures}"))
    return [*written, METRICS, REPORT]
