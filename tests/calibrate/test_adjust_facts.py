"""The step adjust on tables of a walker seen by three cameras, with each metric fact that session.yaml can state.

The tape puts the cameras 4 % too far from the middle. Without a fact that is the scale; a fact brings the true one.
"""

import numpy as np
import pytest

from dior.calibrate import adjust
from dior.calibrate.bundle import outcome, window
from dior.calibrate.marks import apriltag
from dior.errors import DiorError
from dior.geometry import camera_tables
from dior.geometry.camera import pose, project
from dior.tables import tables
from tests.calibrate.bundle.test_facts import walker
from tests.cases import slow, some
from tests.rig import ring

MOMENTS, T0, FPS = 60, 1_708_000_000_000_000_000, 30
MIDDLE = np.array([0, 0, 1.0])
TAG = {"family": "36h11", "id": 3, "size_m": 1.0, "position_m": [0.4, 0.2, 0.0], "normal": [0, 0, 1], "up": [0, 1, 0]}


def apart(cameras):
    return np.linalg.norm(cameras[0].centre - cameras[1].centre)


def scaled(cameras, scale, locate="tape"):
    """The cameras, further from the middle by a factor."""
    return [c.at(pose(c.wRc, MIDDLE + scale * (c.centre - MIDDLE)), locate) for c in cameras]


def recorded(folder, sequences=("walk",), heights=(1.75,), noise_px=0.5):
    """Tables of one walk per sequence, each of a person of another height."""
    stamps = T0 + np.round(np.arange(MOMENTS) / FPS * 1e9).astype(np.int64)
    for i, (sequence, height) in enumerate(zip(sequences, heights, strict=True)):
        points, tracks = walker(MOMENTS, height)
        random, names = np.random.default_rng(i), [camera.name for camera in ring(3)]
        uv = np.concatenate([project(c, points)[0] + random.normal(0, noise_px, (len(points), 2)) for c in ring(3)])
        joints = len(tracks.names)
        detections = {
            "camera": np.repeat(names, len(points)), "frame": np.tile(np.repeat(np.arange(MOMENTS), joints), 3),
            "stamp_ns": np.tile(np.repeat(stamps, joints), 3), "joint": np.tile(tracks.names, 3 * MOMENTS),
            "u": uv[:, 0], "v": uv[:, 1], "score": np.ones(len(uv)),
        }  # fmt: skip
        tables.write(folder / f"detections/{sequence}.parquet", "detections", detections)
        frames = {
            "camera": np.repeat(names, MOMENTS), "frame": np.tile(np.arange(MOMENTS), 3), "stamp_ns": np.tile(stamps, 3)
        }  # fmt: skip
        tables.write(folder / f"frames/{sequence}.parquet", "frames", frames)
    return folder


def tag_seen(folder, camera, sigma_px=0.2):
    """The marks table that place writes of a camera which sees the tag in four pictures; its path."""
    world = apriltag.world_points(TAG, "tag")
    random = np.random.default_rng(int(camera.name[-2:]))
    uv = np.tile(project(camera, world)[0], (4, 1)) + random.normal(0, sigma_px, (16, 2))
    path = folder / f"place/{camera.name}.marks.parquet"
    columns = {
        "session": ["field"] * 16, "camera": [camera.name] * 16, "sequence": ["walk"] * 16,
        "frame": np.repeat(np.arange(4), 4), "joint": [f"tag_3_{corner}" for corner in apriltag.CORNERS] * 4,
        "u": uv[:, 0], "v": uv[:, 1], **dict(zip("xyz", np.tile(world, (4, 1)).T, strict=True)),
        "residual_px": np.full(16, sigma_px), "inlier": np.ones(16, bool),
    }  # fmt: skip
    tables.write(path, "marks", columns)
    return path


