"""Animations of runs seen from above, as part of a page or as a page, without a server.

    {{ assets() }}              once per page: style and script
    {{ fragment(runs) }}        once per animation

An animation shows recorded data: the car's motion and forces at up to 600 recorded instants, between which
the browser interpolates.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.resources import files
from typing import Any

import numpy as np
from markupsafe import Markup

from vocabulary.lane_change import Lane, lanes_of
from vocabulary.wheels import WHEELS

from ..errors import ResultsError
from ..figures.style import LINES, line_style, shown_unit
from ..messages import listed
from ..metrics.run_metrics import columns_of
from ..results.read import Results
from .friction_map import FrictionPatch, ground_of
from .rendering import render

STANDS = 0.5
"""Speed below which a car counts as standing, with undefined sideslip [m/s]; chosen: below walking pace."""
FRAMES = 600
"""Largest number of frames of a run; chosen: 75 per second of an 8 s manoeuvre, above a screen's rate."""
OVERHANG_FRONT, OVERHANG_REAR = 0.85, 1.0
"""Overhangs beyond the axles [m], if the driver has no dimensions of the car; chosen: a saloon."""
BESIDE = 0.2
"""Width of the body minus track width [m]; chosen: a tyre's width."""
USUAL = {"cg_to_front_axle": 1.3, "cg_to_rear_axle": 1.4, "track_width": 1.55}
"""Dimensions for a plant that has none [m]; chosen: a mid-size car."""

POSE = ("position_x", "position_y", "yaw_angle")
ROUNDABOUT = ("velocity_x", "velocity_y", "path_offset")
"""Signals used only to compute others."""
SIGNALS = ("sideslip", "yaw_rate", "steer_angle", "yaw_moment", "cone_overrun", *ROUNDABOUT)


@dataclass(frozen=True)
class CarOutline:
    """A car seen from above: its axles and ends from the centre of mass, its widths [m]."""

    front_axle: float
    rear_axle: float
    track: float
    front_end: float
    rear_end: float
    width: float


@dataclass(frozen=True)
class Frames:
    """The data of a run at the instants of an animation.

    `channels` are SI arrays of one length: time, x, y, yaw, and as recorded speed, sideslip, yaw_rate,
    steer_angle, yaw_moment, cone_overrun, path_y (the path the driver follows, at x), and per wheel
    `force_x_fl` .. `force_y_rr` (vehicle axes) and `grip_fl` .. `grip_rr` (friction times load).
    """

    car: CarOutline
    channels: dict[str, np.ndarray]
    lanes: tuple[Lane, ...]
    ground: tuple[FrictionPatch, ...]
    notes: tuple[str, ...]  # on what could not be drawn
    failed: bool = False


def frames_of(results: Results) -> Frames:
    """Return the frames of a run; those of a failed run end where its position ceases to be finite.

    Raises:
        ResultsError: the position or the yaw angle was not recorded, or never finite.
    """
    time, (x, y, yaw) = _pose(results)
    kept = thinned(time)
    time, x, y, yaw = time[kept], x[kept], y[kept], yaw[kept]
    channels = {"time": time, "x": x, "y": y, "yaw": yaw}
    others = {name: values[kept] for name in SIGNALS if (values := _signal(results, name)) is not None}
    if (along := others.get("velocity_x")) is not None:
        channels["speed"] = np.hypot(along, others["velocity_y"]) if "velocity_y" in others else along
        if "sideslip" in others:
            stands = np.abs(channels["speed"]) < STANDS
            others["sideslip"] = np.where(stands, math.nan, others["sideslip"])
    if "path_offset" in others:
        channels["path_y"] = y - others["path_offset"]
    channels |= {name: values for name, values in others.items() if name not in ROUNDABOUT}
    forces = _forces(results, kept, others.get("steer_angle", np.zeros(kept.size)))
    grip = _grip(results, kept)
    notes = []
    if not forces:
        notes.append("tyre forces were not recorded")
    elif "steer_angle" not in others:
        notes.append("the steer angle was not recorded: the front wheels are drawn straight")
    if forces and not grip:
        notes.append("friction or vertical loads were not recorded: no friction circles")
    car, known = _car(results)
    if not known:
        notes.append("the plant tells no sizes: a mid-size car is drawn")
    if failed := results.record.status not in ("", "completed"):
        notes.append(f"the run did not end as planned; shown until {time[-1]:.2f} s")
    elif results.ended:
        notes.append(results.ended)
    lanes = next(filter(None, map(lanes_of, _parameters(results, "driver"))), [])
    ranges = [(float(values.min()), float(values.max())) for values in (x, y)]
    grounds = (ground_of(road, *ranges) for road in _parameters(results, "road"))
    ground = next(filter(None, grounds), [])
    return Frames(car, channels | forces | grip, tuple(lanes), tuple(ground), tuple(notes), failed)


