"""What a sweep leaves on disk beside its journal: the table, figures, a page that shows them."""

from __future__ import annotations

from pathlib import Path

from ..errors import ResultsError
from ..figures.style import save
from ..metrics.run_metrics import metric
from ..studies.study import Each
from ..studies.tables import Cell, Table, for_markdown, harmless
from ..titles import changed
from ..wording import counted
from ..writing import write_whole
from .figures import draw
from .limits import limit_table
from .schema import FigureSpec
from .table import TABLE, Swept, point_text, write_table

REPORT, FIGURES = "sweep.md", "figures"


def write_sweep(swept: Swept, out: Path, *, each: Each = map) -> list[str]:
    """Write table, figures and report into `out`; return what could not be drawn.

    Args:
        swept: the sweep.
        out: its folder of results.
        each: how to draw all figures.

    Raises:
        ResultsError: a file cannot be written.
    """
    write_table(swept, out / TABLE)
    figures, light = swept.planned.sweep.spec.figures, swept.light()
    wanted = [(light, figure, out / FIGURES / figure.name) for figure in figures]
    drawn: dict[str, str] = {}
    problems = []
    for figure, problem in zip(figures, each(_draw, wanted), strict=True):
        if problem:
            problems.append(f"figure {figure.name}: {problem}")
        else:
            drawn[figure.title or figure.name] = f"{FIGURES}/{figure.name}.png"
    write_whole(out / REPORT, _page(swept, drawn))
    return problems


def findings_text(swept: Swept) -> str:
    """Return in how many runs something was remarkable, `spin in 3 of 20 runs`; "" for none."""
    total = counted(len(swept.planned.runs), "run")
    return ", ".join(f"{kind} in {count} of {total}" for kind, count in swept.findings().items())


def _draw(wanted: tuple[Swept, FigureSpec, Path]) -> str | None:
    swept, figure, stem = wanted
    try:
        save(draw(swept, figure), stem)
    except ResultsError as error:
        return str(error)
    return None


def limit_tables(swept: Swept) -> list[Table]:
    """Return the tables of all limits."""
    tables = [limit_table(swept, name) for name in swept.planned.sweep.spec.limits]
    if words := changed(swept.planned.sweep.by_options):
        for table in tables:
            table.notes.append(f"changed: {words}")
    return tables


def _page(swept: Swept, drawn: dict[str, str]) -> str:
    spec = swept.planned.sweep.spec
    runs, failed = swept.planned.runs, swept.failed
    ended = f"; {len(failed)} failed" if failed else ""
    head = [f"# {spec.title}", "", *([spec.source, ""] if spec.source else [])]
    head += [f"{counted(len(runs), 'run')} of `{spec.scenario}`, one row each in `{TABLE}`{ended}.", ""]
    if words := changed(swept.planned.sweep.for_all):
        head += [f"Changed in all runs: {words}.", ""]
    if found := findings_text(swept):
        head += [f"{found}; which, says the column `findings`.", ""]
    parts = ["\n".join(head), for_markdown(_metrics(swept))]
    parts += [for_markdown(table) for table in limit_tables(swept)]
    parts += [f"![{title}]({path})\n" for title, path in drawn.items()]
    if failed:
        rows: list[list[Cell]] = [
            [point_text(swept.planned, run), "; ".join(swept.record(run).problems)] for run in failed
        ]
        parts.append(for_markdown(Table("Runs that failed", ["run", "why"], [*rows])))
    return harmless("\n".join(parts))


def _metrics(swept: Swept) -> Table:
    table = Table("Metrics", ["column", "what it is", "", "unit"])
    for key, spec in swept.planned.sweep.spec.metrics.items():
        chosen = metric(spec.metric)
        unit = swept.unit(key)
        table.rows.append(
            [key, f"{chosen.definition}{spec.during()}", chosen.formula, "" if unit == "1" else unit]
        )
    return table
