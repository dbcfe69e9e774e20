import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest

from dior.body.names import MLKIT_33, PLUG_IN_GAIT_39
from dior.errors import DiorError
from dior.geometry import camera as cam
from dior.ingest import bags, mocap
from dior.ingest.readers import mediapipe
from dior.simulate import backdrop, bystander, config, draw, scene, settings, simulate, simulate_mocap, truth
from dior.simulate.motion import motion_of
from dior.tables import tables
from tests.cases import slow
from tests.simulate.conftest import TINY


@pytest.mark.parametrize("session", ["lab", "field"])
def test_the_simulators_projection_is_the_projects(session):
    points = np.random.default_rng(0).uniform([-2, -2, 0], [2, 2, 2], (500, 3))
    for placed in scene.cameras_of(settings.Settings(), session).values():
        ours, depth = cam.project(placed.camera, points)
        theirs, their_depth = scene.project(placed.camera, points)
        inside = cam.in_frame(placed.camera.intrinsics, theirs)
        assert inside.mean() > 0.3
        assert np.abs(ours - theirs)[inside].max() < 1e-6
        assert np.abs(depth - their_depth).max() < 1e-9


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(tiny, tmp_path):
    _, folder = tiny
    simulate.run(settings=TINY, sequence="outdoor_01", out=tmp_path / "same")
    simulate.run(settings=TINY | {"seed": 2}, sequence="outdoor_01", out=tmp_path / "other")

    def hashes(root):
        files = sorted(p for p in root.rglob("*") if p.is_file() and "outdoor_01" in p.parts)
        return {p.relative_to(root).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}

    same, other, first = (hashes(root) for root in (tmp_path / "same", tmp_path / "other", folder))
    assert same == first and len(first) == 12
    # the long-range camera sees nobody, whatever the seed; its stamps differ
    assert all(first[name] != other[name] for name in first)


def test_mocap_has_the_same_bytes_and_is_the_truth(tiny, tmp_path):
    used, folder = tiny
    simulate_mocap.run(settings=TINY, sequence="indoor_01", out=tmp_path)
    path = folder / "indoor_01/mocap.c3d"
    assert path.read_bytes() == (tmp_path / "indoor_01/mocap.c3d").read_bytes()
    found = mocap.read(path)
    assert found.rate == 100.0 and set(found.markers) == set(PLUG_IN_GAIT_39)
    true = tables.read(folder / "truth/indoor_01/skeletons_3d.parquet", "skeletons_3d")
    points, joints = tables.grid(true, "x", "y", "z")
    error = found.points - points[:, [joints.index(name) for name in found.markers]]
    assert error.std() == pytest.approx(used.mocap_noise_mm / 1000, rel=0.05)


def test_the_truth_says_when_feet_touch_the_floor(tiny):
    _, folder = tiny
    for walk in ("indoor_01", "outdoor_01"):
        true = tables.read(folder / f"truth/{walk}/contacts.parquet", "contacts")
        points, joints = tables.grid(tables.read(folder / f"truth/{walk}/skeletons_3d.parquet", "skeletons_3d"), *"xyz")
        stamps = np.unique(tables.read(folder / f"truth/{walk}/skeletons_3d.parquet", "skeletons_3d")["stamp_ns"])
        strikes = true["event"] == "heel_strike"
        assert strikes.any() and (true["stamp_ns"] >= stamps[0]).all() and (true["stamp_ns"] <= stamps[-1]).all()
        for foot, when, x, y in zip(*(true[key][strikes] for key in ("foot", "stamp_ns", "x", "y")), strict=True):
            # a tenth of a second later the foot stands
            frame = np.searchsorted(stamps, when + 100_000_000)
            if frame < len(stamps):
                heel = points[frame, joints.index(f"{foot}_heel")]
                assert np.linalg.norm(heel[:2] - (x, y)) < 0.02 and heel[2] < 0.06


def test_the_truth_says_joint_angles(tiny):
    _, folder = tiny
    for walk in ("indoor_01", "outdoor_01"):
        true = tables.read(folder / f"truth/{walk}/angles.parquet", "simulated_angles")
        points, joints = tables.grid(tables.read(folder / f"truth/{walk}/skeletons_3d.parquet", "skeletons_3d"), *"xyz")
        stamps = np.unique(tables.read(folder / f"truth/{walk}/skeletons_3d.parquet", "skeletons_3d")["stamp_ns"])
        knee = true["angle"] == "knee_angle_r"
        np.testing.assert_array_equal(true["stamp_ns"][knee], stamps)
        hip, at, ankle = (points[:, joints.index(f"right_{part}")] for part in ("hip", "knee", "ankle"))
        cosine = ((at - hip) * (ankle - at)).sum(axis=1)
        cosine = cosine / np.linalg.norm(at - hip, axis=1) / np.linalg.norm(ankle - at, axis=1)
        np.testing.assert_allclose(true["value"][knee], np.rad2deg(np.arccos(cosine)), atol=0.05)


