"""Where boxes drawn by hand have the head."""

from dataclasses import replace

import numpy as np
import pytest

from dior.body.names import MLKIT_33
from dior.calibrate.outline import silhouettes
from dior.geometry.camera import project
from dior.release import look
from tests.report.conftest import rig, walk

SHIFT_PX, MARGIN_PX = np.array([2.0, -1.5]), 3.0


@pytest.mark.parametrize("wall", [False, True])
def test_boxes_tell_how_far_the_labels_are_off(wall):
    """Not those of a body whose legs a wall hides: nobody knows where their middle should be."""
    view = rig(far=True)[3]
    points = walk(30)
    px = view.intrinsics.fx / np.linalg.norm(points.mean(axis=1) - view.centre, axis=1)
    around, flesh_m = silhouettes.outline(points, MLKIT_33)
    uv, flesh = project(view, around)[0], (flesh_m * px[:, None])[..., None]
    low, high = (uv - flesh).min(axis=1) - MARGIN_PX + SHIFT_PX, (uv + flesh).max(axis=1) + MARGIN_PX + SHIFT_PX
    boxes = np.concatenate([low, high], axis=1)
    if wall:
        boxes[:, 3] = np.median(uv[..., 1])
        view = replace(view, occluded="below")
    empty = np.full((30, 4), np.nan)
    walker = look.Walker(view, np.arange(30) / 30, points[:, 0], points, list(MLKIT_33), empty, boxes)
    found = look.by_hand_m(walker, px)
    if wall:
        assert np.isnan(found).all()
    else:
        np.testing.assert_allclose(found * px[:, None], np.tile(SHIFT_PX, (30, 1)), atol=0.05)
