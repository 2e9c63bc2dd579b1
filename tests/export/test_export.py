"""Exported runs, read back by the packages of their formats."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time

import numpy as np
import pyarrow.csv
import pyarrow.parquet
import pytest
from PIL import Image

import yawbench as yb
from tests.command_line import status_of
from tests.refusals import mentions
from yawbench.export import formats
from yawbench.export.tables import _identifier

LABELS = ("lane change", "sine")
RERUN = (sys.executable, "-m", "rerun_cli")
READ = 0.5
"""Processor time of reading a run from MDF [s]."""


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Two runs that record different signals over different times: a lane change, and a sine of paper A."""
    root = tmp_path_factory.mktemp("runs")
    runs = {"proving_ground/iso_3888_2": 4.0, "fnn_sideslip/25mps": 1.0}
    return [yb.load(name).set({"stop_time": end}).run().save(root / name) for name, end in runs.items()]


@pytest.fixture(scope="module")
def runs(folders):
    return [yb.open(folder) for folder in folders]


def exported(folders, kind, file):
    labels = [part for label in LABELS for part in ("--label", label)]
    assert status_of("export", *folders, "--to", kind, *labels, "--out", file) == 0
    return file


def test_csv_and_parquet_have_a_row_per_run_and_instant_with_units(folders, runs, tmp_path):
    table = pyarrow.parquet.read_table(exported(folders, "parquet", tmp_path / "runs.parquet"))
    assert table.schema.field("plant.yaw_rate").metadata == {b"unit": b"rad/s"}
    text = pyarrow.csv.read_csv(exported(folders, "csv", tmp_path / "runs.csv"))
    for label, run in zip(LABELS, runs, strict=True):
        for read, t, r in (
            (table, "time", "plant.yaw_rate"), (text, "time [s]", "plant.yaw_rate [rad/s]"),
        ):  # fmt: skip
            rows = np.asarray(read["run"]) == label
            assert (np.asarray(read[t])[rows] == run.time).all()
            assert (np.asarray(read[r])[rows] == run["plant.yaw_rate"]).all()
    alone = np.asarray(table["driver.path_offset"])
    assert np.isnan(alone[np.asarray(table["run"]) == "sine"]).all()


def test_mdf_has_a_group_per_run_and_every_channel_is_read_at_once(folders, runs, tmp_path):
    asammdf = pytest.importorskip("asammdf")
    file = exported(folders, "mdf", tmp_path / "runs.mf4")
    with asammdf.MDF(file) as mdf:
        assert [group.channel_group.acq_name for group in mdf.groups] == [*LABELS]
        assert mdf.version == "4.10"
        assert mdf.header.start_time.isoformat() == runs[0].results.record.started
        assert runs[0].title in mdf.groups[0].channel_group.comment
        for number, run in enumerate(runs):
            signal = mdf.get("plant.yaw_rate", group=number)
            assert (signal.samples == run["plant.yaw_rate"]).all() and signal.unit == "rad/s"
            assert signal.timestamps == pytest.approx(run.time)
        begin = time.process_time()
        for index in range(1, len(runs[0].results.columns) + 1):
            mdf.get(group=0, index=index)
        assert time.process_time() - begin < READ


def test_mat_has_a_structure_per_run_and_instance(folders, runs, tmp_path):
    from scipy.io import loadmat

    content = loadmat(exported(folders, "mat", tmp_path / "runs.mat"), simplify_cells=True)
    for name, label, run in zip(("lane_change", "sine"), LABELS, runs, strict=True):
        one = content[name]
        assert one["label"] == label and (one["plant"]["yaw_rate"] == run["plant.yaw_rate"]).all()
        assert one["units"]["plant"]["yaw_rate"] == "rad/s" and one["time"].shape == run.time.shape


def test_names_are_made_for_matlab():
    assert [_identifier(name) for name in ("a-b", "2 runs", "units", "x" * 99)] == [
        "a_b", "r_2_runs", "units_3", "x" * 59,
    ]  # fmt: skip
    assert _identifier("a b", {"a_b"}) == "a_b_3"


@pytest.fixture(scope="module")
def mcap(folders, tmp_path_factory):
    """Messages of a recording by topic, and its layout."""
    pytest.importorskip("foxglove_schemas_protobuf")
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory

    file = exported(folders, "mcap", tmp_path_factory.mktemp("mcap") / "runs.mcap")
    topics: dict[str, list] = {}
    schemas, units = {}, {}
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            topics.setdefault(channel.topic, []).append((message.log_time * 1e-9, decoded))
            schemas[channel.topic] = schema.name, schema.encoding
            units[channel.topic] = channel.metadata
    return topics, schemas, units, json.loads((file.parent / "runs.mcap.layout.json").read_text())


def test_mcap_has_all_samples_as_protobuf_with_units(mcap, runs):
    topics, schemas, units, _ = mcap
    for label, run in zip(LABELS, runs, strict=True):
        messages = topics[f"/{label}/plant"]
        assert [t for t, _ in messages] == pytest.approx(run.time)
        assert [one.yaw_rate for _, one in messages] == list(run["plant.yaw_rate"])
        assert units[f"/{label}/plant"]["yaw_rate"] == "rad/s"
        instances = {name.partition(".")[0] for name in run.results.columns}
        assert {f"/{label}/{name}" for name in instances} <= topics.keys()
    assert {encoding for _, encoding in schemas.values()} == {"protobuf"}
    known = {"/tf": "foxglove.FrameTransforms", "/scene": "foxglove.SceneUpdate", "/events": "foxglove.Log"}
    assert {topic: schemas[topic][0] for topic in known} == known