def test_detections_are_the_truth_plus_the_noise_they_say(tiny):
    used, folder = tiny
    true = tables.read(folder / "truth/outdoor_01/labels_2d.parquet", "labels_2d")
    done = tables.read(folder / "truth/outdoor_01/detections.parquet", "simulated_detections")
    for camera in ("cam01", "cam02", "cam03"):
        uv, joints = tables.grid(tables.of_camera(true, camera), "u", "v")
        noise, _ = tables.grid(tables.of_camera(done, camera), "noise_u", "noise_v")
        assert tuple(joints) == MLKIT_33
        lines = (folder / f"outdoor_01/mlkit/{camera}.jsonl").read_text().splitlines()
        assert len(lines) == 60
        written = np.array([[[p["x"], p["y"]] for p in json.loads(line)["landmarks"]] for line in lines])
        assert np.abs(written - uv - noise).max() < 0.006
        assert noise.std() == pytest.approx(used.detector.noise_px, rel=0.05)
        assert abs(noise.mean()) < 0.1
    far = (folder / "outdoor_01/mlkit/cam04.jsonl").read_text().splitlines()
    assert len(far) == 60 and all(json.loads(line)["landmarks"] == [] for line in far)


def test_the_bags_hold_what_a_lab_records(tiny):
    used, folder = tiny
    topics = bags.topics_of(folder / "outdoor_01/pc2.bag")
    assert {topic: count for topic, (_, count) in topics.items()} == {
        f"/{camera}/color/{what}": 60
        for camera in ("cam03", "cam04")
        for what in ("image_raw/compressed", "camera_info")
    }
    info = bags.read_camera_info([folder / "outdoor_01/pc2.bag"], "/cam03/color/image_raw/compressed")
    lens = scene.cameras_of(used, "field")["cam03"].camera.intrinsics
    assert (info.width, info.height) == (640, 360)
    assert np.ravel(info.K)[[0, 4, 2, 5]] == pytest.approx([lens.fx, lens.fy, lens.cx, lens.cy])
    assert np.ravel(info.D) == pytest.approx(lens.distortion[:5])


def test_the_person_60_m_away_is_20_to_25_px_tall():
    used = settings.from_dict({"duration_s": 2.0})
    for name in ("outdoor_01", "outdoor_03"):
        walk = settings.sequence_named(used, name)
        seen = truth.view(used, walk, motion_of(used, walk), "cam04")
        tall = seen.uv[..., 1].max(axis=1) - seen.uv[..., 1].min(axis=1)
        assert 18.5 < np.median(tall) and tall.max() < 26


@pytest.mark.parametrize(
    "name, camera", [slow("indoor_01", "cam02"), slow("outdoor_01", "cam03"), ("outdoor_01", "cam04")]
)
def test_the_drawn_body_covers_the_labels(name, camera):
    import cv2

    used = settings.from_dict({"duration_s": 3.0, "jpeg_quality": 95})
    walk = settings.sequence_named(used, name)
    motion = motion_of(used, walk)
    seen = truth.view(used, walk, motion, camera)
    empty = backdrop.background(used, seen.camera, walk.environment).astype(int)
    other = bystander.seen(used, walk, seen.camera, seen.clock.seconds)
    painter = simulate.painter(used, walk, motion.height, seen, other)
    covered = []
    for frame in range(0, 90, 15):
        picture = cv2.imdecode(painter(frame), cv2.IMREAD_COLOR).astype(int)
        body = (np.abs(picture - empty).max(axis=-1) > 12).astype(np.uint8)
        # a label on the outline of an antialiased body 20 px tall may round to the pixel beside it
        body = cv2.dilate(body, np.ones((3, 3), np.uint8))
        own = [i for i, joint in enumerate(seen.joints) if joint in MLKIT_33]
        at = np.round(seen.uv[frame, own][seen.status[frame, own] == "ok"]).astype(int)
        covered += body[at[:, 1], at[:, 0]].tolist()
    assert len(covered) > 60
    assert np.mean(covered) >= 0.95


