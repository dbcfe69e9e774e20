"""Level `real`: the stamps and losses in the bags, the gaps of the C3D, the pictures, measured on the files."""

import hashlib

import numpy as np
import pytest

from dior.geometry import camera as cam
from dior.ingest import bags, mocap
from dior.simulate import backdrop, scene, simulate, simulate_gallery, simulate_mocap, truth
from dior.simulate.body import Body
from dior.simulate.clocks import clocks_of
from dior.simulate.gait import Walker
from dior.simulate.motion import motion_of
from dior.simulate.patterns import RUN
from dior.simulate.settings import CAMERAS, COMPUTERS, from_dict, sequence_named
from dior.tables import tables
from tests.simulate.test_real import lengths_of, within

pytestmark = pytest.mark.slow

# pictures of the size of a stamp: only their stamps count
SMALL = {"preset": "real", "subjects": 1, "sequences": 1, "width": 64, "height": 36, "fx": 32.0, "duration_s": 20.0}
OFTEN = {"dropped": 0.05, "duplicated": 0.02, "late_stamps": 0.03, "late_arrivals": 0.03, "drift_ppm": 40.0}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Bags and C3D of 20 s: settings, sequence, folder."""
    out = tmp_path_factory.mktemp("recorded")
    words = SMALL | {"clocks": OFTEN}
    simulate.run(settings=words, sequence="indoor_01", out=out)
    simulate_mocap.run(settings=words, sequence="indoor_01", out=out)
    used = from_dict(words)
    return used, sequence_named(used, "indoor_01"), out


def stamps_of(out, camera):
    """Header and receive stamps of a camera's messages in the order of the bag."""
    computer = next(name for name, group in COMPUTERS.items() if camera in group)
    index = bags.index(out / f"indoor_01/{computer}.bag", [f"/{camera}/color/image_raw/compressed"])
    order = np.lexsort((index["stamp_ns"], index["receive_ns"]))
    return index["stamp_ns"][order], index["receive_ns"][order]


def test_drops_and_repeats_are_as_many_as_asked_for(recorded):
    used, walk, out = recorded
    recorded_pictures, messages, gaps = 0, 0, []
    for camera in CAMERAS:
        stamps, receive = stamps_of(out, camera)
        assert (np.diff(receive) >= 0).all()
        unique = np.unique(stamps)
        messages += len(stamps)
        recorded_pictures += len(unique)
        gaps.append(np.round(np.diff(unique) / 1e9 * used.fps).astype(int) - 1)
        assert unique.tolist() == clocks_of(used, walk)[0][camera].stamp_ns.tolist()
    made = 4 * 600
    assert within(1 - recorded_pictures / made, 0.05, made)
    assert within((messages - recorded_pictures) / recorded_pictures, 0.02, recorded_pictures)
    assert abs(np.concatenate(gaps).sum() - (made - recorded_pictures)) <= 8  # but for the ends


def test_stamps_jitter_are_late_and_drift_as_asked_for(recorded):
    used, walk, out = recorded
    true = tables.read(out / "truth/indoor_01/cameras.parquet", "cameras")
    clocks, t0 = clocks_of(used, walk)
    jitter, late, held = [], [], []
    for camera in CAMERAS:
        stamps, receive = stamps_of(out, camera)
        clock = clocks[camera]
        i = list(true["camera"]).index(camera)
        by_stamp = (np.unique(stamps) - t0) / 1e9 * (1 + 1e-6 * true["drift_ppm"][i]) + true["offset_s"][i]
        error = (by_stamp - clock.seconds) * 1e3
        # without the error pictures are taken at an even pace
        pace = np.diff(clock.seconds) * used.fps
        assert np.allclose(pace, np.round(pace), atol=1e-4)
        calm = np.abs(error) < 4 * used.clocks.jitter_ms
        jitter.append(error[calm])
        late.append(~calm)
        held.append((receive - stamps) / 1e6)
        assert error.max() < 1e3 / used.fps
    jitter, late, held = np.concatenate(jitter), np.concatenate(late), np.concatenate(held)
    assert jitter.std() == pytest.approx(used.clocks.jitter_ms, rel=0.05) and abs(jitter.mean()) < 0.05
    # of the exponential times of 8 ms those above 2 ms show
    assert within(late.mean(), 0.03 * np.exp(-2 / 8), len(late))
    assert held.min() >= -30 and np.mean(held > 20) > 0.01
    assert 10 < np.std(true["drift_ppm"]) < 120
    delay = true["offset_s"] * used.fps
    assert delay.min() > 11 and delay.max() < 17


def test_the_c3d_has_the_gaps_asked_for_and_soft_tissue(recorded):
    used, walk, out = recorded
    found = mocap.read(out / "indoor_01/mocap.c3d")
    assert found.rate == 120.0
    lost = np.isnan(found.points[..., 0])
    low, high = used.mocap_gap_ticks
    assert within(lost.mean(), used.mocap_gaps, lost.size / 22.5 / 1.2)
    lengths = np.concatenate([lengths_of(column) for column in lost.T])
    assert lengths.min() >= low and lengths.max() <= high
    assert abs(lengths.mean() - 22.5) < 4 * 10.4 / np.sqrt(len(lengths))
    seconds = np.arange(len(found.points)) / found.rate
    firm = motion_of(from_dict(SMALL | {"soft_tissue_mm": [0.0, 0.0]}), walk).at(seconds)[1]
    joints = motion_of(used, walk).names
    slip = found.points - firm[:, [joints.index(name) for name in found.markers]]
    rms_mm = 1e3 * np.sqrt(np.nanmean((slip**2).sum(axis=-1), axis=0))
    assert 4.7 < rms_mm.min() < 6 and 9 < rms_mm.max() < 10.3
    smooth = np.nanmax(np.linalg.norm(np.diff(slip, axis=0), axis=-1)) * found.rate
    assert smooth < 0.35  # m/s, the noise of 0.2 mm included
    true = tables.read(out / "truth/indoor_01/skeletons_3d.parquet", "skeletons_3d")
    points, names = tables.grid(true, "x", "y", "z")
    error = found.points - points[:, [names.index(name) for name in found.markers]]
    # the truth is where the marker is, also where the motion capture has lost it
    assert np.nanstd(error) == pytest.approx(used.mocap_noise_mm / 1e3, rel=0.05) and np.isfinite(points).all()


