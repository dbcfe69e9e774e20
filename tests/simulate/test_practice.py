"""`dior simulate --practice`: recordings with markers to click, and a project with the clicking left to do."""

import json
import re
import shutil

import cv2
import numpy as np
import pandas as pd
import pytest

from dior.cli import main
from dior.errors import DiorError
from dior.project import project
from dior.simulate import config, simulate
from dior.simulate.draw import MARKER_COLOUR, paint_markers
from dior.simulate.motion import motion_of
from dior.simulate.settings import from_dict, sequences
from tests.end_to_end.workflow import planned, snakemake


def centre_of(picture, uv):
    """Centre of mass (2,) px of what is white within 3 px of a pixel."""
    u, v = np.meshgrid(np.arange(picture.shape[1]), np.arange(picture.shape[0]))
    weight = picture.astype(float) * (np.hypot(u - uv[0], v - uv[1]) < 3)
    return np.array([(weight * u).sum(), (weight * v).sum()]) / weight.sum()


@pytest.mark.parametrize("width", [2.0, 3.1, 4.0])
def test_a_spot_is_where_its_marker_is(width):
    for uv in ((10.0, 12.0), (10.5, 12.0), (9.87, 12.31)):
        picture = np.zeros((24, 24, 3), np.uint8)
        paint_markers(picture, np.array([uv]), np.array([width]))
        assert np.hypot(*(centre_of(picture[..., 0], uv) - uv)) < 0.05
        assert picture.max() == MARKER_COLOUR[0]
        assert picture[..., 0].sum() / MARKER_COLOUR[0] == pytest.approx(np.pi * width**2 / 4, rel=0.15)


def test_a_spot_at_the_edge_is_cut_off():
    picture = np.zeros((24, 24, 3), np.uint8)
    paint_markers(picture, np.array([[-0.5, 3.0]]), np.array([3.0]))
    assert picture[:, 0].any() and not picture[:, 3:].any()


def test_the_markers_that_a_camera_sees_are_white_in_its_pictures():
    """By the JPEG of a picture, of which the truth knows where each marker is."""
    settings = from_dict(config.ONE_OF_EACH | {"duration_s": 0.4, "environments": ["indoor"]})
    [walk] = sequences(settings)
    motion = motion_of(settings, walk)
    views, others = simulate.observe(settings, walk, motion)
    off = []
    for name, seen in views.items():
        jpeg = simulate.painter(settings, walk, motion.height, seen, others[name])(3)
        green = cv2.imdecode(jpeg, cv2.IMREAD_COLOR)[..., 1]
        for i in np.flatnonzero(np.isin(seen.joints, motion.names) & (seen.status[3] == "ok")):
            u, v = seen.uv[3, i]
            assert green[round(v), round(u)] > 180, (name, seen.joints[i])
            around = green[round(v) - 4 : round(v) + 5, round(u) - 4 : round(u) + 5]
            # what stands alone before dark cloth can be measured
            if np.sort(np.hypot(*(seen.uv[3] - (u, v)).T))[1] > 6 and np.median(around) < 90:
                off.append(np.hypot(*(centre_of(np.maximum(green.astype(int) - 120, 0), (u, v)) - (u, v))))
    assert len(off) >= 4 and np.median(off) < 0.15


def test_what_is_done_by_hand_in_the_pictures_is_left_undone(tmp_path, capsys):
    words = [
        "--practice",
        str(tmp_path),
        "--settings",
        json.dumps({"duration_s": 0.4, "width": 64, "height": 36, "fx": 32.0}),
    ]
    assert main.main(["simulate", *words]) == 0
    assert "marks" in capsys.readouterr().out
    made = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert "recordings/indoor_01/mocap.c3d" in made and "recordings/outdoor_01/pc2.bag" in made
    assert [name.split("/")[0] for name in made if "marks" in name or "boxes" in name] == ["solution"] * 5
    assert not re.search("(?m)^(align|nudge):", (tmp_path / "config/sessions/field/cam04.yaml").read_text())
    with pytest.raises(DiorError) as said:
        project.load(tmp_path)
    assert [f"cam0{i}.marks.csv" in str(said.value) for i in (1, 2, 3, 4)] == [True] * 4
    assert main.main(["simulate", *words]) == 1
    assert "exists already" in capsys.readouterr().err
    assert main.main(["simulate"]) == 1 and "--practice" in capsys.readouterr().err
    assert main.main(["simulate", *words, "--write-config", str(tmp_path / "x")]) == 1
    assert not (tmp_path / "x").exists()


@pytest.mark.slow
def test_who_does_it_has_good_labels(tmp_path):
    """The solution is what the demo's hands would do; before it, the labels of the long-range camera are off."""
    assert main.main(["simulate", "--practice", str(tmp_path)]) == 0
    shutil.copytree(tmp_path / "solution/boxes", tmp_path / "config/boxes")
    for path in sorted((tmp_path / "solution/sessions/lab").glob("*.csv")):
        shutil.copy(path, tmp_path / "config/sessions/lab")
    snakemake(tmp_path)
    assert long_range_error_px(tmp_path) > 3
    shutil.copy(tmp_path / "solution/sessions/field/cam04.yaml", tmp_path / "config/sessions/field")
    assert contents(tmp_path / "solution") == contents(tmp_path / "config")
    assert "align" in planned(tmp_path) and "adjust" not in planned(tmp_path)
    snakemake(tmp_path)
    assert long_range_error_px(tmp_path) < 0.5


def contents(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def long_range_error_px(folder):
    """Median distance of the labels of cam04 outdoors from the truth."""
    labels = pd.read_parquet(folder / "results/reproject/outdoor_01.cam04.parquet")
    true = pd.read_parquet(folder / "recordings/truth/outdoor_01/labels_2d.parquet")
    both = labels.merge(true[true["camera"] == "cam04"], on=["frame", "joint"], suffixes=("", "_true"))
    return np.hypot(both["u"] - both["u_true"], both["v"] - both["v_true"]).median()