def test_some_joints_are_hidden_behind_the_body_and_not_all(tiny):
    _, folder = tiny
    true = tables.read(folder / "truth/outdoor_01/labels_2d.parquet", "labels_2d")
    close = tables.rows(true, true["camera"] != "cam04")
    share = np.mean(close["status"] == "occluded")
    assert 0.05 < share < 0.6


def outdoors(**keys):
    """Settings of one walk outdoors, the walk, its motion and what the long-range camera sees of it."""
    used = settings.from_dict({"environments": ["outdoor"], "sequences": 1, "subjects": 1, **keys})
    walk = settings.sequence_named(used, "outdoor_01")
    motion = motion_of(used, walk)
    return used, walk, motion, truth.view(used, walk, motion, "cam04")


def drawn_boxes(used, walk):
    """Frames (F,) and edges (F, 4) px of the boxes in the config."""
    rows = np.array([line.split(",") for line in config._boxes(used, walk).splitlines()[1:]], float)
    return rows[:, 0].astype(int), rows[:, 1:]


@pytest.mark.parametrize("around", [slow("body"), "joints"])
def test_boxes_are_as_large_and_as_rough_as_they_say(around):
    used, walk, motion, seen = outdoors(duration_s=40.0, box_around=around)
    frames, edges = drawn_boxes(used, walk)
    if around == "joints":
        uv = seen.uv[frames]
        tight = np.concatenate([uv.min(axis=1), uv.max(axis=1)], axis=1)
    else:
        tight = rendered_boxes(seen, motion, frames, walk)
    grown = (edges - tight) * (-1, -1, 1, 1)
    assert grown.mean() == pytest.approx(used.box_margin_px, abs=0.15)
    assert grown.std() == pytest.approx(used.box_sd_px, rel=0.12)


def rendered_boxes(seen, motion, frames, walk, worn="plain", times=48):
    """Boxes (F, 4) px of what is painted where the picture is so many times larger."""
    lens = seen.camera.intrinsics
    size, scaled = np.array([40, 40]) * times, {k: getattr(lens, k) * times for k in ("fx", "fy")}
    found = []
    for frame in frames:
        corner = np.floor(seen.uv[frame].mean(axis=0)) - (20, 20)
        centre = {k: (getattr(lens, k) - c + 0.5) * times - 0.5 for k, c in zip(("cx", "cy"), corner, strict=True)}
        window = replace(lens, width=int(size[0]), height=int(size[1]), **scaled, **centre)
        near = replace(seen.camera, intrinsics=window)
        points = draw.figure(seen.landmarks[frame : frame + 1], motion.height)
        drawing = draw.outlines(near, points, motion.height, walk.outfit, walk.subject, worn)
        picture = np.zeros((size[1], size[0], 3), np.uint8)
        draw.paint(picture, drawing, 0)
        body = picture.max(axis=-1) > 0
        v, u = np.flatnonzero(body.any(axis=1)), np.flatnonzero(body.any(axis=0))
        ends = np.array([u[0], v[0], u[-1] + 1, v[-1] + 1])
        found.append(np.tile(corner, 2) - 0.5 + ends / times)
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize("worn", ["plain", "dressed"])
def test_a_box_without_error_is_that_of_the_painted_body(worn):
    used, walk, motion, seen = outdoors(duration_s=8.0, box_sd_px=0.0, box_margin_px=0.0, figure=worn)
    frames, edges = drawn_boxes(used, walk)
    # OpenCV paints an edge a pixel or two of the enlarged picture further out
    np.testing.assert_allclose(edges, rendered_boxes(seen, motion, frames, walk, worn), atol=0.05)


@pytest.mark.slow
def test_the_second_figure_is_larger_all_around():
    plain, dressed = (
        drawn_boxes(*outdoors(duration_s=30.0, box_sd_px=0.0, box_margin_px=0.0, figure=worn)[:2])[1]
        for worn in ("plain", "dressed")
    )
    grown = ((dressed - plain) * (-1, -1, 1, 1)).mean(axis=0)
    # hair and soles of some centimetres, at 12.7 px/m
    assert (grown[[1, 3]] > 0.1).all() and (grown[[1, 3]] < 0.6).all() and (grown[[0, 2]] > 0.2).all()


def test_behind_a_wall_the_box_ends_at_the_wall():
    used, walk, _, seen = outdoors(duration_s=8.0, box_sd_px=0.0, box_margin_px=0.0, occluder=True)
    _, edges = drawn_boxes(used, walk)
    _, whole = drawn_boxes(replace(used, occluder=False), walk)
    wall = backdrop.in_front(used, seen.camera, walk.environment)[..., 0]
    # the wall's highest row above each box; the box ends there, to a sixteenth of a pixel and the slope of the wall
    for box, plain in zip(edges, whole, strict=True):
        columns = wall[:, int(plain[0]) : int(plain[2]) + 1]
        top = columns.argmax(axis=0)
        assert top.min() - 0.5 - 0.07 <= box[3] <= top.max() - 0.5 + 0.07 and box[3] < plain[3] - 5
        assert box[1] == plain[1]