def test_mcap_moves_the_cars_of_all_runs_through_lanes_and_cones(mcap, runs):
    topics, *_ = mcap
    places: dict[str, list] = {}
    for t, message in topics["/tf"]:
        for one in message.transforms:
            places.setdefault(one.child_frame_id, []).append((t, one.translation.x, one.translation.y))
    for label, run in zip(LABELS, runs, strict=True):
        t, x, y = np.array(places[label]).T
        assert x == pytest.approx(np.interp(t, run.time, run["position_x"]), abs=1e-6)
        assert y == pytest.approx(np.interp(t, run.time, run["position_y"]), abs=1e-6)
        assert t[-1] == pytest.approx(run.time[-1]) and np.diff(t).max() < 0.03
        assert f"{label}/wheel_fl" in places and f"{label}/body" in places
    still = topics["/scene"][0][1]
    (road,) = (one for one in still.entities if one.id == "road")
    scene = runs[0].scene()
    assert len(road.cubes) == 3 and len(road.cylinders) == len(scene.places.cones)
    moving = next(m for t, m in topics["/scene"][1:] if t > 2.0 and m.entities[0].frame_id == LABELS[0])
    assert len(moving.entities[0].arrows) >= 8
    said = [(message.name, message.message) for _, message in topics["/events"]]
    assert {name for name, _ in said} <= {*LABELS} and len(said) == sum(len(r.scene().events) for r in runs)


def test_the_layout_of_foxglove_shows_the_scene_and_the_signals_of_all_runs(mcap):
    topics, _, _, layout = mcap

    def names(place):
        return {place} if isinstance(place, str) else names(place["first"]) | names(place["second"])

    assert names(layout["layout"]) == layout["configById"].keys()
    plot = layout["configById"]["Plot!yaw_rate"]
    assert [path["label"] for path in plot["paths"]] == [*LABELS] and "rad/s" in plot["title"]
    for path in plot["paths"]:
        topic, field = path["value"].rsplit(".", 1)
        assert hasattr(topics[topic.strip('"')][0][1], field)


@pytest.fixture(scope="module")
def rrd(folders, tmp_path_factory):
    pytest.importorskip("rerun")
    return exported(folders, "rerun", tmp_path_factory.mktemp("rerun") / "runs.rrd")


def test_a_recording_of_rerun_has_cars_signals_and_a_layout(rrd, runs):
    command = [*RERUN, "rrd", "print", str(rrd)]
    printed = subprocess.run(command, capture_output=True, text=True, check=True)
    text = printed.stdout + printed.stderr
    cars = ("/cars/lane_change/body", "/cars/sine/forces", "/cars/lane_change/wheel_fl")
    signals = ("/plots/yaw_rate/sine", "/signals/sine/plant/yaw_rate")
    for path in (*cars, *signals, "/road/cones", "/events/lane_change", "/answer"):
        assert path in text
    assert "ViewBlueprint" in text and f"{len(runs[1])} rows" in text


def test_rerun_draws_the_recording_without_a_window(rrd, tmp_path):
    from rerun.experimental import ViewerClient

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [*RERUN, "--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", "1200x800"]
    said, picture = tmp_path / "said.txt", tmp_path / "rerun.png"
    with (
        said.open("w") as stream,
        subprocess.Popen([*command, str(rrd)], stdout=stream, stderr=stream) as viewer,
    ):
        try:
            colours = set()
            for _ in range(20):
                time.sleep(2.0)
                if viewer.poll() is not None:
                    assert "graphics adapter" in said.read_text() or "render context" in said.read_text()
                    pytest.skip("no graphics adapter: Debian has one without hardware, mesa-vulkan-drivers")
                try:
                    ViewerClient(f"rerun+http://127.0.0.1:{port}/proxy").save_screenshot(str(picture))
                except ConnectionError:  # it has not begun to listen, or is about to end
                    continue
                with Image.open(picture) as image:
                    colours = {colour[:3] for _, colour in image.convert("RGB").getcolors(10**6)}
                if len(colours & {(0, 114, 178), (213, 94, 0)}) == 2:
                    break
            assert {(0, 114, 178), (213, 94, 0)} <= colours  # the curves of both runs
            assert (235, 235, 235) in colours  # the road
        finally:
            viewer.kill()


def test_what_cannot_be_exported_is_said_in_a_sentence(folders, tmp_path, capsys, monkeypatch):
    assert status_of("export", folders[0], "--to", "excel") == 2
    assert mentions(capsys.readouterr().err, "--to excel", "parquet")
    lost = formats.Format(".x", "a file", "tables:write_csv", ("no_such_package",), "none")
    monkeypatch.setitem(formats.FORMATS, "lost", lost)
    assert status_of("export", folders[0], "--to", "lost") == 2
    assert mentions(capsys.readouterr().err, "no_such_package", "yawbench[none]")
    (tmp_path / "file").write_text("")
    assert status_of("export", folders[0], "--to", "csv", "--out", tmp_path / "file" / "a.csv") == 2
    assert mentions(capsys.readouterr().err, "a.csv")
