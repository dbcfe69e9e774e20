"""Two people throughout: the clocks are those by which both walk, whomever the detector gives first."""

import numpy as np
import pytest

from benchmarks import scene
from dior.calibrate.clock import from_cameras
from dior.calibrate.clock.from_cameras import TimedDetections
from dior.calibrate.clock.from_two_people import from_two_people

LATE_S = (0.0, 0.41, -0.27)


@pytest.fixture(scope="module")
def walks():
    return scene.make("ideal", seed=3, frames=200), scene.make("ideal", seed=3, frames=200, walk="along", take=1)


def recorded(walks, first):
    """What cameras have whose detector gives the walker `first` (V,) at first, their stamps LATE_S too small."""
    return [
        TimedDetections(walks[who].seconds - late, walks[who].uv[view], 2.5 / scene.FPS)
        for view, (who, late) in enumerate(zip(first, LATE_S, strict=True))
    ]


def everybody(walks, pictures=lambda who, view, uv: uv):
    """Table `detected_people` of both, of what `pictures` leaves of a walker's pixels in a camera."""
    rows = {key: [] for key in ("camera", "frame", "person", "track", "joint", "u", "v", "score")}
    for who, made in enumerate(walks):
        for view, camera in enumerate(made.given):
            uv = pictures(who, view, made.uv[view])
            frame, joint = np.nonzero(np.isfinite(uv[..., 0]))
            # the other way round in the second camera
            track = who if view != 1 else 1 - who
            own = camera.name, frame, track, track, np.array(made.names, object)[joint], *uv[frame, joint].T, 1.0
            for key, values in zip(rows, own, strict=True):
                rows[key].append(np.broadcast_to(np.asarray(values, object), frame.shape))
    columns = {key: np.concatenate(parts) for key, parts in rows.items()}
    return columns | {key: columns[key].astype(float) for key in ("u", "v", "score")} | {
        key: columns[key].astype(int) for key in ("frame", "person", "track")
    }  # fmt: skip


def told(walks, people, first=(0, 1, 0)):
    made = walks[0]
    return from_two_people(
        list(made.given), recorded(walks, first), list(made.names), people, 0.3, made.seconds, scene.FPS
    )


def test_the_clocks_are_found_though_a_camera_gives_the_other_person(walks):
    made = walks[0]
    alone = from_cameras.from_detections(
        list(made.given), recorded(walks, (0, 1, 0)), list(made.names), made.seconds, scene.FPS
    )
    assert any(why for *_, why in alone.values()) or abs(alone["cam02"][0].offset_s - LATE_S[1]) > 0.1
    found = told(walks, everybody(walks))
    for name, true in zip(("cam02", "cam03"), LATE_S[1:], strict=True):
        clock, *_, why = found[name]
        error = clock.offset_s + 1e-6 * clock.drift_ppm * clock.middle_s - true
        assert why == "" and abs(error) < 4 * clock.given[0] < 0.01


def test_two_who_say_different_clocks_are_not_believed(walks):
    def later(who, view, uv):
        return np.roll(uv, 15, axis=0) if (who, view) == (1, 2) else uv

    assert told(walks, everybody(walks, later)) is None


def test_somebody_in_few_pictures_is_no_second_person(walks):
    def few(who, view, uv):
        return uv[:40] if who and view == 2 else uv

    assert told(walks, everybody(walks, few)) is None
