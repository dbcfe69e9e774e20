"""Starts told by sound: two tracks of one scene, of two scenes, of noise; and in the files of two cameras.

The sounds are made here: steps at a regular pace, heard at a distance, with echoes, noise and clocks that differ.
"""

import numpy as np
import pytest

from dior.ingest import frames, video_audio, video_starts
from dior.ingest.video_audio import Heard
from dior.ingest.video_frames import Recorded
from dior.tables import tables
from tests.ingest.videofiles import numbered, write

HZ = video_audio.RATE_HZ


def steps(seed, seconds, rate=HZ):
    """Samples of a walk: a click every 0.55 s or so."""
    generator = np.random.default_rng(seed)
    sound = np.zeros(int(seconds * rate))
    for at in np.arange(0.3, seconds - 0.2, 0.55) + generator.normal(0, 0.02, len(np.arange(0.3, seconds - 0.2, 0.55))):
        count = int(0.08 * rate)
        click = generator.normal(0, 1, count) * np.exp(-np.arange(count) / (0.012 * rate)) * generator.uniform(0.5, 1)
        sound[int(at * rate) : int(at * rate) + count] += click
    return sound


def recorded(sound, start_s, seconds, seed, rate=HZ, drift_ppm=0.0, noise=0.5):
    """What a microphone has of a sound from `start_s` on, by a clock that is fast, with two echoes and noise."""
    generator = np.random.default_rng(seed)
    times = start_s + np.arange(int(seconds * rate)) / rate * (1 + 1e-6 * drift_ppm)
    heard = sum(
        share * np.interp(times - late, np.arange(len(sound)) / rate, sound)
        for share, late in ((1, 0), (0.4, generator.uniform(0.01, 0.05)), (0.4, generator.uniform(0.01, 0.05)))
    )
    return heard / heard.std() + noise * generator.normal(0, 1, len(heard))


@pytest.mark.parametrize("late_s", [0.0, 1.7, -2.3])
def test_the_lag_of_one_scene_is_told_to_some_milliseconds(late_s):
    scene = steps(1, 30)
    one = Heard(video_audio.onsets(recorded(scene, 3, 20, 2, drift_ppm=20)), 0.5)
    other = Heard(video_audio.onsets(recorded(scene, 3 + late_s, 20, 3, drift_ppm=-20)), 0.0)
    # what is at 0.5 s in the file of one was `late_s` before the beginning of the other
    assert video_audio.lag(one, other, 0, 4) == pytest.approx(0.5 + late_s, abs=0.004)
    assert video_audio.lag(one, other, 10, 4) is None, "the true lag is not among those that may be"


def test_two_scenes_and_noise_tell_nothing():
    one = Heard(video_audio.onsets(recorded(steps(1, 30), 3, 20, 2)), 0)
    for other in (recorded(steps(9, 30), 3, 20, 3), np.random.default_rng(4).normal(0, 1, 20 * HZ)):
        assert video_audio.lag(one, Heard(video_audio.onsets(other), 0), 0, 10) is None


def filmed(folder, sounds, rate=16000, created=None):
    """The stamps of the first picture by camera, and what is told of them."""
    for camera, sound in sounds.items():
        metadata = {"creation_time": created[camera]} if created else None
        track = None if sound is None else ((0.1 * sound).astype(np.float32), rate)
        write(folder / f"{camera}.mp4", [numbered(i) for i in range(30)], sound=track, metadata=metadata)
    videos = {camera: folder / f"{camera}.mp4" for camera in sounds}
    frames.run(
        sequence="walk", bags=[], data_root=folder, topics=dict.fromkeys(videos, "video0"), out=folder / "f.parquet",
        recorded=Recorded(videos),
    )  # fmt: skip
    table = tables.read(folder / "f.parquet", "frames")
    first = {camera: int(tables.of_camera(table, camera)["stamp_ns"][0]) for camera in sounds}
    return first, video_starts.told(folder / "f.parquet")


def test_a_camera_that_began_late_is_put_where_its_sound_is(tmp_path):
    scene, rate = steps(1, 30, 16000), 16000
    sounds = {
        "cam01": recorded(scene, 1.0, 12, 2, rate), "cam02": recorded(scene, 2.7, 12, 3, rate), "cam03": None,
    }  # fmt: skip
    first, told = filmed(tmp_path, sounds, rate)
    assert (first["cam02"] - first["cam01"]) / 1e9 == pytest.approx(1.7, abs=0.01)
    assert first["cam03"] == first["cam01"], "of which nothing is known begins with the others"
    assert {camera: one["source"] for camera, one in told.items()} == {
        "cam01": "none", "cam02": "sound", "cam03": "none",
    }  # fmt: skip
    assert told["cam01"]["apart_sigma_s"] == told["cam02"]["apart_sigma_s"] == video_audio.SIGMA_S
    assert video_starts.loose_s(tmp_path / "f.parquet") == pytest.approx(3 * np.hypot(5, video_audio.SIGMA_S))
    assert video_starts.loose_s(tmp_path / "f.parquet", absolute=True) >= 15


def test_where_sound_tells_nothing_the_starts_stay_as_they_are(tmp_path):
    noises = {camera: np.random.default_rng(i).normal(0, 1, 6 * 16000) for i, camera in enumerate(("cam01", "cam02"))}
    created = {"cam01": "2024-05-01T10:00:00.000000Z", "cam02": "2024-05-01T10:00:02.000000Z"}
    first, told = filmed(tmp_path, noises, created=created)
    assert first["cam02"] - first["cam01"] == 2 * 10**9
    assert {one["source"] for one in told.values()} == {"created"}
    assert video_starts.search_s(tmp_path / "f.parquet") == pytest.approx(3 * 2**0.5)
