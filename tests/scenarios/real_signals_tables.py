"""Tables of the docs that come from studies of real signals, in Markdown, from their `experiment.json`."""

from __future__ import annotations

import re
from typing import Any

from yawbench.figures.display import shown

LATENCIES = (0, 5, 10, 20)
CONTROLLERS = {
    "learning_true": "network that learns",
    "learning_false": "network with frozen weights",
    "conventional": "conventional fuzzy",
}

MET = {"holds": "met", "does not hold": "not met", "undecided": "within noise"}
"""Verdict of a check -> what the docs call it: there are no open values to decide it over."""


def kept(study: dict[str, Any]) -> list[str]:
    """Return a row per check of the closed loop: the bound, what was measured, whether it is met."""
    rows = []
    for check in study["checks"]:
        measured = re.findall(r"[\d.]+ (?:°/s|°|%)", check["measured"][0])
        rows.append(f"| {check['says']} | {' to '.join(measured)} | {MET[check['verdict']]} |")
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


STEPS = {
    "exact": "exact",
    "late": "sampled and late",
    "noise": "noise",
    "sideslip": "estimated sideslip",
    "friction": "estimated friction",
    "biases": "biases",
}
CASES = ("A/learning", "A/frozen", "A/conventional", "B", "C", "D")


def step_by_step(study: dict[str, Any]) -> list[str]:
    """Return a row per step: the share of its gain that every controller keeps."""
    numbers = study["derived"]
    return [
        f"| {says} | {' | '.join(_shown(numbers[f'kept/{case}/{step}'], '%') for case in CASES)} |"
        for step, says in STEPS.items()
    ]


def _shown(found: dict[str, Any], unit: str) -> str:
    return shown(found["value"], unit, half=found.get("half", 0.0), between=found.get("between"))