def clicked(folder, points, cameras=None, sigma_px=0.3):
    """Marks CSVs of named points (3,) m in the cameras; their paths."""
    random, paths = np.random.default_rng(7), []
    for camera in ring(3) if cameras is None else cameras:
        rows = [project(camera, np.array(at)[None])[0][0] + random.normal(0, sigma_px, 2) for at in points.values()]
        path = folder / f"{camera.name}.marks.csv"
        lines = [f"walk,0,{name},{u:.2f},{v:.2f}" for name, (u, v) in zip(points, rows, strict=True)]
        path.write_text("\n".join(["sequence,frame,joint,u,v", *lines]) + "\n")
        paths.append(path)
    return paths


def ran(
    folder, placed, known=None, marks=(), tags=(), sigma_m=0.3, sequences=("walk",), taped=True, physics=None,
    everybody=(),
):  # fmt: skip
    """Adjust the `placed` cameras; returns those adjusted, their covariance and the texts of the findings by code."""
    files = []
    for camera in placed:
        camera_tables.write_cameras(folder / f"place/{camera.name}.parquet", [camera], "field")
        at = ", ".join(f"{x:.6f}" for x in camera.centre)
        tape = f"tape: {{position_m: [{at}], sigma_m: {sigma_m}}}\n" if taped else ""
        files.append(folder / f"{camera.name}.yaml")
        files[-1].write_text(f"role: close\ntopic: /{camera.name}/image\nlocate: {camera.locate}\n{tape}")
    adjust.run(
        session="field", cameras=[folder / f"place/{camera.name}.parquet" for camera in placed], camera_files=files,
        walks=adjust.Walks(
            detections=[folder / f"detections/{name}.parquet" for name in sequences],
            frames=[folder / f"frames/{name}.parquet" for name in sequences], offsets=[],
            window={name: {"first": 0, "count": MOMENTS, "step": 1} for name in sequences},
            everybody_seen=list(everybody),
        ),
        choices=adjust.Choices(
            min_score=0.4, min_views=3, huber_px=15.0, max_mean_px=12.0, max_gap=1.5
        ),
        measured=adjust.Measured(known or {}, list(marks), list(sequences), list(tags)), physics=physics or {},
        written=adjust.Written(
            folder / "adjust.parquet", folder / "covariance.parquet", folder / "metrics.parquet",
            folder / "findings.parquet",
        ),
    )  # fmt: skip
    table = tables.read(folder / "findings.parquet", "findings")
    texts = {}
    for code, text in zip(table["code"], table["text"], strict=True):
        texts.setdefault(code, []).append(text)
    return list(camera_tables.read_cameras(folder / "adjust.parquet").values()), texts


def test_a_tag_decides_the_scale_and_the_place_of_cameras_without_a_tape(tmp_path):
    """The cameras are placed 4 % too far; only the corners that they saw know better."""
    recorded(tmp_path)
    tags = [tag_seen(tmp_path, camera) for camera in ring(3)]
    found, _ = ran(tmp_path, scaled(ring(3), 1.04, "apriltag"), tags=tags, taped=False)
    assert abs(apart(found) / apart(ring(3)) - 1) < 0.004
    for camera, true in zip(found, ring(3), strict=True):
        distance, angle = outcome.shift_and_turn(true, camera)
        assert distance < 0.02 and angle < 0.2
    joint = camera_tables.read_camera_covariance(tmp_path / "covariance.parquet", [camera.name for camera in found])
    shift = np.concatenate([camera.centre - true.centre for camera, true in zip(found, ring(3), strict=True)])
    at = np.add.outer(6 * np.arange(3), [3, 4, 5]).ravel()
    # 9 degrees of freedom: 99.9 % are below 28; here it is about 2, as the mean of four pictures counts as one picture
    assert 0.5 < shift @ np.linalg.solve(joint[np.ix_(at, at)], shift) < 28


