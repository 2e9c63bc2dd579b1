"""The tables of docs/estimators.md that come from studies, in Markdown, from their `experiment.json`."""

from __future__ import annotations

import re
from typing import Any

LATENCIES = (0, 5, 10, 20)
CONTROLLERS = {
    "learning_true": "network that learns",
    "learning_false": "network with frozen weights",
    "conventional": "conventional fuzzy",
}


def kept(study: dict[str, Any]) -> list[str]:
    """Return a row per check of the closed loop: what is asked, what was measured, the verdict."""
    rows = []
    for check in study["checks"]:
        measured = re.findall(r"[\d.]+ (?:°/s|°|%)", check["measured"][0])
        rows.append(f"| {check['says']} | {' to '.join(measured)} | {check['verdict']} |")
    return rows


def late(study: dict[str, Any]) -> list[str]:
    """Return a row per speed and controller of paper A: largest error at each latency."""
    rows = []
    for speed in (15, 25, 40):
        for name, says in CONTROLLERS.items():
            errors = [
                study["runs"][f"{speed}mps/{ms}ms/{name}"]["metrics"]["error"]["value"] for ms in LATENCIES
            ]
            cells = " | ".join(f"{100 * error:.3g} %" for error in errors)
            rows.append(f"| {speed} m/s, {says} | {cells} |")
    return rows
