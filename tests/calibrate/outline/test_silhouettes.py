"""The box of somebody who walks through the pictures of a camera that stands still."""

import numpy as np
import pytest

from dior.body.names import MLKIT_33
from dior.calibrate.outline import silhouettes

HIGH, WIDE = 60, 120


def scene(seed=0):
    """A background with texture, without anybody."""
    random = np.random.default_rng(seed)
    return 110 + 40 * np.sin(np.arange(WIDE) / 9)[None, :, None] + random.uniform(-15, 15, (HIGH, WIDE, 3))


def walk(empty, gain=None, noise=1.5, hide_below=None, count=30):
    """Pictures (F, HIGH, WIDE, 3) uint8 of a dark bar 6 px wide and 20 px tall that goes through, and its edges."""
    random = np.random.default_rng(1)
    pictures, edges = [], []
    for i in range(count):
        u, v = 10 + 3 * i, 25
        picture = empty.copy()
        bottom = v + 20 if hide_below is None else min(v + 20, hide_below)
        picture[v:bottom, u : u + 6] = 20
        picture = picture * (1 if gain is None else gain[i]) + noise * random.standard_normal(picture.shape)
        pictures.append(np.clip(picture, 0, 255).astype(np.uint8))
        edges.append((u - 0.5, v - 0.5, u + 5.5, bottom - 0.5))
    return np.stack(pictures), np.array(edges)


def test_the_edges_are_those_of_the_bar():
    pictures, expected = walk(scene())
    found = silhouettes.edges(pictures, 20, silhouettes.empty_scene(pictures))
    np.testing.assert_allclose(found, expected, atol=0.6)
    assert np.abs((found - expected).mean(axis=0)).max() < 0.3


def test_somebody_in_a_camera_on_its_side_is_no_taller():
    pictures, expected = walk(scene(), hide_below=36)
    lying = pictures.transpose(0, 2, 1, 3)
    found = silhouettes.edges(lying, 12, silhouettes.empty_scene(lying), standing=0)
    np.testing.assert_allclose(found, expected[:, [1, 0, 3, 2]], atol=0.6)
    # a bar four times as long as expected is nobody, in the direction in which people are tall
    assert np.isnan(silhouettes.edges(lying, 5, silhouettes.empty_scene(lying), standing=0)).all()
    uv = np.array([[(5.0, 3.0), (9.0, 23.0)], [(6.0, 3.0), (10.0, 23.0)], [(np.nan, 1.0), (2.0, np.nan)]])
    assert silhouettes.stance(uv) == (20.0, 1) and silhouettes.stance(uv[..., ::-1]) == (20.0, 0)
    assert np.isnan(silhouettes.stance(uv[2:])[0])


def test_light_that_changes_is_no_person():
    gain = 1 + 0.12 * np.sin(np.arange(30))
    pictures, expected = walk(scene(), gain)
    np.testing.assert_allclose(silhouettes.edges(pictures, 20, silhouettes.empty_scene(pictures)), expected, atol=0.8)


def test_a_saturated_disc_beside_the_walk_changes_nothing():
    v, u = np.mgrid[:HIGH, :WIDE]
    sun = np.exp(-np.maximum(np.hypot(u - 60, v - 5) - 8, 0) / 3)[..., None] * 255
    plain, expected = walk(scene())
    shining, _ = walk(scene() + sun)
    found = [silhouettes.edges(p, 20, silhouettes.empty_scene(p)) for p in (shining, plain)]
    np.testing.assert_allclose(*found, atol=0.6)


def test_the_part_above_a_wall_is_found():
    pictures, expected = walk(scene(), hide_below=36)
    np.testing.assert_allclose(silhouettes.edges(pictures, 20, silhouettes.empty_scene(pictures)), expected, atol=0.6)


def test_nobody_is_nan_and_a_wide_change_is_nobody():
    empty = scene()
    pictures, _ = walk(empty)
    pictures[7] = np.clip(empty, 0, 255)
    found = silhouettes.edges(pictures, 8, silhouettes.empty_scene(pictures))
    assert np.isnan(found[7]).all() and np.isnan(found).all(), "the bar is more than twice as tall as expected"


def test_the_crown_is_above_the_ears():
    points = np.zeros((5, 2, 3))
    points[:, :, 2] = 1.6
    top = silhouettes.crown(points, ["left_ear", "right_ear"])
    assert top[:, 2] == pytest.approx(1.6 / (1 - silhouettes.EAR_TO_CROWN))


def test_the_window_stays_in_the_picture():
    uv = np.array([[[5.0, 300.0], [np.nan, np.nan]], [[700.0, 310.0], [650.0, 330.0]]])
    assert silhouettes.window(uv, (720, 480), 20) == (0, 280, 720, 351)


def test_the_outline_lies_outside_of_the_joints():
    out = silhouettes.flesh(["left_hip", "right_knee", "left_eye", "crown"], 2.0)
    assert out == pytest.approx([0.12, 0.074, 0.0, 0.0])


def test_who_stands_for_a_while_is_no_part_of_the_empty_scene():
    empty = scene()
    pictures, expected = walk(empty)
    standing = pictures[:1].repeat(24, axis=0)
    found = silhouettes.edges(np.concatenate([standing, pictures]), 20, silhouettes.empty_scene([*standing, *pictures]))
    np.testing.assert_allclose(found[24:], expected, atol=0.6)


def test_a_sun_that_is_saturated_tells_nothing_of_the_light():
    v, u = np.mgrid[:HIGH, :WIDE]
    sun = 1000.0 * (np.hypot(u - 60, v - 8) < 8)[..., None]
    gain = np.where(np.isin(np.arange(30), (3, 4, 17)), 0.85, 1.0)
    shining, expected = walk(scene() + sun, gain)
    found = silhouettes.edges(shining, 20, silhouettes.empty_scene(shining))
    np.testing.assert_allclose(found, expected, atol=0.8)


@pytest.mark.parametrize("joints", [MLKIT_33, ("LFHD", "RFHD", "LTOE", "LHEE", "RTOE", "RHEE")])
def test_a_walk_of_which_nothing_is_known_has_as_many_points_as_any_other(joints):
    points = np.random.default_rng(0).uniform(0, 2, (5, len(joints), 3))
    known, flesh_m = silhouettes.outline(points, joints)
    nothing, none_m = silhouettes.outline(np.full(points.shape, np.nan), joints)
    assert nothing.shape == known.shape and np.isnan(nothing).all()
    assert none_m.shape == flesh_m.shape and not none_m.any()
