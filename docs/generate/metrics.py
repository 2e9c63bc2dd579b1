"""The table of metrics, from the library that computes them."""

from __future__ import annotations

from orchestrator.metrics import measures, run_metrics

from .text import NOTE, cell, code, docstring, table


def page() -> str:
    """Return the page of all measures, of the metrics that are shown unasked, of what stands in for what."""
    rows = []
    for name, m in measures.MEASURES.items():
        formula = m.formula.replace("{x_ref}", "x_ref").replace("{x}", "x")
        unit = "of the signal" if m.unit == "{x}" else m.unit.replace("{x}", "unit")
        meaning = f"{cell(m.definition)}<br>{code(formula)}"
        rows.append((code(name), meaning, cell(unit), "yes" if m.needs_reference else ""))
    standard = []
    for name in run_metrics.STANDARD:
        metric = run_metrics.metric(name)
        standard.append((code(name), f"{cell(metric.definition)}<br>{code(metric.formula)}"))
    return "\n\n".join([
        "# Metrics",
        NOTE,
        docstring(run_metrics.__doc__ or ""),
        "x is the signal, x_ref its reference, T the duration of the run or of the window.",
        "## Measures",
        table(("measure", "definition", "unit", "needs x_ref"), rows),
        "## Shown where nobody has chosen others",
        table(("metric", "definition"), standard),
    ])  # fmt: skip
