"""Runs seen from above, as a part of a page or a page of its own, with no server.

    {{ assets() }}              once a page: style and script
    {{ fragment(runs) }}        as often as there are animations

What is drawn is what was recorded, thinned; between two moments kept the browser interpolates.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import asdict
from importlib.resources import files
from typing import Any

import numpy as np
from markupsafe import Markup

from vocabulary.wheels import WHEELS

from ..errors import ResultsError
from ..figures.display import shown_unit
from ..figures.style import LINES, line_style
from ..results.read import Results
from ..wording import listed
from .animation_frames import Frames, frames_of
from .rendering import render

SCRIPTS = ("frames", "draw", "scene", "close_up", "strip", "player")
READOUTS = (
    ("speed", "Speed", "m/s", 1),
    ("sideslip", "Sideslip angle", "rad", 2),
    ("yaw_rate", "Yaw rate", "rad/s", 1),
    ("steer_angle", "Steer angle", "rad", 2),
    ("yaw_moment", "Yaw moment", "N.m", 0),
    ("cone_overrun", "Beyond the cones", "m", 2),
)
"""Channel, words, SI unit, decimals shown."""
STRIP = ("sideslip", "yaw_rate", "steer_angle")
"""What the curve above the slider may show: the first that was recorded."""
NAMED = 6
"""Frictions of the ground that are named one by one; of more, the least and the largest."""
MOST = len(LINES)
"""Runs in one animation: as many as there are colours."""

Runs = Sequence[tuple[str, Results]]


def fragment(runs: Runs, *, title: str = "") -> Markup:
    """Return the animation of up to seven runs (label, results) as a part of a page; it waits to be played.

    Raises:
        ResultsError: a run's position or yaw angle was not recorded.
    """
    return Markup(render("animation.html.j2", **_facts(runs, title)))


def assets() -> Markup:
    """Return the style and the script that all animations of a page share."""
    static = files(__package__) / "static"
    style = (static / "animation.css").read_text(encoding="utf-8")
    parts = [(static / f"animation_{part}.js").read_text(encoding="utf-8") for part in SCRIPTS]
    script = "\n".join(parts)
    return Markup(f"<style>\n{style}</style>\n<script>\n(() => {{\n'use strict';\n{script}}})();\n</script>")


def page(runs: Runs, *, title: str = "", below: str = "", changed: str = "") -> str:
    """Return a page of its own; it plays by itself unless the reader has asked for less motion.

    Args:
        runs: up to seven (label, results).
        title: of the page; default: the labels.
        below: a line under the title.
        changed: what was changed against the scenario that the title names.

    Raises:
        ResultsError: a run's position or yaw angle was not recorded.
    """
    facts = _facts(runs, title, alone=True)
    return render("animation_page.html.j2", assets=assets(), below=below, changed=changed, **facts)


def _facts(runs: Runs, title: str, *, alone: bool = False) -> dict[str, Any]:
    if not 1 <= len(runs) <= MOST:
        raise ResultsError(f"an animation shows one to {MOST} runs, not {len(runs)}.")
    shown = [(label, frames_of(results)) for label, results in runs]
    data = {"alone": alone, **data_of(shown)}
    names = " and ".join(label for label, _ in shown)
    return {"title": title or names, "data": data, "key": _key([frames for _, frames in shown])}


def _key(runs: Sequence[Frames]) -> str:
    """Return what the signs of the drawing mean, those that are drawn."""
    drawn = {name for frames in runs for name in frames.channels}
    signs = (
        ("path_y", "grey dashes: the path the driver follows"),
        ("grip_fl", "circles: friction times load"),
        ("force_x_fl", "black arrows: tyre forces" + (", in % of it" if "grip_fl" in drawn else "")),
        ("sideslip", "arrow from the centre of mass: where it moves"),
        ("yaw_moment", "grey arc: yaw moment asked for"),
    )
    said = [sign for name, sign in signs if name in drawn]
    frictions = sorted({piece.friction for frames in runs for piece in frames.ground})
    if frictions:
        told = [f"{mu:g}" for mu in frictions]
        values = listed(told) if len(told) <= NAMED else f"{told[0]} to {told[-1]}"
        said.append(f"ground: the bluer the slipperier, friction {values}")
    key = "; ".join(said)
    return f"{key[:1].upper()}{key[1:]}." if key else ""


def data_of(runs: Sequence[tuple[str, Frames]]) -> dict[str, Any]:
    """Return what the script draws: see `animation_frames.js` for how it is read."""
    every = [frames for _, frames in runs]
    end = max(frames.channels["time"][-1] for frames in every)
    return {
        "runs": [_run(number, *run, end, every[:number]) for number, run in enumerate(runs)],
        "still": still_of(every),
        "metres_per_newton": force_scale(every),
        "readouts": [
            {"channel": channel, "label": label, "decimals": decimals}
            | dict(zip(("unit", "factor"), shown_unit(unit), strict=True))
            for channel, label, unit, decimals in READOUTS
            if any(channel in frames.channels for frames in every)
        ],
        "strip": next((name for name in STRIP if any(name in f.channels for f in every)), None),
    }


def _run(number: int, label: str, frames: Frames, end: float, before: Sequence[Frames]) -> dict[str, Any]:
    """Return one run, with its ground unless one `before` has the same; `end` [s] is that of the longest."""
    ground = () if frames.ground in [other.ground for other in before] else frames.ground
    last = frames.channels["time"][-1]
    early = [f"this run ends at {last:.2f} s"] if last < end - 1e-6 and not frames.failed else []
    style = line_style(number)
    dash = style["linestyle"][1] if isinstance(style["linestyle"], tuple) else ()
    return {
        "label": label,
        "colour": style["color"],
        "dash": list(dash),
        "car": asdict(frames.car),
        "lanes": [list(lane) for lane in frames.lanes],
        "ground": [[piece.friction, piece.corners] for piece in ground],
        "notes": [*frames.notes, *early],
        "channels": {name: packed(values) for name, values in frames.channels.items()},
    }


def packed(values: np.ndarray) -> str:
    """Return an array as base64 of little-endian 32-bit floats."""
    return base64.b64encode(np.ascontiguousarray(values, "<f4").tobytes()).decode("ascii")


def still_of(runs: Sequence[Frames]) -> float:
    """Return the moment [s] that tells most when nothing moves: that of the largest sideslip angle.

    Without sideslip, that of the largest yaw rate; without both, the middle.
    """
    for name in STRIP[:2]:
        peaks = []
        for frames in runs:
            size = np.nan_to_num(np.abs(frames.channels.get(name, np.zeros(1))), posinf=0.0)
            peaks.append((size.max(), -frames.channels["time"][np.argmax(size)]))
        largest, before = max(peaks)
        if largest > 0:
            return float(-before)
    time = runs[0].channels["time"]
    return float(0.5 * (time[0] + time[-1]))


def force_scale(runs: Sequence[Frames]) -> float:
    """Return the length [m/N] that forces are drawn at, one for all wheels and runs.

    Friction circles of an axle never overlap; without circles, no arrow is longer than half the track.
    """
    largest = 0.0
    for frames in runs:
        known, track = frames.channels, frames.car.track
        if "grip_fl" in known:
            forces = [
                known[f"grip_{left}"] + known[f"grip_{right}"] for left, right in (WHEELS[:2], WHEELS[2:])
            ]
            room = 0.96 * track
        else:
            wheels = WHEELS if "force_x_fl" in known else ()
            forces = [np.hypot(known[f"force_x_{wheel}"], known[f"force_y_{wheel}"]) for wheel in wheels]
            room = 0.5 * track
        largest = max(
            largest, *(np.max(one, initial=0.0, where=np.isfinite(one)) / room for one in forces), 0.0
        )
    return float(1 / largest) if largest > 0 else 0.0
