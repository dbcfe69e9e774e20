"""One capture, written again as every recorder would have it: the labels are the same bytes.

A simulated walk goes through the steps of an indoor sequence, the real recording through the whole workflow.
"""

import json
import shutil

import ezc3d
import numpy as np
import pytest
from rosbags.rosbag1 import Reader

from dior.calibrate import clocks, intrinsics, locate
from dior.clocks.clock import ClockFiles
from dior.ingest import frames, mocap
from dior.label import reproject
from dior.reconstruct import timeline
from dior.simulate import config, settings, simulate, simulate_mocap
from dior.tables import tables
from tests.cases import some
from tests.end_to_end.workflow import ROOT, edit, snakemake
from tests.ingest.bagfiles import INFO, PACKED, STORES, Sent, write

CAMERAS = tuple(f"cam{i:02d}" for i in range(1, 5))
COMPUTERS = ("pc1", "pc2")
FORMATS = ("ros1 lz4", "db3", "mcap zstd", "ros1 bz2", "db3 message", "db3 zstd alone", "mcap", "mcap ros1")
WALK = "indoor_01"
TINY = {
    "subjects": 1, "sequences": 1, "environments": ["indoor"], "duration_s": 1.0, "width": 640, "height": 360,
    "fx": 320.0,
}  # fmt: skip
LABELS = [f"results/reproject/beam_01.{camera}.parquet" for camera in CAMERAS]


def sent_in(bag):
    """The messages of a ROS 1 bag of CompressedImage and CameraInfo."""
    with Reader(bag) as reader:
        for connection, receive_ns, data in reader.messages():
            message = STORES["ros1"].deserialize_ros1(data, connection.msgtype)
            stamp = message.header.stamp
            if connection.msgtype == PACKED:
                content = {"format": message.format, "data": message.data}
            else:
                content = {key: getattr(message, key) for key in ("height", "width", "distortion_model")}
                content |= {key: getattr(message, key.upper()) for key in "dkrp"} | {"binning_x": 0, "binning_y": 0}
            kind = PACKED if connection.msgtype == PACKED else INFO
            yield Sent(connection.topic, receive_ns, stamp.sec * 10**9 + stamp.nanosec, kind, content)


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """A simulated indoor walk: its `config/`, its C3D, and the labels by camera that its own bags give."""
    folder = tmp_path_factory.mktemp("simulated")
    config.write(settings.from_dict(TINY), folder / "config")
    config.write_offsets(settings.from_dict(TINY), folder / "config")
    for step in (simulate, simulate_mocap):
        step.run(settings=TINY, sequence=WALK, out=folder)
    (folder / "made").mkdir()
    bags = [folder / WALK / f"{computer}.bag" for computer in COMPUTERS]
    return folder, bags, labels_from(folder, bags, folder, folder / "made")


