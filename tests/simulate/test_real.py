"""Level `real`: what the files hold is what the settings say, measured on the files."""

import json

import numpy as np
import pytest

from dior.body.names import MLKIT_33, swap_index
from dior.project import project
from dior.simulate import config, settings, simulate
from dior.simulate.detector_real import ar1, view_side
from dior.simulate.motion import motion_of
from dior.simulate.runs import runs
from dior.simulate.settings import from_dict, sequence_named
from dior.tables import tables

pytestmark = pytest.mark.slow

CLOSE = ("cam01", "cam02", "cam03")
MIRROR = swap_index(MLKIT_33)
# rates high enough for a minute to hold enough runs
OFTEN = {"swapped": 0.2, "missed": 0.08, "wrong_together": 0.1}
LONG = {"preset": "real", "subjects": 1, "sequences": 1, "duration_s": 60.0, "bystander": 0.4, "detector": OFTEN}


def within(found, wanted, count, sigmas=4.0):
    """Whether a share of `count` independent samples is `wanted`, give or take."""
    return abs(found - wanted) <= sigmas * np.sqrt(wanted * (1 - wanted) / count) + 1e-12


def lengths_of(flags):
    """Lengths of the runs of True that neither end touches."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    begin, end = edges[::2], edges[1::2]
    whole = (begin > 0) & (end < len(flags))
    return (end - begin)[whole]


def test_runs_have_the_share_and_the_lengths_asked_for():
    random = np.random.default_rng(0)
    run = runs(random, 400_000, 0.05, (5, 40))
    lengths = lengths_of(run >= 0)
    # a run of mean 22.5 and sd 10.4 counts as one sample of its share
    assert within(np.mean(run >= 0), 0.05, 400_000 / 22.5 / 1.2)
    assert lengths.min() == 5 and lengths.max() == 40 and abs(lengths.mean() - 22.5) < 4 * 10.4 / np.sqrt(len(lengths))
    assert len(np.unique(run)) - 1 == run.max() + 1
    assert (runs(random, 50, 0.0, (5, 40)) == -1).all()


def test_noise_keeps_its_sd_and_memory_where_pictures_are_missing():
    seconds = np.cumsum(np.random.default_rng(1).choice([1 / 30, 2 / 30, 0.2], 60_000))
    noise = ar1(np.random.default_rng(2), seconds, (60_000, 2), 3.0, 0.15, 5.0)
    assert noise.std() == pytest.approx(3.0, rel=0.02)
    step = np.diff(seconds)
    for dt in (1 / 30, 2 / 30, 0.2):
        at = np.isclose(step, dt)
        assert np.mean(noise[1:][at] * noise[:-1][at]) / 9 == pytest.approx(np.exp(-dt / 0.15), abs=0.03)


@pytest.fixture(scope="module")
def minute(tmp_path_factory):
    """A minute outdoors: settings, sequence, motion and views; true pixels, written pixels and scores, and what was
    done, by camera."""
    out = tmp_path_factory.mktemp("minute")
    used = from_dict(LONG)
    walk = sequence_named(used, "outdoor_01")
    motion = motion_of(used, walk)
    views, others = simulate.observe(used, walk, motion)
    simulate.write_detections(used, walk, motion.height, views, others, out)
    true = tables.read(out / "truth/outdoor_01/labels_2d.parquet", "labels_2d")
    done = tables.read(out / "truth/outdoor_01/detections.parquet", "simulated_detections")
    found = {}
    for camera in CLOSE:
        uv, joints = tables.grid(tables.of_camera(true, camera), "u", "v")
        assert tuple(joints) == MLKIT_33
        rows = tables.of_camera(done, camera)
        flags = {key: values.reshape(uv.shape[:2]) for key, values in rows.items()}
        lines = [json.loads(line) for line in (out / f"outdoor_01/mlkit/{camera}.jsonl").read_text().splitlines()]
        clock = views[camera].clock
        assert [line["stamp_ns"] for line in lines] == clock.stamp_ns[clock.messages].tolist()
        written = np.full((*uv.shape[:2], 3), np.nan)
        for i, line in enumerate(lines):
            if line["landmarks"]:
                written[i] = [[p["x"], p["y"], p["inFrameLikelihood"]] for p in line["landmarks"]]
        # a picture that is recorded twice is two equal frames; once is enough for what follows
        repeated = np.flatnonzero(np.diff(clock.messages) == 0)
        assert len(repeated) == clock.twice.sum() > 0
        assert np.array_equal(written[repeated], written[repeated + 1], equal_nan=True)
        once = clock.frame_numbers
        found[camera] = (uv[once], written[once], {key: values[once] for key, values in flags.items()})
    return used, walk, motion, views, others, found


def test_every_detection_is_the_truth_and_what_was_done_to_it(minute):
    *_, found = minute
    for uv, written, done in found.values():
        source = done["swapped"] ^ done["wrong_together"]
        true = np.where(source[..., None], uv[:, MIRROR], uv)
        error = np.stack([done[f"noise_{a}"] + done[f"bias_{a}"] for a in "uv"], axis=-1)
        mine = ~done["missed"] & ~done["bystander"]
        assert np.abs(written[..., :2] - true - error)[mine].max() < 0.01
        assert np.isnan(written[done["missed"]]).all() and np.isfinite(written[~done["missed"]]).all()
        assert np.isnan(error[~mine]).all() and np.isfinite(error[mine]).all()
        assert not (done["bystander"] & (done["swapped"] | done["guessed"] | done["wrong_together"])).any()


def test_the_noise_of_the_files(minute):
    used, _, _, views, _, found = minute
    sds, kurtosis, products, lags = [], [], [], []
    for camera, (_, _, done) in found.items():
        noise = np.stack([done["noise_u"], done["noise_v"]], axis=-1).astype(float)
        plain = ~done["swapped"].any(axis=1)
        sds += [np.nanstd(noise[plain], axis=0)]
        kurtosis.append(np.nanmean(noise[plain] ** 4, axis=0) / np.nanmean(noise[plain] ** 2, axis=0) ** 2)
        seconds = views[camera].clock.seconds
        for step in (1, 3):
            both = plain[step:] & plain[:-step] & np.isclose(seconds[step:] - seconds[:-step], step / 30, atol=1e-4)
            scale = np.nanvar(noise[plain], axis=0)
            products.append(np.nanmean((noise[step:] * noise[:-step])[both] / scale))
            lags.append(step / 30)
    sds = np.array(sds)
    # 60 s hold 200 independent samples of a noise of 0.15 s memory: a joint's sd is known to 6 %
    assert 2.5 * 0.8 < sds.min() and sds.max() < 3.5 * 1.25
    assert sds.mean() == pytest.approx(np.mean(used.detector.noise_sd_px), rel=0.03)
    assert np.mean(kurtosis) > 3.5
    for lag, product in zip(lags, products, strict=True):
        assert product == pytest.approx(np.exp(-lag / used.detector.noise_time_s), abs=0.04)


def test_offsets_are_constant_per_joint_and_side(minute):
    used, _, motion, views, _, found = minute
    table = {}
    for camera, (_, _, done) in found.items():
        seen = views[camera]
        size = seen.camera.intrinsics.fx * motion.height / seen.depth[:, 23:25].mean(axis=1)
        side = view_side(seen.landmarks, seen.camera)
        plain = ~(done["swapped"] | done["guessed"] | done["bystander"] | done["missed"])
        for axis in "uv":
            offset = done[f"bias_{axis}"] / size[:, None]
            for i, k in zip(*np.nonzero(plain), strict=True):
                table.setdefault((side[i], k, axis), []).append(offset[i, k])
    assert {key[0] for key in table} == {0, 1, 2, 3}
    assert max(np.ptp(values) for values in table.values()) < 1e-6
    # 264 normal numbers have an rms that is known to 4.4 %
    rms = np.sqrt(2 * np.mean([values[0] ** 2 for values in table.values()]))
    assert len(table) > 200 and rms == pytest.approx(used.detector.bias, rel=0.18)


def test_hidden_joints_are_guessed_worse_and_with_less_confidence(minute):
    used, *_, views, _, found = minute
    for camera, (_, written, done) in found.items():
        hidden = views[camera].status == "occluded"
        mine = ~done["missed"] & ~done["bystander"]
        moved = np.where(done["swapped"], hidden[:, MIRROR], hidden)
        assert (done["guessed"] == (moved & mine)).all()
        bias = np.hypot(done["bias_u"], done["bias_v"])
        assert np.nanmean(bias[done["guessed"]]) > 1.5 * np.nanmean(bias[mine & ~moved])
        low, high = used.detector.score_guessed
        score = written[..., 2][done["guessed"]]
        assert low <= score.min() and score.max() <= high and abs(score.mean() - (low + high) / 2) < 0.02


def test_pictures_go_wrong_as_often_and_as_long_as_asked_for(minute):
    used, _, _, _, others, found = minute
    wanted = used.detector
    share = {"swapped": [], "missed": []}
    for _, _, done in found.values():
        for key, frames in share.items():
            frames.append(done[key].any(axis=1) & ~done["bystander"].any(axis=1))
    hidden = np.concatenate([done["missed"].any(axis=1) for *_, done in found.values()])
    swapped = np.concatenate(share["swapped"])[~hidden]
    # a run is one sample: mean length, times 1 + cv^2 for unequal ones
    assert within(swapped.mean(), wanted.swapped, len(swapped) / 22.5 / 1.2)
    assert within(hidden.mean(), wanted.missed, len(hidden) / 3.0 / 1.2)
    for frames in share["missed"]:
        assert set(lengths_of(frames)) == {1, 2, 3, 4, 5}
    lengths = np.concatenate([lengths_of(frames) for frames in share["swapped"]])
    assert lengths.max() <= 40 and len(lengths) > 10
    legs = [
        not done["swapped"][frame, MLKIT_33.index("left_wrist")]
        for (_, _, done), frames in zip(found.values(), share["swapped"], strict=True)
        for frame in np.flatnonzero(np.diff(frames.astype(int)) == 1) + 1
    ]
    assert within(np.mean(legs), wanted.swapped_legs, len(legs))
    present = np.concatenate([other.present for camera, other in others.items() if camera in CLOSE])
    assert present.mean() == pytest.approx(used.bystander, abs=0.01)
    for camera, (_, _, done) in found.items():
        taken = done["bystander"].any(axis=1)
        assert not (taken & ~others[camera].present).any()
    taken = np.concatenate([done["bystander"].any(axis=1) for *_, done in found.values()])
    assert 0.4 * wanted.taken < taken.sum() / present.sum() < 1.6 * wanted.taken


def test_two_views_take_the_same_limb_for_the_other_at_a_time(minute):
    used, _, _, views, _, found = minute
    start = min(views[camera].clock.seconds[0] for camera in found)
    wrong = np.zeros((3, 1830, 33), bool)
    for i, (camera, (_, _, done)) in enumerate(found.items()):
        tick = ((views[camera].clock.seconds - start) * used.fps).astype(int)
        wrong[i, tick] = np.where(done["swapped"], done["wrong_together"][:, MIRROR], done["wrong_together"])
    cameras = wrong.any(axis=2).sum(axis=0)
    assert cameras.max() == 2
    assert (cameras[cameras > 0] == 2).mean() > 0.6  # the others: nobody found, or a picture dropped
    assert within((cameras > 0).mean(), used.detector.wrong_together, 1800 / 12.5 / 1.2)
    assert wrong.any(axis=0).sum(axis=1).max() <= 5


def test_the_real_config_is_a_valid_project_and_written_the_same_twice(tmp_path):
    used = from_dict({"preset": "real", "subjects": 1, "duration_s": 1.0})
    for name in ("a", "b"):
        config.write(used, tmp_path / name / "config")
    first, second = (
        {p.relative_to(tmp_path / name): p.read_bytes() for p in (tmp_path / name).rglob("*") if p.is_file()}
        for name in ("a", "b")
    )
    assert len(first) > 10 and first == second
    read = project.load(tmp_path / "a")
    assert from_dict(read.config["simulate"]) == used
    sheet = (tmp_path / "a/config/gallery.tsv").read_text().splitlines()
    assert sheet[0] == "subject\toutfit\tangle\tpath" and len(sheet) == 1 + 1 * 2 * 2


def test_ideal_has_none_of_it():
    assert settings.Settings() == from_dict({}) == from_dict({"preset": "ideal"})
