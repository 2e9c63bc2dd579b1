"""Runs as MCAP for Foxglove and others: protobuf messages, with Foxglove's schemas where there is one.

    /tf, /scene               foxglove.FrameTransforms and SceneUpdate: cars, forces, lanes, cones, ground
    /events                   foxglove.Log: what happened to which run
    /LABEL/INSTANCE           the signals of an instance, a field each; units in the metadata of the channel

The layout is beside it, as Foxglove imports it: FILE.layout.json.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import to_hex

from yawbench.events.why import sentence
from yawbench.foundation.safe_files import write_whole
from yawbench.metrics.expressions import columns_of
from yawbench.reports.viewer_views import PANELS
from yawbench.scene.scene import FRAMES, Scene, quaternions, samples
from yawbench.vocabulary.wheels import WHEELS

from . import shapes
from .formats import ExportedRun
from .shapes import Arrows, Box, Colour

WORLD = "road"
GHOST = 0.4
"""Opacity of the runs after the first."""


def write(runs: Sequence[ExportedRun], file: Path) -> list[Path]:
    """Write an MCAP file and its layout; return the layout's path."""
    from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
    from foxglove_schemas_protobuf.Log_pb2 import Log
    from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
    from mcap.writer import CompressionType, Writer
    from mcap_protobuf.schema import register_schema

    sink = io.BytesIO()
    writer: Any = Writer(sink, compression=CompressionType.ZSTD)
    writer.start(profile="", library="yawbench")
    writer.add_metadata("runs", {run.label: run.title for run in runs})
    scenes = [(number, run.label, run.scene) for number, run in enumerate(runs) if run.scene is not None]

    def channel(topic: str, message: Any) -> Any:
        schema = register_schema(writer, message)
        return partial(writer.add_message, writer.register_channel(topic, "protobuf", schema))

    messages: list[tuple[int, Any, bytes]] = []
    if scenes:
        to_tf, to_scene = channel("/tf", FrameTransforms), channel("/scene", SceneUpdate)
        still = SceneUpdate()
        _road(still, [scene for _, _, scene in scenes])
        begin = min(_nanoseconds(float(scene.time[0])) for _, _, scene in scenes)
        for number, label, scene in scenes:
            colour = shapes.colour_of(number)
            _car(still, label, scene, colour, GHOST if number else 1.0)
            for time, frames, moving in _moving(label, scene, colour):
                messages += [(time, to_tf, frames), (time, to_scene, moving)]
        messages.insert(0, (begin, to_scene, still.SerializeToString()))
    to_log = channel("/events", Log)
    for run in runs:
        for event in run.events:
            log = Log(level=Log.WARNING, name=run.label, message=sentence(event))
            _stamp(log.timestamp, event.time)
            messages.append((_nanoseconds(event.time), to_log, log.SerializeToString()))
        for topic, units, names, columns in _groups(run):
            _signals(writer, topic, units, names, run.results.time, columns, messages)
    messages.sort(key=lambda one: one[0])
    for time, send, data in messages:
        send(log_time=time, data=data, publish_time=time)
    writer.finish()
    write_whole(file, sink.getvalue(), named=True)
    layout = file.with_name(f"{file.name}.layout.json")
    write_whole(layout, json.dumps(_layout(runs, bool(scenes)), indent=1) + "\n")
    return [layout]


def _nanoseconds(time: float) -> int:
    return round(time * 1e9)


def _stamp(stamp: Any, time: float) -> None:
    stamp.FromNanoseconds(_nanoseconds(time))


# ---- signals ----

Group = tuple[str, dict[str, str], list[str], list[np.ndarray]]


def _groups(run: ExportedRun) -> Iterator[Group]:
    """Yield the signals of each instance: topic, unit of each field, fields, columns."""
    signals, instances = run.signals, dict[str, list[str]]()
    for column in signals:
        instances.setdefault(run.results.names[column].instance, []).append(column)
    for instance, columns in instances.items():
        fields = [_field(column.partition(".")[2]) for column in columns]
        units = {field: run.unit_of(column) or "1" for field, column in zip(fields, columns, strict=True)}
        yield f"/{run.label}/{instance}", units, fields, [signals[column] for column in columns]


def _field(variable: str) -> str:
    return "".join(one if one.isalnum() and one.isascii() else "_" for one in variable)


