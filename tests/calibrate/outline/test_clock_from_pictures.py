"""The clock of an indoor camera by the silhouette of somebody whose markers are known."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import scene
from dior.calibrate.outline import clock_from_pictures, long_range_clock, tracks
from dior.errors import DiorError
from dior.geometry.camera import Intrinsics, project
from dior.simulate import draw
from dior.simulate import settings as levels
from dior.simulate.motion import motion_of

LATE_S, DRIFT_PPM, LASTS_S = 0.43, 40.0, 20.0


def recorded(seed=1, walk="across"):
    settings = levels.from_dict(
        {"seed": seed, "subjects": 1, "sequences": 1, "environments": ["indoor"], "walks": [walk]}
        | {"duration_s": LASTS_S}
    )
    motion = motion_of(settings, levels.sequences(settings)[0])
    ticks = np.arange(int(100 * (LASTS_S + 1.5)))
    points = motion.at(ticks / 100)[1]
    flat = points.reshape(-1, 3)
    table = {
        "joint": np.array(list(motion.names) * len(ticks), dtype=object),
        "stamp_ns": np.repeat(ticks * 10_000_000, len(motion.names)),
        **{axis: flat[:, i] for i, axis in enumerate("xyz")},
    }
    return motion, table


def outlined(camera, track, flesh_m, moments):
    """Edges (F, 4) px of the body as it is modelled."""
    uv, depth = project(camera, track.at(moments))
    out = camera.intrinsics.fx * flesh_m / depth
    return np.concatenate([(uv - out[..., None]).min(axis=1), (uv + out[..., None]).max(axis=1)], axis=1)


@pytest.fixture(scope="module")
def watched():
    camera = scene.camera("cam01", 40.0)
    _, table = recorded()
    track, t0_ns, flesh_m = clock_from_pictures.body(table)
    stamps = np.arange(0.0, LASTS_S, 0.2)
    edges = outlined(camera, track, flesh_m, stamps * (1 + 1e-6 * DRIFT_PPM) + LATE_S)
    noise = np.random.default_rng(0).standard_normal(edges.shape)
    return camera, track, flesh_m, stamps, edges + noise


def late(clock):
    return clock.offset_s + 1e-6 * clock.drift_ppm * clock.middle_s


def test_the_clock_is_found_to_milliseconds(watched):
    found = clock_from_pictures.from_edges(*watched)
    truth = LATE_S + 1e-6 * DRIFT_PPM * found.clock.middle_s
    assert (found.clock.source, found.clock.method) == ("estimated", "pictures")
    assert late(found.clock) == pytest.approx(truth, abs=0.004)
    assert abs(late(found.clock) - truth) < 4 * found.clock.given[0] < 0.02
    assert long_range_clock.lags_of(found.costs_px)[np.nanargmin(found.costs_px)] == pytest.approx(LATE_S, abs=0.05)
    assert found.after_px < 3 < found.before_px


@pytest.mark.slow
def test_an_outline_that_is_always_further_ahead_is_no_time(watched):
    camera, track, flesh_m, stamps, edges = watched
    ahead = edges + (6.0, 0.0, 6.0, 0.0)
    plain, moved = (
        late(clock_from_pictures.from_edges(camera, track, flesh_m, stamps, e).clock) for e in (edges, ahead)
    )
    assert abs(moved - plain) < 0.006, "6 px are 40 ms of this walk"


def test_two_seconds_are_refused_or_wide(watched):
    camera, track, flesh_m, stamps, edges = watched
    few = stamps < 2.0
    found = clock_from_pictures.from_edges(camera, track, flesh_m, stamps[few], edges[few])
    error = abs(late(found.clock) - LATE_S)
    assert found.refused or error < 3 * found.clock.given[0]


def test_a_picture_with_nobody_is_refused(watched):
    camera, track, flesh_m, stamps, edges = watched
    found = clock_from_pictures.from_edges(camera, track, flesh_m, stamps, np.full_like(edges, np.nan))
    assert found.clock.source == "assumed_zero" and np.isnan(found.clock.given).all() and "edges" in found.refused


def test_gaps_of_a_marker_are_bridged_with_the_body():
    _, table = recorded()
    points = np.stack([table[axis].reshape(-1, 39) for axis in "xyz"], axis=-1)
    gap = points.copy()
    gap[500:520, 30] = np.nan
    found = clock_from_pictures.filled(tracks.BodyTrack(np.arange(len(gap)) / 100, gap))
    assert np.isfinite(found).all()
    np.testing.assert_allclose(found[500:520, 30], points[500:520, 30], atol=0.12)


def test_an_edge_at_the_border_of_the_picture_is_not_the_body():
    room = 120 + 30 * np.sin(np.arange(100) / 5)[None, :, None] + np.random.default_rng(0).uniform(-9, 9, (60, 100, 3))
    pictures = np.repeat(room[None].astype(np.uint8), 20, axis=0)
    for i in range(20):
        pictures[i, 20:60, 4 * i : 4 * i + 6] = 5
    edges = clock_from_pictures.edges_of(list(pictures), 2, 80.0)
    assert np.isnan(edges[5:15, 3]).all() and np.isnan(edges[0, 0]) and np.isfinite(edges[5:15, :3]).all()
    np.testing.assert_allclose(edges[5, :3], [2 * 20 - 0.5, 2 * 20 - 0.5, 2 * 26 - 0.5], atol=1.0)


def test_a_track_has_no_points_in_a_gap_or_outside():
    points = np.arange(10.0)[:, None, None] * (1.0, 0.0, 0.0)
    points[5] = np.nan
    track = tracks.BodyTrack(np.arange(10) / 10, points)
    found = track.at(np.array([-0.1, 0.25, 0.45, 0.95]))
    np.testing.assert_allclose(found[1, 0], [2.5, 0, 0])
    assert np.isnan(found[[0, 2, 3]]).all()
    np.testing.assert_allclose(track.velocity(np.array([0.25]))[0, 0], [10.0, 0, 0])


@pytest.mark.slow
def test_pictures_alone_tell_the_clock(monkeypatch):
    camera = scene.camera("cam01", 40.0)
    camera = replace(camera, intrinsics=Intrinsics(320, 180, 160.0, 160.0, 159.5, 89.5))
    motion, table = recorded()
    stamps = np.arange(0.0, LASTS_S, 0.1)
    drawn = draw.figure(motion.at(stamps + LATE_S)[0], motion.height)
    outlines = draw.outlines(camera, drawn, motion.height, "shirt", "S01")
    room = np.random.default_rng(0).uniform(150, 230, (180, 320, 3)).astype(np.uint8)

    def read_pictures(rows, data_root):
        for i, stamp in enumerate(rows["stamp_ns"]):
            picture = room.copy()
            draw.paint(picture, outlines, round(stamp / 1e8))
            yield i, picture

    monkeypatch.setattr("dior.ingest.bags.read_pictures", read_pictures)
    rows = {"stamp_ns": np.round(stamps * 1e9).astype(np.int64)}
    rows |= {"width": np.full(len(stamps), 320), "height": np.full(len(stamps), 180)}
    clock, lags_s, costs_px = clock_from_pictures.from_pictures(camera, table, rows, None, "walk, camera cam01")
    assert (clock.source, clock.method) == ("estimated", "pictures")
    assert late(clock) == pytest.approx(LATE_S, abs=0.015)
    assert lags_s[np.nanargmin(costs_px)] == pytest.approx(LATE_S, abs=0.05)
    with pytest.raises(DiorError, match="walk, camera cam01"):
        clock_from_pictures.from_pictures(
            camera, table, rows | {"width": rows["width"] * 2}, None, "walk, camera cam01"
        )