def test_a_habit_is_the_same_in_every_box():
    plain, unequal = (drawn_boxes(*outdoors(duration_s=10.0, box_habit_px=habit)[:2])[1] for habit in (0.0, 1.0))
    moved = unequal - plain
    np.testing.assert_allclose(moved, moved[:1].repeat(len(moved), axis=0), atol=0.011)
    assert np.abs(moved).max() > 0.3


def test_a_wrong_key_is_refused_with_the_nearest():
    for section, words in (({"duraton_s": 3}, "duration_s"), ({"detector": {"nois_px": 1}}, "noise_px")):
        with pytest.raises(DiorError, match=f"did you mean '{words}'"):
            settings.from_dict(section)
    with pytest.raises(DiorError, match="no sequence 'outdoor_9'"):
        settings.sequence_named(settings.Settings(), "outdoor_9")
    with pytest.raises(DiorError, match="duration_s"):
        settings.from_dict({"duration_s": -1})


def test_a_short_c3d_is_refused(shared):
    used = settings.from_dict({"motion": str(shared / "mocap/walk_100hz.c3d"), "duration_s": 10.0})
    with pytest.raises(DiorError, match="lasts 3.14 s"):
        motion_of(used, settings.sequence_named(used, "indoor_01"))


def test_a_second_person_who_walks_passes_beside_the_walkway():
    used = settings.from_dict({"bystander": 0.5, "bystander_walks": True, "duration_s": 4.0})
    walk = settings.sequences(used)[-1]
    seen = truth.view(used, walk, motion_of(used, walk), "cam01")
    other = bystander.seen(used, walk, seen.camera, seen.clock.seconds)
    hips = other.landmarks[:, MLKIT_33.index("left_hip")]
    assert np.ptp(hips[:, 0]) > 1.0 and np.abs(hips[:, 1] - bystander.LOOP_AT[1]).max() < 1.0
    assert other.present.mean() == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("level", ["ideal", pytest.param("real", marks=pytest.mark.slow)])
def test_a_detector_of_everybody_gives_both_people_where_the_truth_has_them(tmp_path, level):
    used = settings.from_dict(
        {"subjects": 1, "sequences": 1, "environments": ["outdoor"], "duration_s": 0.7, "bystander": 0.6,
         "detector": {"level": level, "everybody": True, "missed": 0.0, "swapped": 0.0}}
    )  # fmt: skip
    (walk,) = settings.sequences(used)
    motion = motion_of(used, walk)
    views, others = simulate.observe(used, walk, motion)
    simulate.write_detections(used, walk, motion.height, views, others, tmp_path)
    truth_of = [
        tables.read(tmp_path / f"truth/{walk.name}/{name}labels_2d.parquet", "labels_2d") for name in ("", "second_")
    ]
    found = mediapipe.read(tmp_path / settings.detections_path(used, walk.name).format(camera="cam01"))
    size = np.array([used.width, used.height])
    frames = len(found.ran)
    subject, second = (tables.grid(tables.of_camera(true, "cam01"), "u", "v")[0] for true in truth_of)
    there = np.isfinite(second[..., 0]).any(axis=1)
    assert there.mean() == pytest.approx(0.6, abs=0.1) and np.bincount(found.frame, minlength=frames).max() == 2
    assert (np.bincount(found.frame, minlength=frames) == 1 + there).all()
    uv = found.uv * size - 0.5
    off = [np.linalg.norm(uv - true[found.frame], axis=-1).mean(axis=1) for true in (subject, second)]
    near = np.stack(off) < (6.0 if level == "ideal" else 30.0)
    # each is one of the two, and neither is there twice
    assert (near.sum(axis=0) == 1).all() and near[0].sum() == frames and near[1].sum() == there.sum()
    body = tables.read(tmp_path / f"truth/{walk.name}/second_skeletons_3d.parquet", "skeletons_3d")
    known = body["status"] == "ok"
    assert known.mean() == pytest.approx(0.6, abs=0.1) and set(body["subject"]) == {bystander.SUBJECT}
    assert (np.isfinite(body["x"]) == known).all() and 1.4 < body["z"][known].max() < 1.9