def _signals(
    writer: Any,
    topic: str,
    units: Mapping[str, str],
    fields: Sequence[str],
    time: np.ndarray,
    columns: Sequence[np.ndarray],
    messages: list[tuple[int, Any, bytes]],
) -> None:
    """Add a channel and its messages, a number per field.

    A message is the tag and the eight bytes of each field, which is how protobuf writes numbers of double
    precision, put together for all rows at once.
    """
    from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet

    name = "".join(part.capitalize() for part in _field(topic.rpartition("/")[2]).split("_"))
    described = FileDescriptorProto(name=f"yawbench{topic}.proto", package="yawbench", syntax="proto3")
    message = described.message_type.add(name=name)
    row: list[Any] = []
    tags = []
    for number, field in enumerate(fields, 1):
        kind, label = FieldDescriptorProto.TYPE_DOUBLE, FieldDescriptorProto.LABEL_OPTIONAL
        message.field.add(name=field, number=number, type=kind, label=label)
        tags.append(_varint(number << 3 | 1))
        row += [(f"tag {number}", np.void, len(tags[-1])), (f"value {number}", "<f8")]
    data = FileDescriptorSet(file=[described]).SerializeToString()
    schema = writer.register_schema(f"yawbench.{name}", "protobuf", data)
    channel = writer.register_channel(topic, "protobuf", schema, dict(units))
    table = np.zeros(time.size, np.dtype(row))
    for number, (tag, values) in enumerate(zip(tags, columns, strict=True), 1):
        table[f"tag {number}"] = np.void(tag)
        table[f"value {number}"] = values
    raw, size = table.tobytes(), table.dtype.itemsize
    send = partial(writer.add_message, channel)
    messages += [(_nanoseconds(float(t)), send, raw[k * size : (k + 1) * size]) for k, t in enumerate(time)]


def _varint(number: int) -> bytes:
    parts = []
    while number > 127:
        parts.append(number & 127 | 128)
        number >>= 7
    return bytes([*parts, number])


# ---- the scene ----


def _point(point: Any, place: Sequence[float]) -> None:
    point.x, point.y, point.z = map(float, place)


def _paint(colour: Any, rgb: Sequence[float], alpha: float = 1.0) -> None:
    colour.r, colour.g, colour.b, colour.a = (*map(float, rgb), alpha)


def _turn(quaternion: Any, turn: Sequence[float] | np.ndarray) -> None:
    quaternion.x, quaternion.y, quaternion.z, quaternion.w = map(float, turn)


def _line(entity: Any, points: np.ndarray, rgb: Sequence[float], thick: float, alpha: float = 1.0) -> None:
    line = entity.lines.add(thickness=thick)
    _turn(line.pose.orientation, (0, 0, 0, 1))
    _paint(line.color, rgb, alpha)
    for point in points:
        _point(line.points.add(), point)


def _box(entity: Any, box: Box, rgb: Colour, alpha: float = 1.0) -> None:
    cube = entity.cubes.add()
    _point(cube.pose.position, box.centre)
    _turn(cube.pose.orientation, (0, 0, 0, 1))
    _point(cube.size, box.size)
    _paint(cube.color, rgb, alpha)


def _road(update: Any, scenes: Sequence[Scene]) -> None:
    """Add lanes, cones and ground, those of several runs once."""
    places = scenes[0].places
    entity = update.entities.add(id="road", frame_id=WORLD, frame_locked=True)
    for level, piece in enumerate(places.ground):
        mesh = entity.triangles.add()
        _turn(mesh.pose.orientation, (0, 0, 0, 1))
        _paint(mesh.color, shapes.ground_colour(piece.friction))
        for point in shapes.triangles(piece.corners, 0.001 * level - 0.05):
            _point(mesh.points.add(), point)
    for lane in places.lanes:
        _box(entity, shapes.box_of(lane), shapes.LANE)
    for x, y in places.cones:
        cone = entity.cylinders.add(bottom_scale=1.0, top_scale=0.1)
        _point(cone.pose.position, (x, y, 0.5 * shapes.CONE_SIZE[1]))
        _turn(cone.pose.orientation, (0, 0, 0, 1))
        _point(cone.size, (2 * shapes.CONE_SIZE[0], 2 * shapes.CONE_SIZE[0], shapes.CONE_SIZE[1]))
        _paint(cone.color, shapes.CONE)
    for scene in scenes:
        if scene.path is not None:
            _line(entity, shapes.strip_of(scene, scene.path, 0.02), (0.5, 0.5, 0.5), 0.05)


def _car(update: Any, label: str, scene: Scene, colour: Colour, alpha: float) -> None:
    """Add the body, the wheels and the path of a car."""
    body = update.entities.add(id=f"{label} body", frame_id=f"{label}/body", frame_locked=True)
    for box in shapes.boxes_of(scene.car):
        _box(body, box, colour, alpha)
    for wheel in WHEELS:
        entity = update.entities.add(
            id=f"{label} {wheel}", frame_id=f"{label}/wheel_{wheel}", frame_locked=True
        )
        tyre = entity.cylinders.add(bottom_scale=1.0, top_scale=1.0)
        _turn(tyre.pose.orientation, shapes.SIDEWAYS)
        _point(tyre.size, (2 * scene.car.radius, 2 * scene.car.radius, shapes.TYRE_WIDTH))
        _paint(tyre.color, shapes.TYRE, alpha)
    entity = update.entities.add(id=f"{label} path", frame_id=WORLD, frame_locked=True)
    _line(entity, shapes.strip_of(scene, scene.position, 0.03), colour, 0.08)