def test_camera_info_is_wrong_by_as_much_as_asked_for(recorded):
    used, walk, out = recorded
    for camera in CAMERAS:
        computer = next(name for name, group in COMPUTERS.items() if camera in group)
        info = bags.read_camera_info([out / f"indoor_01/{computer}.bag"], f"/{camera}/color/image_raw/compressed")
        lens = scene.cameras_of(used, walk.session)[camera].camera.intrinsics
        fx, _, cx, _, fy, cy, *_ = np.ravel(info.K)
        assert abs(fx / lens.fx - 1) == pytest.approx(0.003, rel=0.01)
        assert abs(fy / lens.fy - 1) == pytest.approx(0.003, rel=0.01)
        assert np.hypot(cx - lens.cx, cy - lens.cy) == pytest.approx(0.003 * lens.fx, rel=0.01)


def test_the_same_settings_give_the_same_files_at_level_real(tmp_path):
    words = SMALL | {"duration_s": 1.0}
    for name in ("a", "b"):
        for step in (simulate, simulate_gallery):
            step.run(settings=words, sequence="outdoor_01", out=tmp_path / name)
    first, second = (
        {p.relative_to(root): hashlib.sha256(p.read_bytes()).hexdigest() for p in root.rglob("*") if p.is_file()}
        for root in (tmp_path / "a", tmp_path / "b")
    )
    assert first == second and len(first) == 12 + 72


def test_the_wall_hides_the_lower_half_from_afar_only():
    used = from_dict({"preset": "real", "duration_s": 2.0, "bystander": 0.0})
    bare = from_dict({"preset": "real", "duration_s": 2.0, "bystander": 0.0, "occluder": False})
    walk = sequence_named(used, "outdoor_01")
    motion = motion_of(used, walk)
    for camera in CAMERAS:
        with_wall, without = (truth.view(s, walk, motion, camera).status for s in (used, bare))
        hidden = (with_wall == "occluded") & (without != "occluded")
        assert hidden.any() == (camera == scene.LONG_RANGE)
    feet, head = [with_wall.shape[1] - 1, with_wall.shape[1] - 2], [0]
    assert (with_wall[:, feet] == "occluded").all() and not (hidden[:, head]).any()
    # what is hidden is not painted
    seen = truth.view(used, walk, motion, scene.LONG_RANGE)
    mask = backdrop.in_front(used, seen.camera, "outdoor")[..., 0]
    at = np.round(seen.uv[0, feet]).astype(int)
    assert mask[at[:, 1], at[:, 0]].all() and 0.001 < mask.mean() < 0.01


def test_the_sun_is_saturated_in_the_long_range_picture():
    used = from_dict({"preset": "real"})
    placed = scene.cameras_of(used, "field")
    discs = {
        name: (backdrop.background(used, p.camera, "outdoor").min(axis=-1) == 255).sum() for name, p in placed.items()
    }
    assert 500 < discs.pop(scene.LONG_RANGE) < 20_000 and not discs["cam03"]


def test_a_runner_flies_and_stays_whole():
    rate = 200
    body = Body(1.75)
    runner = Walker(body, RUN, speed=2.3, half_length=1.25, turn_radius=0.8)
    times = np.arange(0, 10, 1 / rate)
    segments = runner.segments(times)
    clearance, still = [], []
    for side in ("left", "right"):
        ankle, axes = segments[f"{side}_foot"]
        soles = [(ankle + axes @ np.array([p[0], 0.0, p[1]])) for p in (body.heel, body.ball)]
        clearance.append(np.minimum(soles[0][:, 2], soles[1][:, 2]))
        still.append(np.linalg.norm(np.gradient(soles[1], 1 / rate, axis=0), axis=-1) < 0.2)
    assert np.min(clearance) > -0.005
    assert 0.15 < (np.minimum(*clearance) > 0.002).mean() < 0.5
    assert not (still[0] & still[1]).any()  # no double support
    assert 0.15 < np.mean(still) < 0.4
    landmarks, markers = runner.at(times)
    for points in (landmarks, markers):
        acceleration = np.gradient(np.gradient(points, 1 / rate, axis=0), 1 / rate, axis=0)
        assert np.linalg.norm(acceleration, axis=-1).max() < 400
    knee = np.linalg.norm(segments["left_shank"][0] - segments["left_thigh"][0], axis=-1)
    assert np.ptp(knee) < 1e-9


def test_a_runner_is_faster_than_a_walker_and_in_view_of_all_cameras():
    used = from_dict({"preset": "real", "walks": ["running"], "duration_s": 8.0, "bystander": 0.0})
    walk = sequence_named(used, "outdoor_01")
    motion = motion_of(used, walk)
    hips = motion.at(np.arange(0, 8, 0.01))[0][:, 23]
    assert 1.3 < np.linalg.norm(np.gradient(hips, 0.01, axis=0), axis=-1).mean() < 3.0
    for camera in CAMERAS:
        seen = truth.view(used, walk, motion, camera)
        assert np.isin(seen.status, ("ok", "occluded")).mean() > 0.97
        assert cam.in_frame(seen.camera.intrinsics, seen.uv).mean() > 0.97