def thinned(time: np.ndarray, most: int = FRAMES) -> np.ndarray:
    """Return at most `most` (at least 2) row indices, evenly spaced in time, first and last row included."""
    if time.size <= most:
        return np.arange(time.size)
    wanted = np.linspace(time[0], time[-1], most)
    after = np.clip(np.searchsorted(time, wanted), 1, time.size - 1)
    nearest = after - (wanted - time[after - 1] < time[after] - wanted)
    nearest[0], nearest[-1] = 0, time.size - 1
    return np.unique(nearest)


def rotated(along: np.ndarray, across: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotate a vector by `angle` [rad]: from axes turned by that angle to the original axes."""
    c, s = np.cos(angle), np.sin(angle)
    return along * c - across * s, along * s + across * c


def _pose(results: Results) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return time, and x, y, yaw from the start until one of them is no longer finite."""
    pose = [_signal(results, name) for name in POSE]
    there = [values for values in pose if values is not None]
    if len(there) < len(pose):
        missing = [name for name, values in zip(POSE, pose, strict=True) if values is None]
        verb = "was" if len(missing) == 1 else "were"
        raise ResultsError(
            f"{results.file}: cannot be animated: {listed(missing)} {verb} not recorded; "
            f"a car seen from above needs {listed(POSE)}.",
            code="nothing-to-draw",
        )
    sound = np.all(np.isfinite([results.time, *there]), axis=0)
    rows = sound.size if sound.all() else int(np.argmin(sound))
    if rows == 0:
        raise ResultsError(
            f"{results.file}: cannot be animated: no moment with a position was recorded.",
            code="nothing-to-draw",
        )
    x, y, yaw = (values[:rows] for values in there)
    return results.time[:rows], [x, y, np.unwrap(yaw)]


def _signal(results: Results, name: str) -> np.ndarray | None:
    columns = columns_of(results, name)
    return results.columns[columns[0]] if columns else None


def _forces(results: Results, kept: np.ndarray, steer: np.ndarray) -> dict[str, np.ndarray]:
    """Return the tyre forces in vehicle axes [N]."""
    along, across = columns_of(results, "tyre_force_x_*"), columns_of(results, "tyre_force_y_*")
    if not along or not across:
        return {}
    forces = {}
    for wheel, x, y in zip(WHEELS, along, across, strict=True):
        angle = steer if wheel.startswith("f") else np.zeros(kept.size)
        pair = rotated(results.columns[x][kept], results.columns[y][kept], angle)
        forces[f"force_x_{wheel}"], forces[f"force_y_{wheel}"] = pair
    return forces


def _grip(results: Results, kept: np.ndarray) -> dict[str, np.ndarray]:
    """Return friction times load of every wheel [N], the radius of its friction circle."""
    loads, forces = columns_of(results, "vertical_load_*"), columns_of(results, "tyre_force_x_*")
    if not loads or not forces:
        return {}
    grip = {}
    for wheel, load, force in zip(WHEELS, loads, forces, strict=True):
        friction = _friction(results, wheel, tyre=results.names[force].instance)
        if friction is None:
            return {}
        mu = np.broadcast_to(np.asarray(friction, float), results.time.shape)[kept]
        grip[f"grip_{wheel}"] = mu * np.maximum(results.columns[load][kept], 0.0)
    return grip


def _friction(results: Results, wheel: str, *, tyre: str) -> np.ndarray | float | None:
    """Return the friction at a wheel: as recorded by a road, or the constant input of the tyre."""
    if (recorded := _signal(results, f"friction_{wheel}")) is not None:
        return recorded
    fmu = results.record.fmus.get(tyre)
    constants = fmu.constants if fmu else {}
    friction = constants.get(f"friction_{wheel}", constants.get("friction"))
    return float(friction) if isinstance(friction, (int, float)) else None


def _parameters(results: Results, role: str) -> Iterator[Mapping[str, Any]]:
    """Yield the parameters of the instances with a role."""
    for unit in results.units_of_role(role):
        fmu = results.record.fmus[unit]
        yield {**fmu.defaults, **fmu.parameters}


def _car(results: Results) -> tuple[CarOutline, bool]:
    """Return the car's outline, and whether the plant has any of its dimensions."""
    told: dict[str, float] = {}
    for known in _parameters(results, "plant"):
        told |= {
            name: float(value)
            for name, value in known.items()
            if name in USUAL and isinstance(value, (int, float)) and math.isfinite(value) and value > 0
        }
    front, rear, track = (told.get(name, usual) for name, usual in USUAL.items())
    ends = {"front": front + OVERHANG_FRONT, "rear": rear + OVERHANG_REAR, "width": track + BESIDE}
    for known in _parameters(results, "driver"):  # the cones are judged with the driver's dimensions
        if lanes_of(known):
            ends["width"] = float(known["vehicle_width"])
            ends["front"] = float(known.get("cg_to_front_end", ends["front"]))
            ends["rear"] = float(known.get("cg_to_rear_end", ends["rear"]))
    return CarOutline(front, rear, track, ends["front"], ends["rear"], ends["width"]), bool(told)


SCRIPTS = ("frames", "draw", "scene", "close_up", "strip", "player")
READOUTS = (
    ("speed", "Speed", "m/s", 1),
    ("sideslip", "Sideslip angle", "rad", 2),
    ("yaw_rate", "Yaw rate", "rad/s", 1),
    ("steer_angle", "Steer angle", "rad", 2),
    ("yaw_moment", "Yaw moment", "N.m", 0),
    ("cone_overrun", "Beyond the cones", "m", 2),
)
"""Channel, label, SI unit, decimals shown."""
STRIP = ("sideslip", "yaw_rate", "steer_angle")
"""Channels for the curve above the slider: the first that was recorded is shown."""
NAMED = 6
"""Number of ground frictions listed in the legend; if there are more, only the range is given."""
MOST = len(LINES)
"""Runs in one animation: as many as there are colours."""

NamedRuns = Sequence[tuple[str, Results]]


def fragment(runs: NamedRuns, *, title: str = "") -> Markup:
    """Return the animation of up to seven runs (label, results) as part of a page; it starts when played.

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


def page(runs: NamedRuns, *, title: str = "", below: str = "", changed: str = "") -> str:
    """Return an animation as a page; it starts by itself unless the reader prefers reduced motion.

    Args:
        runs: up to seven (label, results).
        title: of the page; default: the labels.
        below: a line under the title.
        changed: overrides of the scenario that the title names.

    Raises:
        ResultsError: a run's position or yaw angle was not recorded.
    """
    facts = _facts(runs, title, alone=True)
    return render("animation_page.html.j2", assets=assets(), below=below, changed=changed, **facts)


def _facts(runs: NamedRuns, title: str, *, alone: bool = False) -> dict[str, Any]:
    if not 1 <= len(runs) <= MOST:
        raise ResultsError(f"an animation shows one to {MOST} runs, not {len(runs)}.", code="nothing-to-draw")
    shown = [(label, frames_of(results)) for label, results in runs]
    data = {"alone": alone, **data_of(shown)}
    names = " and ".join(label for label, _ in shown)
    return {"title": title or names, "data": data, "key": _key([frames for _, frames in shown])}


def _key(runs: Sequence[Frames]) -> str:
    """Return the legend of the symbols that are drawn."""
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
    """Return the data for the script; see `animation_frames.js` for its format."""
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
    """Return the data of one run; its ground only if none of `before` has the same.

    `end` [s] is that of the longest run.
    """
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
    """Return the instant [s] shown while nothing moves: that of the largest sideslip angle.

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
    """Return the length per force [m/N] for drawing, the same for all wheels and runs.

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
