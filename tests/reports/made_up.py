"""A made-up run with all that an animation can show, and a scenario that runs in a moment."""

from __future__ import annotations

import base64
import gzip
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from tests.orchestrator.recorded import car, noted, results
from yawbench.orchestrator.results.reader import Results
from yawbench.reports.page_parts import static
from yawbench.reports.viewer import assets
from yawbench.vocabulary.wheels import WHEELS

HALF_A_CAR = """
title: Half a car
stop_time: 1
step_size: 0.01
inputs: {velocity_x: 20, friction: 0.7}
units:
  driver: {fmu: driver_sine, parameters: {frequency: 1, start_time: 0}}
  reference: {fmu: reference_single_track}
"""
SIZES = {"cg_to_front_axle": 1.2, "cg_to_rear_axle": 1.5, "track_width": 1.6}
MU = 0.5


def whole_car(gain: float = 1.0, *, n: int = 801) -> Results:
    """Return a made-up run with all that an animation can show."""
    made = car(gain, n=n)
    columns = dict(made.columns)
    steer = columns["driver.steer_angle"]
    for wheel in WHEELS:
        share = (1.1 if wheel[0] == "f" else 0.9) * (1.2 if wheel[1] == "l" else 0.8)
        columns[f"plant.vertical_load_{wheel}"] = 3000.0 * share * np.ones(n)
        columns[f"tyre.tyre_force_x_{wheel}"] = 200.0 * share * np.ones(n)
        columns[f"tyre.tyre_force_y_{wheel}"] = 20000.0 * share * steer
    recorded = results(columns, made.time)
    fmus = {
        "plant": {"name": "plant_made_up", "parameters": SIZES, "constants": {}},
        "tyre": {"name": "tyre_made_up", "constants": {f"friction_{w}": MU for w in WHEELS}},
    }
    return noted(recorded, fmus=fmus)


def without(recorded: Results, *parts: str) -> Results:
    """Return the run without the columns whose names contain one of the parts."""
    kept = {k: v for k, v in recorded.columns.items() if not any(part in k for part in parts)}
    return replace(recorded, columns=kept)


def head_of(title: str, *names: str) -> str:
    """Return the head of a page that a test writes by hand, with what viewers share and further assets."""
    shared = assets(*names)
    return (
        f'<!DOCTYPE html><html lang="en"><meta charset="utf-8"><link rel="icon" href="data:,">'
        f"<title>{title}</title><style>{shared.style}</style>"
        f"<script>{static('page.js')}</script><script>{shared.script}</script>"
    )


def unpacked(page: Path | str) -> str:
    """Return a page as a browser has it once its script has filled what was packed."""
    html = page if isinstance(page, str) else page.read_text(encoding="utf-8")

    def filled(place: re.Match[str]) -> str:
        text = gzip.decompress(base64.b64decode(place["text"])).decode()
        return f">{text}" if place["image"] is None else f' src="data:image/svg+xml,{quote(text)}"'

    return re.sub(r'((?P<image>(?<=<img))|) data-packed="(?P<text>[^"]*)"(?(image)|>)', filled, html)


def texts(tree: Any, path: str) -> list[str]:
    """Return what stands at a path of a page, as a reader sees it."""
    return [" ".join(element.text_content().split()) for element in tree.cssselect(path)]


def data_in(html: str) -> dict[str, Any]:
    """Return what a page carries."""
    html = unpacked(html)
    found = re.search(r'<script type="application/json">(.*?)</script>', html, re.DOTALL)
    assert found
    return json.loads(found[1])
