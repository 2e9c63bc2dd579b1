"""Runs as a recording of Rerun: cars in space, all signals, events, a layout that shows how the runs differ.

    /road                     lanes, cones, ground, paths
    /cars/LABEL               a car: its body, wheels and arrows, in frames that move
    /plots/SIGNAL/LABEL       the signals of the papers, in displayed units, those of all runs in one plot
    /signals/LABEL/...        every recorded signal, its unit in its name
    /events, /answer          what happened when; how the runs ended and why

Nothing listens to a network: the recording is a file.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from yawbench.events.why import sentence
from yawbench.figures.display import LabelledRun, shown_unit, unit_of_signal
from yawbench.foundation.safe_files import write_whole
from yawbench.metrics.expressions import columns_of
from yawbench.metrics.measures import words
from yawbench.reports.viewer import answer_of
from yawbench.reports.viewer_views import PANELS
from yawbench.scene.scene import FRAMES, Scene, samples
from yawbench.vocabulary.wheels import WHEELS

from . import shapes
from .formats import ExportedRun
from .shapes import Box, Colour

GHOST = 110
"""Opacity of the runs after the first, of 255."""
TIME = "time"


def write(runs: Sequence[ExportedRun], file: Path) -> list[Path]:
    """Write a recording."""
    with tempfile.TemporaryDirectory(prefix="yawbench-") as folder:
        recorded = Path(folder) / "runs.rrd"
        _record(runs, recorded)
        write_whole(file, recorded.read_bytes(), named=True)
    return []


def _record(runs: Sequence[ExportedRun], file: Path) -> None:
    import rerun as rr

    recording = rr.RecordingStream("yawbench", recording_id="-".join(run.label for run in runs))
    first = next((run.label for run in runs if run.scene is not None), None)
    recording.save(file, default_blueprint=_layout(runs, first))
    scenes = [(number, run.label, run.scene) for number, run in enumerate(runs) if run.scene is not None]
    if scenes:
        recording.log("/", rr.ViewCoordinates.FLU, static=True)
        _road(recording, [scene for _, _, scene in scenes])
    for number, label, scene in scenes:
        _car(recording, f"cars/{_part(label)}", scene, shapes.colour_of(number), GHOST if number else 255)
    for number, run in enumerate(runs):
        _signals(recording, run, shapes.colour_of(number))
        for event in run.events:
            recording.set_time(TIME, duration=event.time)
            recording.log(f"events/{_part(run.label)}", rr.TextLog(sentence(event), level="WARN"))
        recording.reset_time()
    answer = rr.TextDocument(_answer(runs), media_type="text/markdown")
    recording.log("answer", answer, static=True)
    recording.flush()
    del recording  # which closes its file


def _part(label: str) -> str:
    """Return a label as a part of a path of Rerun."""
    return "".join(one if one.isalnum() or one in "-_." else "_" for one in label)


def _rgb(colour: Sequence[float], alpha: int = 255) -> tuple[int, ...]:
    return (*(round(255 * part) for part in colour), alpha)


def _times(time: np.ndarray) -> list[Any]:
    import rerun as rr

    return [rr.TimeColumn(TIME, duration=time)]


def _boxes(boxes: Sequence[Box], colour: tuple[int, ...]) -> Any:
    import rerun as rr

    return rr.Boxes3D(
        centers=[box.centre for box in boxes],
        half_sizes=[[0.5 * side for side in box.size] for box in boxes],
        colors=[colour],
        fill_mode="solid",
    )


def _road(recording: Any, scenes: Sequence[Scene]) -> None:
    import rerun as rr

    places = scenes[0].places
    for level, piece in enumerate(places.ground):
        mesh = rr.Mesh3D(
            vertex_positions=shapes.triangles(piece.corners, 0.001 * level - 0.05),
            albedo_factor=_rgb(shapes.ground_colour(piece.friction)),
        )
        recording.log(f"road/ground/{level}_friction_{piece.friction:g}", mesh, static=True)
    if places.lanes:
        lanes = _boxes([*map(shapes.box_of, places.lanes)], _rgb(shapes.LANE))
        recording.log("road/lanes", lanes, static=True)
        radius, height = shapes.CONE_SIZE
        cones = rr.Cylinders3D(
            centers=[(x, y, 0.5 * height) for x, y in places.cones],
            lengths=[height] * len(places.cones),
            radii=[0.6 * radius] * len(places.cones),
            colors=[_rgb(shapes.CONE)],
            fill_mode="solid",
        )
        recording.log("road/cones", cones, static=True)
    for number, scene in enumerate(scenes):
        if scene.path is not None:
            strip = shapes.strip_of(scene, scene.path, 0.02)
            line = rr.LineStrips3D([strip], colors=[(128, 128, 128)], radii=[0.03])
            recording.log(f"road/plan/{number}", line, static=True)


def _car(recording: Any, base: str, scene: Scene, colour: Colour, alpha: int) -> None:
    import rerun as rr

    rows = samples(scene.time, FRAMES)
    at, label = _times(scene.time[rows]), base.rpartition("/")[2]

    def moving(path: str, columns: Any) -> None:
        recording.send_columns(path, at, columns)

    for frame in shapes.frames_of(label, scene, rows, ""):
        columns = rr.Transform3D.columns(translation=frame.place, quaternion=frame.turn)
        moving(f"cars/{frame.name}", columns)
    recording.log(f"{base}/body", _boxes(shapes.boxes_of(scene.car), _rgb(colour, alpha)), static=True)
    for wheel in WHEELS:
        tyre = rr.Cylinders3D(
            lengths=[shapes.TYRE_WIDTH],
            radii=[scene.car.radius],
            quaternions=[rr.Quaternion(xyzw=shapes.SIDEWAYS)],
            colors=[_rgb(shapes.TYRE, alpha)],
            fill_mode="solid",
        )
        recording.log(f"{base}/wheel_{wheel}/tyre", tyre, static=True)
    for kind in shapes.arrows_of(scene, rows, colour):
        count = kind.origins.shape[1]
        tints = (255 * kind.colours).round().astype(np.uint32).reshape(-1, 3)
        packed = tints[:, 0] << 24 | tints[:, 1] << 16 | tints[:, 2] << 8 | 255
        columns = rr.Arrows3D.columns(
            vectors=kind.vectors.reshape(-1, 3), origins=kind.origins.reshape(-1, 3), colors=packed
        )
        moving(f"{base}/{kind.kind}", columns.partition([count] * len(rows)))
        thick = rr.Arrows3D.from_fields(radii=[0.5 * kind.thick])
        recording.log(f"{base}/{kind.kind}", thick, static=True)
    if np.isfinite(scene.grip).all():
        columns = rr.Cylinders3D.columns(
            radii=(scene.grip[rows] * shapes.PER_NEWTON).reshape(-1),
            lengths=np.full(4 * len(rows), 0.01),
            centers=scene.contacts[rows].reshape(-1, 3),
        )
        moving(f"{base}/grip", columns.partition([4] * len(rows)))
        looks = rr.Cylinders3D.from_fields(colors=[_rgb(colour, 60)], fill_mode="solid")
        recording.log(f"{base}/grip", looks, static=True)
    if scene.yaw_moment.any():
        arcs = [shapes.arc_of(float(scene.yaw_moment[row]), scene.car.height + 0.1) for row in rows]
        moving(f"{base}/yaw_moment", rr.LineStrips3D.columns(strips=arcs))
        grey = rr.LineStrips3D.from_fields(colors=[(90, 90, 90)], radii=[0.05])
        recording.log(f"{base}/yaw_moment", grey, static=True)
    strip = shapes.strip_of(scene, scene.position, 0.03)
    line = rr.LineStrips3D([strip], colors=[_rgb(colour)], radii=[0.04])
    recording.log(f"road/path/{label}", line, static=True)


def _signals(recording: Any, run: ExportedRun, colour: Colour) -> None:
    import rerun as rr

    at, label = _times(run.results.time), _part(run.label)
    for column, values in run.signals.items():
        path = f"signals/{label}/{column.replace('.', '/')}"
        recording.send_columns(path, at, rr.Scalars.columns(scalars=values))
        named = rr.SeriesLines(names=[f"{column} [{run.unit_of(column) or '1'}]"])
        recording.log(path, named, static=True)
    for signal in PANELS:
        for column in columns_of(run.results, signal)[:1]:
            factor = shown_unit(unit_of_signal(run.unit_of(column)))[1]
            path = f"plots/{signal}/{label}"
            recording.send_columns(path, at, rr.Scalars.columns(scalars=factor * run.signals[column]))
            looks = rr.SeriesLines(colors=[_rgb(colour)], names=[run.label], widths=[2])
            recording.log(path, looks, static=True)


def _answer(runs: Sequence[ExportedRun]) -> str:
    """Return how the runs ended and why cars were lost, in Markdown."""
    lines = [answer_of([LabelledRun(run.label, run.results) for run in runs])]
    for run in runs:
        lines.append(f"### {run.label}\n{run.title}")
        lines += [f"- {reason}" for reason in run.reasons]
    return "\n\n".join(filter(None, lines)) + "\n"


def _layout(runs: Sequence[ExportedRun], first: str | None) -> Any:
    """Return the layout: the cars followed from behind, the answer and the events, plots beside them."""
    import rerun.blueprint as rrb

    plots = []
    for signal in PANELS:
        units = [run.unit_of(column) for run in runs for column in columns_of(run.results, signal)[:1]]
        if units:
            unit = shown_unit(unit_of_signal(units[0]))[0]
            name = f"{words(signal)} [{unit or '1'}]"
            plots.append(rrb.TimeSeriesView(origin=f"plots/{signal}", name=name))
    told = rrb.Horizontal(
        rrb.TextDocumentView(origin="answer", name="answer"), rrb.TextLogView(origin="events", name="events")
    )
    columns: list[Any] = [rrb.Vertical(*plots)] if plots else []
    if first is not None:
        follow = rrb.EyeControls3D(
            position=(-8.0, -4.0, 4.5),
            look_target=(1.0, 0.0, 0.5),
            tracking_entity=f"cars/{_part(first)}/body",
        )
        space = rrb.Spatial3DView(
            origin="/",
            contents=["cars/**", "road/**"],
            name="cars",
            eye_controls=follow,
            background=_rgb(shapes.ASPHALT)[:3],
        )
        columns.insert(0, rrb.Vertical(space, told, row_shares=[3, 1]))
    else:
        columns.append(told)
    return rrb.Blueprint(
        rrb.Horizontal(*columns, column_shares=[3, 2] if len(columns) == 2 else None),
        rrb.TimePanel(state="collapsed", timeline=TIME),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
    )