@pytest.mark.parametrize("most", [0.1, 0.7])
def test_pictures_of_two_people_take_no_part_where_they_are_few_or_it_ends_wrong_with_them(tmp_path, monkeypatch, most):
    recorded(tmp_path)
    path, second = tmp_path / "detections/walk.parquet", range(15, 50)
    table = tables.read(path, "detections")
    # one camera follows somebody else
    other = (table["camera"] == "cam01") & np.isin(table["frame"], second)
    table["u"] = np.where(other, 1.3 * table["u"] + 150 * np.sin(table["frame"]), table["u"])
    tables.write(path, "detections", table)
    seen = [(camera.name, frame, 0) for camera in ring(3) for frame in range(MOMENTS)]
    seen += [(camera.name, frame, 1) for camera in ring(3) for frame in second]
    camera, frame, person = zip(*sorted(seen), strict=True)
    everybody = {"camera": camera, "frame": frame, "person": person, "track": person, "joint": ["nose"] * len(seen)}
    everybody |= dict.fromkeys("uv", np.ones(len(seen))) | {"score": np.ones(len(seen))}
    tables.write(tmp_path / "walk.people.parquet", "detected_people", everybody)
    placed = scaled(ring(3), 1.0)
    with pytest.raises(DiorError, match="above the floor"):
        ran(tmp_path, placed)
    monkeypatch.setattr(window, "MOST_OTHERS", most)
    found, texts = ran(tmp_path, placed, everybody=[tmp_path / "walk.people.parquet"])
    assert f"the {3 * len(second)} pictures in which somebody else" in texts["others_left_out"][0]
    assert all(outcome.shift_and_turn(true, one)[1] < 0.3 for one, true in zip(found, ring(3), strict=True))


def test_only_what_is_marked_in_the_pictures_of_these_sequences_counts(tmp_path):
    files = {path.name.split(".")[0]: path for path in clicked(tmp_path, {"post": (0.5, 0.2, 1.0)})}
    for path in files.values():
        path.write_text(path.read_text() + "other,0,post,1,1\n")
    found = window.marked(files, list(files), {"post"}, ["walk"], 1.0)
    assert found.moments == ("walk",) and found.uv.shape == (3, 1, 2) and (found.uv > 10).all()
    assert window.marked(files, list(files), {"post"}, ["walk", "other"], 1.0).moments == ("other", "walk")


@pytest.mark.slow
def test_a_camera_with_a_tag_keeps_to_its_tape_too(tmp_path):
    """A tape of 1 mm is believed more than corners to 0.2 px of a metre at 5 m."""
    recorded(tmp_path)
    tags = [tag_seen(tmp_path, camera, 2.0) for camera in ring(3)]
    ends = []
    for sigma_m in (0.001, 1.0):
        found, _ = ran(tmp_path, scaled(ring(3), 1.04, "apriltag"), tags=tags, sigma_m=sigma_m)
        ends.append(apart(found) / apart(ring(3)))
    assert abs(ends[0] - 1.04) < 0.005 and abs(ends[1] - 1) < 0.02


def test_a_camera_placed_by_a_tag_whose_corners_are_lost_is_named(tmp_path):
    recorded(tmp_path)
    tags = [tag_seen(tmp_path, camera) for camera in ring(3)[:2]]
    with pytest.raises(DiorError, match="session field, cam03: it was placed by the tag, .* run the step place again"):
        ran(tmp_path, scaled(ring(3), 1.0, "apriltag"), tags=tags, taped=False)


def true_length(one, other, height=1.75):
    points, tracks = walker(MOMENTS, height)
    a, b = (points[tracks.joint == list(tracks.names).index(name)] for name in (one, other))
    return float(np.linalg.norm(a - b, axis=1).mean())


