"""ML Kit's fitness samples, and the rows of one recording of them."""

import numpy as np
import pytest

from dior.errors import DiorError
from dior.ingest.readers import mlkit_csv
from dior.ingest.readers.recognise import recognise


def test_real_mlkit_csv(shared, tmp_path):
    path = shared / "detections" / "mlkit_fitness_pose_samples.csv"
    assert recognise(path) == "mlkit_csv"
    names, classes, points = mlkit_csv.poses(path)
    assert points.shape == (812, 33, 3) and np.isfinite(points).all() and len(set(names)) == 812
    counts = {name: classes.count(name) for name in sorted(set(classes))}
    assert counts == {"pushups_down": 195, "pushups_up": 201, "squats_down": 225, "squats_up": 191}
    np.testing.assert_array_equal(points[0, 0], [1251.0012, 384.75177, -1716.2709])
    # z counts from the hips, which is how the file shows that x, y, z have one unit
    assert np.abs(points[:, 23:25, 2].mean(axis=1)).max() < 3
    with pytest.raises(DiorError, match="pictures of .* recordings .* keep the rows of one"):
        mlkit_csv.read(path)
    one = [line for line in path.read_text().splitlines() if "__8ghtQpeWov8__" in line]
    (tmp_path / "one.csv").write_text("\n".join(one))
    people = mlkit_csv.read(tmp_path / "one.csv")
    assert len(people.frame) == 10 and (people.score == 1).all()