def labels_from(simulated, bags, data_root, out, trigger_log=None, offsets=None):
    """Bytes of the labels by camera, from the bags through every step between; results lie in the folder `out`."""
    session = simulated / "config/sessions/lab"
    topics = {camera: f"/{camera}/color/image_raw/compressed" for camera in CAMERAS}
    indexed, markers, clocked = out / f"{WALK}.parquet", out / "mocap.parquet", out / "clocks.parquet"
    offsets = offsets or simulated / f"config/offsets/{WALK}.yaml"
    frames.run(sequence=WALK, bags=bags, data_root=data_root, topics=topics, out=indexed)
    c3d = simulated / WALK / "mocap.c3d"
    mocap.run(sequence=WALK, subject="S01", c3d=c3d, frames=indexed, trigger_log=trigger_log, out=markers)
    placed = {}
    for path in session.glob("*.marks.csv"):
        # somebody without consent, of whom there is no table
        path.write_text(path.read_text() + "withdrawn_01,0,LASI,1,1\n" * ("withdrawn" not in path.read_text()))
    for camera in CAMERAS:
        lens, placed[camera] = out / f"{camera}.lens.parquet", out / f"{camera}.placed.parquet"
        intrinsics.run(
            session="lab", camera=camera, role="close", topic=topics[camera], source="camera_info", name="", board={},
            distortion_model="plumb_bob", frames=indexed, sequence=WALK, data_root=data_root, out=lens,
            findings=out / "findings.parquet",
        )  # fmt: skip
        locate.run(
            session="lab", camera=camera, camera_file=session / f"{camera}.yaml", intrinsics=lens,
            given=locate.ByHand(session / f"{camera}.marks.csv", [WALK], [offsets]),
            recorded=locate.Recorded([markers], [indexed]), ransac_px=8.0,
            written=locate.Written(
                out=placed[camera], out_covariance=out / f"{camera}.covariance.parquet",
                out_clocks=out / "found.parquet", out_clock_gains=out / "gains.parquet",
                out_clock_costs=out / "costs.parquet", out_marks=out / "marks.parquet",
                findings=out / "findings.parquet",
            ),
        )  # fmt: skip
    clocks.run(
        sequence=WALK, placed=clocks.Placed(list(placed.values()), CAMERAS, covariance=[]),
        detected=clocks.Detected(None, min_score=0.3, max_gap=1.5), frames=indexed,
        indoors=clocks.Indoors(markers, marked=[]), offsets=offsets, data_root=data_root,
        written=ClockFiles(
            clocked, out / "clock_gains.parquet", out / "costs.parquet", findings=out / "findings.parquet"
        ),
        out_aside=out / "aside.parquet",
    )  # fmt: skip
    timeline.run(
        sequence=WALK, frames=indexed, cameras=CAMERAS, clocks=[clocked], mocap=markers, max_gap=1.5,
        out=out / "timeline.parquet",
    )  # fmt: skip
    found = {}
    for camera in CAMERAS:
        labels = out / f"{camera}.labels.parquet"
        reproject.run(
            sequence=WALK, subject="S01", labelled=[camera], cameras=[placed[camera]], makers=[],
            covariance=[out / f"{camera}.covariance.parquet"], skeleton=markers, frames=indexed, clocks=[clocked],
            clock_gains=[out / "clock_gains.parquet"], source="mocap", out=[labels],
        )  # fmt: skip
        found[camera] = labels.read_bytes()
    return found


@pytest.mark.slow
def test_a_trigger_log_moves_the_zero_of_all_steps_alike(simulated, tmp_path):
    """The log says 0.3 s before the first picture: with offsets to match, the same pictures get the same labels."""
    folder, bags, _ = simulated
    clock = tables.read(folder / "made/clocks.parquet", "offsets")
    earlier = "".join(
        f"{camera}: {{offset_s: {offset - 0.3}, drift_ppm: 0}}\n"
        for camera, offset in zip(clock["camera"], clock["offset_s"], strict=True)
    )
    (tmp_path / f"{WALK}.yaml").write_text(earlier)
    first = int(tables.read(folder / f"made/{WALK}.parquet", "frames")["stamp_ns"].min())
    # which ezc3d counts from 0
    before_c3d = round(simulate_mocap.FIRST_MOCAP_FRAME * 1e9 / settings.from_dict(TINY).mocap_hz)
    event = {"event": "start", "name": "mocap", "start_ns": first - 300_000_000 - before_c3d}
    (tmp_path / "trigger.jsonl").write_text(json.dumps(event) + "\n")
    labels_from(folder, bags, folder, tmp_path, tmp_path / "trigger.jsonl", tmp_path / f"{WALK}.yaml")
    assert tables.read(tmp_path / "mocap.parquet", "skeletons_3d")["stamp_ns"][0] == first - 300_000_000
    for camera in CAMERAS:
        ours, theirs = (
            tables.read(made / f"{camera}.labels.parquet", "labels_2d") for made in (tmp_path, folder / "made")
        )
        np.testing.assert_allclose(ours["u"], theirs["u"], atol=0.01)
        np.testing.assert_array_equal(ours["stamp_ns"], theirs["stamp_ns"])