BAR = {"bar_a": (0.5, 0.1, 0.4), "bar_b": (0.5, 0.1, 1.4), "moved_a": (-0.6, 0.2, 0.9), "moved_b": (-0.6, 1.2, 0.9)}
POST = {"post": (0.3, -0.4, 1.1)}
SHOULDER, ANKLE = "left_shoulder", "left_ankle"
LONG_M = true_length(SHOULDER, ANKLE)
FACTS = {
    "keypoint_distance": (
        {"keypoint_distance": [{"joints": [SHOULDER, ANKLE], "length_m": LONG_M, "sigma_m": 0.004}]},
        {}, LONG_M, 0.004,
    ),
    "distances": (
        {"distances": [{"between": ["cam01", "cam02"], "length_m": float(apart(ring(3))), "sigma_m": 0.02}]},
        {}, apart(ring(3)), 0.02,
    ),
    "distances to a point": (
        {"distances": [
            {"between": [c.name, "post"], "length_m": float(np.linalg.norm(c.centre - POST["post"])), "sigma_m": 0.01}
            for c in ring(3)
        ]},
        POST, np.linalg.norm(ring(3)[0].centre - POST["post"]), 0.01,
    ),
    "scale_bar": (
        {"scale_bar": [{"ends": [["bar_a", "bar_b"], ["moved_a", "moved_b"]], "length_m": 1.0, "sigma_m": 0.002}]},
        BAR, 1.0, 0.002,
    ),
    "stature": (
        {"stature": [{"height_m": 1.75, "sigma_m": 0.01, "sequences": ["walk"]}]}, {}, 0.779 * 1.75, 0.0358,
    ),
}  # fmt: skip


@pytest.mark.parametrize("key", some(FACTS, "stature", "distances"))
def test_a_fact_corrects_a_wrong_tape_within_its_sigma_and_says_so(tmp_path, key):
    """The tape (30 cm a camera) alone would leave the 4 %; the fact's part of it is by the two sigmas."""
    known, points, value, sigma = FACTS[key]
    recorded(tmp_path)
    found, told = ran(tmp_path, scaled(ring(3), 1.04), known, clicked(tmp_path, points) if points else ())
    # three tapes of 30 cm know the scale to 30 cm over the root of the summed squares of 5.02 m, 3.5 %
    share, tape = sigma / value, 0.3 / np.sqrt(3 * 25.25)
    if "point" in key:
        share /= np.sqrt(3)
    left = 0.04 * share**2 / (share**2 + tape**2)
    assert abs(apart(found) / apart(ring(3)) - 1 - left) < 2 * share * tape / np.hypot(share, tape)
    assert abs(apart(found) / apart(ring(3)) - 1 - left) < 0.006
    text = told["metric_fact"][0]
    assert f"measured {value:.3f} ± {sigma:.3f} m" in text and "again" not in text
    measured = float(text.split(": ")[1].split(" m,")[0])
    assert abs(measured / value - 1 - left) < 0.006


def test_without_a_fact_the_wrong_tape_stays(tmp_path):
    found, told = ran(recorded(tmp_path), scaled(ring(3), 1.04))
    assert abs(apart(found) / apart(ring(3)) - 1.04) < 0.004 and "metric_fact" not in told


def test_facts_that_contradict_are_told_apart(tmp_path):
    """A tape of 2 cm between cameras against a bar that is 10 % too long."""
    recorded(tmp_path)
    known = FACTS["distances"][0] | {"scale_bar": [{"ends": [["bar_a", "bar_b"]], "length_m": 1.1, "sigma_m": 0.01}]}
    _, told = ran(tmp_path, scaled(ring(3), 1.0), known, clicked(tmp_path, BAR))
    assert [("again" in text) for text in told["metric_fact"]] == [False, True]
    assert "scale bar bar_a to bar_b" in told["metric_fact"][1]


def test_the_floor_brings_the_world_down(tmp_path):
    """All tapes 15 cm too high, each known to 30 cm: the feet would stand in the air."""
    recorded(tmp_path)
    lifted = [c.at(pose(c.wRc, c.centre + (0, 0, 0.15)), "tape") for c in ring(3)]
    ends = {}
    for floor in (False, True):
        known = {"floor": {"sigma_m": 0.005, "sigma_deg": 1.0}} if floor else {}
        found, told = ran(tmp_path, lifted, known)
        ends[floor] = np.mean([c.centre[2] for c in found]) - ring(3)[0].centre[2]
    assert ends[False] > 0.1 and abs(ends[True]) < 0.02
    assert told["metric_fact"][0].startswith("floor: ") and "measured 0.000 ± 0.005 m" in told["metric_fact"][0]


