"""How errors of labels are pooled over recordings."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dior.evaluate import label_errors
from dior.geometry.camera import Camera, Intrinsics
from dior.tables import tables


def test_of_equal_sigmas_the_radius_is_that_of_a_plane_normal_error():
    """sqrt(-2 ln 0.05) = 2.4477 sigma."""
    sigma = np.full((3, label_errors.PARTS), 0.5)
    assert label_errors.radius(sigma, [10, 200, 3]) == pytest.approx(0.5 * 2.447747, abs=1e-5)


def test_the_radius_holds_the_share_of_drawn_errors():
    rng = np.random.default_rng(3)
    sigma = [rng.gamma(3, 0.2, 20_000), rng.gamma(2, 1.5, 60_000)]
    quantiles = np.array([label_errors.quantile_columns("label_sigma", one, "c", "close")["value"] for one in sigma])
    errors = np.concatenate([np.linalg.norm(one[:, None] * rng.normal(size=(len(one), 2)), axis=1) for one in sigma])
    told = label_errors.radius(quantiles, [len(one) for one in sigma])
    assert told == pytest.approx(np.quantile(errors, 0.95), rel=0.02)


def test_the_quantile_of_all_is_not_the_mean_of_quantiles():
    rng = np.random.default_rng(4)
    each = [rng.gamma(2, 1, 5000), rng.gamma(2, 6, 500)]
    values = np.array([label_errors.quantile_columns("check_error", one, "c", "close")["value"] for one in each])
    told = label_errors.pooled_quantile(values, [5000, 500], 0.95)
    assert told == pytest.approx(np.quantile(np.concatenate(each), 0.95), rel=0.03)


@given(st.floats(1e-3, 1e3), st.integers(1, 10_000))
def test_scaling_the_sigmas_scales_the_radius(scale, count):
    sigma = np.linspace(0.2, 1.0, label_errors.PARTS)[None]
    one = label_errors.radius(sigma, [5])
    assert label_errors.radius(scale * sigma, [count]) == pytest.approx(scale * one, rel=1e-6)


def test_nothing_known_is_nothing_told():
    assert np.isnan(label_errors.radius(np.zeros((0, label_errors.PARTS)), []))
    assert np.isnan(label_errors.pooled_quantile(np.zeros((0, label_errors.PARTS)), [], 0.95))
    assert not len(label_errors.quantile_columns("label_sigma", np.full((2, 3), np.nan), "c", "close")["value"])


def test_sigmas_are_of_labels_in_the_picture_and_metres_at_the_person(tmp_path):
    status = ["ok", "occluded", "out_of_frame", "missing_3d"]
    count = len(status)
    columns = {
        "subject": ["S"] * count, "sequence": ["w"] * count, "camera": ["cam01"] * count, "joint": ["nose"] * count,
        "frame": range(count), "stamp_ns": range(count), "u": [5.0] * 3 + [np.nan], "v": [5.0] * 3 + [np.nan],
        "sigma_u": [3.0, 1.0, 1.0, np.nan], "sigma_v": [4.0, 1.0, 1.0, np.nan], "rho_uv": [0.0] * 3 + [np.nan],
        "depth": [10.0, 20.0, 5.0, np.nan], "status": status, "source": ["mocap"] * count,
    }  # fmt: skip
    tables.write(tmp_path / "l.parquet", "labels_2d", columns)
    camera = Camera("cam01", Intrinsics(100, 80, 500.0, 500.0, 50.0, 40.0), np.eye(4), "close", "tape")
    px, m = label_errors.sigmas([tmp_path / "l.parquet"], {"cam01": camera})["cam01"]
    np.testing.assert_allclose(px[:2, 0], [np.sqrt(12.5), 1.0])
    np.testing.assert_allclose(m[:2, 0], [np.sqrt(12.5) * 10 / 500, 20 / 500])
    assert np.isnan(px[2:]).all()
