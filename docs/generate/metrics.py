"""The table of metrics, from the library that computes them."""

from __future__ import annotations

from yawbench.metrics import expressions
from yawbench.metrics.measures import catalogue

from .text import NOTE, cell, code, docstring, table


def page() -> str:
    """Return the page of all measures and of the metrics that are shown unasked."""
    rows = [
        (code(one.name), f"{cell(one.definition)}<br>{code(one.formula)}", cell(one.unit), cell(one.needs))
        for one in catalogue()
    ]
    standard = []
    for name in expressions.STANDARD:
        metric = expressions.metric(name)
        standard.append((code(name), f"{cell(metric.definition)}<br>{code(metric.formula)}"))
    return "\n\n".join([
        "# Metrics",
        NOTE,
        docstring(expressions.__doc__ or ""),
        "x is the signal, x_ref its reference, T the duration of the run or of the window. A signal's rate "
        "is the recorded one, `x_rate`, else the difference quotient. Metrics that cannot be computed are "
        "omitted: an error relative to a reference of zero, a window beyond the end of the run.",
        "In files the window can also be given by the key `window`, as `[1, 3]` or `1 s to 3 s`.",
        "## Measures",
        table(("measure", "definition", "unit", "also needs"), rows),
        "## Default metrics",
        table(("metric", "definition"), standard),
    ])  # fmt: skip