def test_the_tag_says_how_well_its_corners_fit(tmp_path):
    recorded(tmp_path)
    tags = [tag_seen(tmp_path, camera) for camera in ring(3)]
    _, told = ran(tmp_path, scaled(ring(3), 1.0, "apriltag"), tags=tags, taped=False)
    assert [text.partition(":")[0] for text in told["metric_fact"]] == [
        f"corners of the tag in cam0{i}, off by" for i in (1, 2, 3)
    ]
    assert all("px" in text and "again" not in text for text in told["metric_fact"])


def distance(**change):
    return {"keypoint_distance": [{"joints": [SHOULDER, ANKLE], "length_m": 1.0, "sigma_m": 0.01} | change]}


@pytest.mark.parametrize(
    ("known", "points", "message"),
    [
        (distance(joints=["left_sholder", ANKLE]), {}, "keypoint_distance: the detector has no joint 'left_sholder'.*"),
        slow(distance(sequences=[]), {}, "keypoint_distance: left_shoulder, left_ankle .* at 0 instants of the subj"),
        slow({"distances": [{"between": ["cam1", "cam02"], "length_m": 1.0, "sigma_m": 0.1}]}, {},
             "distances: 'cam1' is no close camera of cam01, cam02, cam03 .did you mean 'cam01'"),
        slow({"distances": [{"between": ["cam01", "pots"], "length_m": 1.0, "sigma_m": 0.1}]}, POST,
             "distances: 'pots' is no close camera and marked in fewer than two .*mark it as joint 'pots' .*marks.csv"),
        ({"scale_bar": [{"ends": [["bar_a", "bar_c"]], "length_m": 1.0, "sigma_m": 0.1}]}, BAR,
         "scale_bar: 'bar_c' is marked in fewer than two close cameras .*marks.csv"),
    ],
)  # fmt: skip
def test_a_fact_about_nothing_names_file_key_and_fix(tmp_path, known, points, message):
    recorded(tmp_path)
    with pytest.raises(DiorError, match=f"^session field, session.yaml, {message}"):
        ran(tmp_path, scaled(ring(3), 1.0), known, clicked(tmp_path, points) if points else ())


def test_a_bar_whose_end_only_one_camera_marks_is_refused(tmp_path):
    recorded(tmp_path)
    known = FACTS["scale_bar"][0]
    with pytest.raises(DiorError, match="scale_bar: 'bar_a' is marked in fewer than two close cameras"):
        ran(tmp_path, scaled(ring(3), 1.0), known, clicked(tmp_path, BAR, ring(3)[:1]))


@pytest.mark.slow
def test_each_subject_is_judged_by_their_own_walk_and_height(tmp_path):
    """Two people of 1.75 and 1.40 m; a third of the window without a height is not judged."""
    names, heights = ("walk", "child", "unknown"), (1.75, 1.40, 1.2)
    recorded(tmp_path, names, heights)

    def known(child_m):
        return {"heights": [
            {"subject": "S01", "height_m": 1.75, "sigma_m": 0.01, "sequences": ["walk"]},
            {"subject": "S02", "height_m": child_m, "sigma_m": 0.01, "sequences": ["child"]},
        ]}  # fmt: skip

    ran(tmp_path, scaled(ring(3), 1.0), known(1.40), sequences=names, sigma_m=0.02)
    with pytest.raises(
        DiorError, match=r"session field, child: S02 would be 35 cm smaller than config/subjects.tsv says"
    ):
        ran(tmp_path, scaled(ring(3), 1.0), known(1.75), sequences=names, sigma_m=0.02)
    ran(tmp_path, scaled(ring(3), 1.0), known(1.75), sequences=names, sigma_m=0.02, physics={"stature_share": 0.25})
