"""Cameras placed by a tag and a lens from a chessboard's pictures, by the real Snakemake on recordings drawn here."""

import numpy as np
import pytest

from dior.geometry import camera_tables
from dior.geometry.camera import Camera, Intrinsics, angle_deg, pose, project
from dior.geometry.multiview import look_at
from dior.project.init import header
from dior.tables import tables
from tests.calibrate.marks.test_apriltag import FLAT, photograph
from tests.end_to_end.workflow import ROOT, snakemake
from tests.ingest.bagfiles import info, packed, write
from tests.rig import camera

pytestmark = pytest.mark.slow

T0 = 1_708_000_000_000_000_000
BOARD = ROOT.parent / "shared/data/chessboard"
# cam01 of the real recording, whose chessboard is in BOARD; its lens has no distortion to speak of
REAL = Intrinsics(1088, 1920, 1681.245, 1681.075, 532.974, 948.137, "plumb_bob", ())
AT, TARGET = (2.2, -1.2, 1.5), (0, 0, 0.3)
VIEWS = {
    "cam01": camera("cam01", AT, TARGET),
    "blind": camera("blind", (-2.0, 1.5, 1.3), TARGET),
    "board": Camera("board", REAL, pose(look_at(np.array([1.8, 1.6, 1.4]), np.zeros(3)), (1.8, 1.6, 1.4))),
}


def recording(folder):
    """A bag with three pictures of the tag by every camera but `blind`, and with the lenses of all."""
    rng, sent = np.random.default_rng(3), []
    for name, view in VIEWS.items():
        lens = view.intrinsics
        empty = np.full((lens.height, lens.width, 3), 120, np.uint8)
        clean = empty if name == "blind" else photograph(view, FLAT, rng, noise=0)
        for i in range(3):
            noise = rng.integers(-4, 5, clean.shape[:2], np.int8)[..., None]
            sent.append(
                packed(f"/{name}/image/compressed", T0 + i * 33_333_333, (clean + noise).astype(np.uint8), ".jpg")
            )
        lens_as_sent = info(f"/{name}/camera_info", T0, lens.distortion or (0.0,) * 5, size=(lens.height, lens.width))
        lens_as_sent.content["k"] = lens.K.ravel()
        sent.append(lens_as_sent)
    write(folder / "walk", sorted(sent, key=lambda one: one.receive_ns), "ros1 lz4")


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """The project after one run, and what Snakemake said; `board` takes its lens from BOARD, where that is there."""
    folder = tmp_path_factory.mktemp("tag")
    config = folder / "config"
    session = config / "sessions/field"
    session.mkdir(parents=True)
    (folder / "data").mkdir()
    recording(folder / "data")
    (config / "config.yaml").write_text("data_root: data\nrelease: {version: 0.1.0, title: A tag, license: CC0-1.0}\n")
    walk = ["walk_01", "1", "S01", "field", "outdoor", "suit", "plain", "walk.bag", "", "mlkit/{camera}.jsonl", "", ""]
    (config / "sequences.tsv").write_text(header("sequences") + "\t".join(walk) + "\n")
    (config / "subjects.tsv").write_text(header("subjects") + "S01\tfieldwalker\t\t\tyes\n")
    (session / "session.yaml").write_text(f"cameras: [{', '.join(VIEWS)}]\ntag: {{id: 0, size_m: {FLAT['size_m']}}}\n")
    for name in VIEWS:
        text = f"role: close\ntopic: /{name}/image/compressed\nlocate: apriltag\n"
        if name == "board" and BOARD.is_dir():
            (folder / "data/chessboard").symlink_to(BOARD.resolve())
            text += "intrinsics: {chessboard: {path: chessboard, rows: 7, columns: 4, square_m: 0.06}}\n"
        (session / f"{name}.yaml").write_text(text)
    wanted = [f"results/place/field/{name}.parquet" for name in VIEWS]
    code, said = snakemake(folder, "--keep-going", *wanted, check=False)
    assert code, "a camera that does not see the tag must end the run"
    return folder, said


def placed(folder, name):
    path = folder / f"results/place/field/{name}.parquet"
    return camera_tables.read_cameras(path)[name], tables.read(path.with_suffix(".findings.parquet"), "findings")


def test_a_camera_that_sees_the_tag_is_placed(ran):
    folder, _ = ran
    found, findings = placed(folder, "cam01")
    assert found.locate == "apriltag" and np.linalg.norm(found.centre - AT) < 0.01
    assert angle_deg(found.wRc, VIEWS["cam01"].wRc) < 0.2
    assert findings["code"].tolist() == ["pose_from_tag"] and "in 3 of 3 pictures" in findings["text"][0]


def test_the_corners_that_it_saw_are_there_for_the_adjustment(ran):
    folder, _ = ran
    marks = tables.read(folder / "results/place/field/cam01.marks.parquet", "marks")
    world = np.stack([marks[axis] for axis in "xyz"], axis=-1)
    seen = np.stack([marks["u"], marks["v"]], axis=-1)
    assert len(seen) == 12 and marks["inlier"].all() and marks["frame"].tolist() == [0] * 4 + [1] * 4 + [2] * 4
    np.testing.assert_allclose(project(VIEWS["cam01"], world)[0], seen, atol=0.3)
    session = folder / "config/sessions/field/session.yaml"
    before = session.read_text()
    session.write_text(before + "adjust: {walk_01: {count: 3}}\n")
    # a dry run names what is missing
    (folder / "data/mlkit").mkdir()
    for name in VIEWS:
        (folder / f"data/mlkit/{name}.jsonl").touch()
    _, said = snakemake(folder, "--dry-run", "--printshellcmds", "results/adjust/field.parquet")
    session.write_text(before)
    tags = " ".join(f"results/place/field/{name}.marks.parquet" for name in VIEWS)
    assert f"--tags {tags} " in said


def test_a_camera_that_does_not_is_refused_in_a_sentence(ran):
    folder, said = ran
    assert not (folder / "results/place/field/blind.parquet").exists()
    log = (folder / "logs/place/field.blind.log").read_text().strip()
    assert len(log.splitlines()) == 1 and "Traceback" not in said
    assert "session field, blind: tag 0 of 36h11 is in none of the 3 pictures of sequence walk_01 " in log
    assert log in said


def test_a_lens_from_pictures_of_a_chessboard_places_its_camera(ran, shared):
    folder, _ = ran
    lens = camera_tables.read_cameras(folder / "results/intrinsics/field/board.parquet")["board"].intrinsics
    assert lens.fx == pytest.approx(REAL.fx, rel=0.002) and (lens.width, lens.height) == (1088, 1920)
    findings = tables.read(folder / "results/intrinsics/field/board.findings.parquet", "findings")
    text = dict(zip(findings["code"], findings["text"], strict=True))
    assert text["board_calibration"].startswith("6 of 7 pictures used, rms 0.2")
    # the board leaves the lens' centre in the middle of the picture, 15 px or half a degree from where it is
    found, _ = placed(folder, "board")
    assert np.linalg.norm(found.centre - VIEWS["board"].centre) < 0.02
    assert 0.1 < angle_deg(found.wRc, VIEWS["board"].wRc) < 0.7