def test_the_simulated_walk_has_labels(simulated):
    folder, _, labels = simulated
    assert set(labels) == set(CAMERAS)
    for camera in CAMERAS:
        table = tables.read(folder / f"made/{camera}.labels.parquet", "labels_2d")
        assert len(table["u"]) == 30 * 39 and np.isfinite(table["u"]).mean() > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("lacking", [("LASI", "RASI"), ("LASI", "RASI", "LPSI", "RPSI", "LKNE", "RKNE")])
def test_a_c3d_without_some_markers_has_the_labels_of_the_others(simulated, tmp_path, lacking):
    """Cameras are located with the marks that are left, hence not the same bytes."""
    folder, bags, _ = simulated
    shutil.copytree(folder, tmp_path / "less")
    c3d = ezc3d.c3d(str(folder / WALK / "mocap.c3d"))
    labels = c3d["parameters"]["POINT"]["LABELS"]["value"]
    renamed = [f"{label}X" if label.rpartition(":")[2] in lacking else label for label in labels]
    c3d["parameters"]["POINT"]["LABELS"]["value"] = renamed
    c3d.write(str(tmp_path / "less" / WALK / "mocap.c3d"))
    for path in (tmp_path / "less/config/sessions/lab").glob("*.marks.csv"):
        kept = [line for line in path.read_text().splitlines(True) if line.split(",")[2] not in lacking]
        path.write_text("".join(kept) + "withdrawn_01,0,LASI,1,1\n")
    labels_from(tmp_path / "less", bags, folder, tmp_path)
    for camera in CAMERAS:
        ours = tables.read(tmp_path / f"{camera}.labels.parquet", "labels_2d")
        theirs = tables.read(folder / f"made/{camera}.labels.parquet", "labels_2d")
        same = ~np.isin(theirs["joint"], lacking)
        assert ours["joint"].tolist() == theirs["joint"][same].tolist()
        np.testing.assert_allclose(ours["u"], theirs["u"][same], atol=0.6)


@pytest.mark.parametrize("form", some(FORMATS, FORMATS[0]))
def test_labels_of_a_simulated_walk_are_the_same_bytes_from_every_format(simulated, tmp_path, form):
    folder, bags, wanted = simulated
    again = [write(tmp_path / bag.stem, list(sent_in(bag)), form) for bag in bags]
    assert labels_from(folder, again, tmp_path, tmp_path) == wanted
    named = set(tables.read(tmp_path / f"{WALK}.parquet", "frames")["bag"])
    assert named == {bag.relative_to(tmp_path).as_posix() for bag in again}


def labelled(shared, folder, form):
    """A project folder that was run on the recording in another format."""
    data = folder / "data"
    data.mkdir(parents=True)
    (data / "mlkit").symlink_to(shared / "real_outdoor/mlkit")
    (data / "reference").symlink_to(shared / "real_outdoor/reference")
    names = []
    for computer in COMPUTERS:
        source = shared / f"real_outdoor/{computer}.bag"
        bag = write(data / computer, list(sent_in(source)), form) if form else shutil.copy(source, data)
        names.append(str(bag).removeprefix(f"{data}/") + ("/" if bag != str(bag) and bag.is_dir() else ""))
    shutil.copytree(ROOT / "tests/projects/real_outdoor/config", folder / "config")
    edit(folder / "config/config.yaml", "../../../../shared/data/real_outdoor", "data")
    edit(folder / "config/sequences.tsv", "pc1.bag;pc2.bag", ";".join(names))
    snakemake(folder, *LABELS)
    return folder


@pytest.mark.slow
def test_labels_of_the_real_recording_are_the_same_bytes_from_every_recorder(shared, tmp_path):
    first = labelled(shared, tmp_path / "ros1", "")
    for form in ("db3", "mcap zstd", "ros1 lz4"):
        other = labelled(shared, tmp_path / form.replace(" ", "_"), form)
        for name in LABELS:
            assert (other / name).read_bytes() == (first / name).read_bytes(), (form, name)
        bags = tables.read(other / "results/frames/beam_01.parquet", "frames")["bag"]
        suffix = ".bag" if form.startswith("ros1") else ""
        assert set(bags) == {f"pc1{suffix}", f"pc2{suffix}"}