def _moving(label: str, scene: Scene, colour: Colour) -> Iterator[tuple[int, bytes, bytes]]:
    """Yield time, frames and arrows of a car."""
    from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
    from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

    rows = samples(scene.time, FRAMES)
    frames, arrows = [*shapes.frames_of(label, scene, rows, WORLD)], [*shapes.arrows_of(scene, rows, colour)]
    for k, row in enumerate(rows):
        time = float(scene.time[row])
        transforms, update = FrameTransforms(), SceneUpdate()
        for frame in frames:
            one = transforms.transforms.add(parent_frame_id=frame.parent, child_frame_id=frame.name)
            _stamp(one.timestamp, time)
            _point(one.translation, frame.place[k])
            _turn(one.rotation, frame.turn[k])
        entity = update.entities.add(id=f"{label} forces", frame_id=label, frame_locked=True)
        _stamp(entity.timestamp, time)
        for kind in arrows:
            _arrows(entity, kind, k)
        if moment := float(scene.yaw_moment[row]):
            _line(entity, shapes.arc_of(moment, scene.car.height + 0.1), (0.35, 0.35, 0.35), 0.1)
        for contact, grip in zip(scene.contacts[row], scene.grip[row], strict=True):
            if grip > 0:
                angle = np.linspace(0.0, 2 * np.pi, 33)
                round_ = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]) * grip * shapes.PER_NEWTON
                _line(entity, round_ + contact + np.array([0.0, 0.0, 0.02]), colour, 0.02)
        yield _nanoseconds(time), transforms.SerializeToString(), update.SerializeToString()


def _arrows(entity: Any, kind: Arrows, k: int) -> None:
    for origin, vector, rgb in zip(kind.origins[k], kind.vectors[k], kind.colours[k], strict=True):
        length = float(np.linalg.norm(vector))
        if length < kind.thick:
            continue
        arrow = entity.arrows.add(
            shaft_length=0.75 * length, head_length=0.25 * length,
            shaft_diameter=kind.thick, head_diameter=2 * kind.thick,
        )  # fmt: skip
        _point(arrow.pose.position, origin)
        yaw, pitch = np.arctan2(vector[1], vector[0]), -np.arcsin(np.clip(vector[2] / length, -1, 1))
        _turn(arrow.pose.orientation, quaternions(yaw, pitch))
        _paint(arrow.color, rgb)


# ---- the layout ----


def _layout(runs: Sequence[ExportedRun], scene: bool) -> dict[str, Any]:
    """Return a layout of Foxglove: the cars from behind, the signals of the papers, the events."""
    panels: dict[str, Any] = {}
    plots: list[str] = []
    for signal in PANELS:
        paths = [
            {
                "value": _message_path(run.label, column),
                "label": run.label,
                "enabled": True,
                "color": to_hex(shapes.colour_of(number)),
                "timestampMethod": "receiveTime",
            }
            for number, run in enumerate(runs)
            for column in columns_of(run.results, signal)[:1]
        ]
        if paths:
            name = f"Plot!{signal}"
            unit = next(run.unit_of(c) for run in runs for c in columns_of(run.results, signal)[:1])
            panels[name] = {
                "title": f"{signal} [{unit or '1'}]",
                "paths": paths,
                "showLegend": True,
                "xAxisVal": "timestamp",
            }
            plots.append(name)
    panels["Log!events"] = {"topicToRender": "/events"}
    right: Any = _stacked([*plots, "Log!events"])
    if not scene:
        return _document(panels, right)
    first = next(run.label for run in runs if run.scene is not None)
    panels["3D!scene"] = {
        "followMode": "follow-pose",
        "followTf": first,
        "cameraState": {"distance": 12, "phi": 60, "thetaOffset": 90, "perspective": True, "fovy": 45},
        "scene": {"backgroundColor": to_hex(shapes.ASPHALT)},
        "topics": {"/scene": {"visible": True}},
        "layers": {"grid": {"layerId": "foxglove.Grid", "frameId": WORLD, "size": 200, "divisions": 20}},
    }
    return _document(
        panels, {"direction": "row", "first": "3D!scene", "second": right, "splitPercentage": 60}
    )


def _message_path(label: str, column: str) -> str:
    """Return how Foxglove names a field of a topic; topics with other signs than letters are in quotes."""
    instance, _, variable = column.partition(".")
    topic = f"/{label}/{instance}"
    plain = all(one.isalnum() or one in "_/-" for one in topic)
    return f"{topic if plain else json.dumps(topic)}.{_field(variable)}"


def _stacked(names: Sequence[str]) -> Any:
    if len(names) == 1:
        return names[0]
    share = 100 / len(names)
    return {"direction": "column", "first": names[0], "second": _stacked(names[1:]), "splitPercentage": share}


def _document(panels: Mapping[str, Any], layout: Any) -> dict[str, Any]:
    return {
        "configById": dict(panels),
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": layout,
    }
