"""Lags between cameras that are placed by tape, from a simulated walk seen on clocks that are apart."""

import numpy as np
import pytest

from dior.body.names import MLKIT_33, swap_index
from dior.clocks import ray_lags
from dior.geometry.camera import pose, project
from dior.simulate import settings as levels
from dior.simulate.motion import motion_of
from tests.rig import ring

LAGS = np.array([0.0, 0.57, -0.43])


def seen(cameras, walk, apart=LAGS, noise_px=2.0, swapped=0.0):
    """`ray_lags.Rays` of a walk of 7 s by clocks that are `apart` s fast, as the placed `cameras` see them."""
    made = levels.from_dict({"walks": [walk], "environments": ["outdoor"], "subjects": 1, "sequences": 1})
    motion = motion_of(made, levels.sequences(made)[0])
    random = np.random.default_rng(0)
    out = []
    for true, placed, lag in zip(ring(len(apart)), cameras, apart, strict=True):
        times = np.arange(0.0, 7.0, 1 / 30)
        uv = project(true, motion.at(times)[0])[0]
        uv += random.normal(0, noise_px, uv.shape)
        runs = np.repeat(random.random(len(times) // 10) < swapped, 10)
        uv[: len(runs)][runs] = uv[: len(runs)][runs][:, swap_index(MLKIT_33)]
        uv[random.random(len(times)) < 0.02] = np.nan
        out.append(ray_lags.rays(placed, times - lag, uv, 0.05))
    return out


def turned(cameras, degrees, metres, seed=0):
    from scipy.spatial.transform import Rotation

    random, out = np.random.default_rng(seed), []
    for camera in cameras:
        axis, shift = random.normal(size=(2, 3))
        turn = Rotation.from_rotvec(np.radians(degrees) * axis / np.linalg.norm(axis)).as_matrix()
        out.append(camera.at(pose(camera.wRc @ turn, camera.centre + metres * shift), "tape"))
    return out


def found(cameras, rays, held, **how):
    count = len(cameras)
    return ray_lags.coarse(
        cameras, rays, held, (0.0, 6.5), np.full(count, np.radians(ray_lags.AIM_DEG)), np.full(count, 0.1), **how
    )


@pytest.mark.parametrize("walk", ["straight", "across", "circling"])
def test_lags_are_found_with_poor_poses_and_exchanged_sides(walk):
    cameras = turned(ring(3), 6.0, 0.1)
    got = found(cameras, seen(cameras, walk, noise_px=4.0, swapped=0.1), [True, False, False])
    assert np.abs(got - LAGS).max() < 0.08 and got[0] == 0


def test_four_cameras_are_told_together():
    cameras, apart = turned(ring(4), 3.0, 0.05), np.array([0.0, 1.21, -0.9, 1.6])
    got = found(cameras, seen(cameras, "across", apart), [True, False, False, False])
    assert np.abs(got - apart).max() < 0.08


@pytest.mark.parametrize("most_s", [3.0, 4.2426])
def test_cameras_further_apart_are_found_where_they_are_looked_for(most_s):
    cameras, apart = turned(ring(3), 3.0, 0.05), np.array([0.0, 2.6, -1.4])
    got = found(cameras, seen(cameras, "across", apart), [True, False, False], most_s=most_s)
    assert np.abs(got - apart).max() < 0.08


def test_a_lag_at_the_end_of_the_window_is_looked_for_further():
    cameras, apart = turned(ring(3), 3.0, 0.05), np.array([0.0, 2.3, -0.4])
    assert np.abs(found(cameras, seen(cameras, "across", apart), [True, False, False]) - apart).max() < 0.08


def test_clocks_that_are_held_stay():
    cameras = turned(ring(3), 3.0, 0.05)
    got = found(cameras, seen(cameras, "across", np.array([0.0, 0.0, 0.5])), [True, True, False])
    assert (got[:2] == 0).all() and abs(got[2] - 0.5) < 0.08


def test_a_camera_that_saw_nobody_stays_where_it_is():
    cameras = turned(ring(3), 3.0, 0.05)
    rays = seen(cameras, "across")
    rays[2] = ray_lags.Rays(rays[2].first, np.full_like(rays[2].directions, np.nan))
    got = found(cameras, rays, [True, False, False])
    assert abs(got[1] - LAGS[1]) < 0.08 and got[2] == 0
