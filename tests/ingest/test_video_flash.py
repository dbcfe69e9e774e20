"""Starts told by a flash: in curves of brightness that are made here, and in the files of two cameras."""

import numpy as np
import pytest

from dior.ingest import frames, video_flash, video_frames, video_starts
from dior.ingest.video_frames import Recorded
from dior.tables import tables
from tests.ingest.videofiles import numbered, write


def curve(at_s=(), fps=30.0, seconds=10.0, seed=0, height=40.0, phase_s=0.0):
    """Brightness and times (ns) of pictures with noise, and a flash of 20 ms at each of `at_s`."""
    times = phase_s + np.arange(round(seconds * fps)) / fps
    light = 90 + np.random.default_rng(seed).normal(0, 0.3, len(times))
    for flash in at_s:
        light[np.searchsorted(times, flash)] += height
    return light, np.rint(1e9 * times).astype(np.int64)


def seen(*given, **how):
    return video_flash.flashes(*curve(*given, **how))


@pytest.mark.parametrize(("fps", "late_s"), [((30, 30), 1.7), ((30, 60), -2.3), ((120, 25), 0.0)])
def test_one_flash_tells_the_lag_to_a_picture(fps, late_s):
    one, other = (
        seen([5.0 - late], rate, seed=i) for i, (rate, late) in enumerate(zip(fps, (0.0, late_s), strict=True))
    )
    assert video_flash.lag(one, other, 0.0, 4.0) == pytest.approx(late_s, abs=1 / min(fps))
    assert video_flash.sigma_s(one, other) == pytest.approx(1 / min(fps), rel=1e-3)
    assert video_flash.lag(one, other, 10.0, 4.0) is None, "the true lag is not among those that may be"


def test_two_flashes_that_fit_alike_tell_nothing_and_a_pattern_does():
    assert video_flash.lag(seen([4.0, 6.0]), seen([5.0]), 0.0, 4.0) is None
    assert video_flash.lag(seen([4.0, 6.0]), seen([4.0, 6.0]), 0.0, 4.0) == pytest.approx(0, abs=0.04)
    assert video_flash.lag(seen([2.0, 3.0, 5.5]), seen([1.0, 2.0, 4.5]), 0.0, 4.0) == pytest.approx(1, abs=0.04)


def test_flashes_that_the_other_has_not_tell_nothing():
    one, other = seen([1.5, 3.1, 4.4, 6.2, 8.1]), seen([2.0, 2.9, 5.1, 7.6])
    assert video_flash.lag(one, other, 0.0, 4.0) is None
    one, other = seen([2.0, 3.0, 5.3, 8.1]), seen([2.0, 3.0, 4.1, 6.6])
    assert video_flash.lag(one, other, 0.0, 4.0) is None, "one lag fits best, by two of four"
    one, other = seen([2.0, 3.0, 5.3]), seen([2.0, 3.0, 4.1])
    assert video_flash.lag(one, other, 0.0, 4.0) is None, "and by two of three"


def test_what_is_half_as_bright_as_a_flash_leaves_open_which_are_flashes():
    light, pts_ns = curve([4.0])
    for more, told in ((3.0, True), (6.0, False)):
        other = light.copy()
        other[200] += more
        assert (video_flash.flashes(other, pts_ns) is not None) == told


def changed(light, **what):
    """The curve with something else in it than a flash."""
    count = len(light)
    if "person" in what:
        light = light - what["person"] * np.exp(-0.5 * ((np.arange(count) - count / 2) / 12) ** 2)
    if "white" in what:
        light = light + what["white"] * np.exp(-0.5 * ((np.arange(count) - count / 2) / 12) ** 2)
    if "exposure" in what:
        light = light + what["exposure"] * np.minimum(np.arange(count) / 20, 1)
    if "lamp" in what:
        light = light + what["lamp"] * (np.arange(count) > count / 2)
    if "flicker" in what:
        light = light + what["flicker"] * np.sin(np.arange(count) * 2.6)
    return light


@pytest.mark.parametrize(
    "what", [{"person": 30}, {"white": 30}, {"exposure": 60}, {"lamp": 50}, {"flicker": 5}, {"lamp": -50}], ids=str
)
def test_what_is_no_flash_is_none_and_hides_none(what):
    light, pts_ns = curve()
    assert video_flash.flashes(changed(light, **what), pts_ns) is None
    light, pts_ns = curve([7.0], height=150)
    found = video_flash.flashes(changed(light, **what), pts_ns)
    assert found.at_s == pytest.approx([7.0], abs=0.04)


@pytest.mark.parametrize("gap_s", [0.1, 0.2, 0.3])
@pytest.mark.parametrize("dark_s", [0.03, 0.1, 0.2], ids="{} s".format)
def test_light_between_two_dark_moments_is_no_flash(gap_s, dark_s):
    """Legs that pass before the lens, or black pictures: what comes back is the usual light."""
    light, pts_ns = curve()
    light_and_flash, _ = curve([8.0])
    seconds = pts_ns / 1e9
    dark = sum(((seconds > at) & (seconds <= at + dark_s)) for at in (4.0, 4.0 + dark_s + gap_s)).astype(bool)
    assert video_flash.flashes(np.where(dark, light - 60, light), pts_ns) is None
    found = video_flash.flashes(np.where(dark, light_and_flash - 60, light_and_flash), pts_ns)
    assert found.at_s == pytest.approx([8.0], abs=0.04)


def passing(grey, share, follows, seconds=8.0, fps=30.0, flash_s=None, seed=0):
    """Light (F, 64) of a picture of 90 grey levels through which something of `grey` and a `share` of its width passes
    at 4 s within 0.2 s; the exposure follows by `follows` of what is off from picture to picture."""
    count, gain, found = round(seconds * fps), 1.0, []
    for i in range(count):
        fields = np.full((8, 8), 90.0)
        at = 5 * (i / fps - 4.0)
        fields[:, np.abs(np.arange(8) / 7 - at) <= share / 2] = grey
        fields += 110 * (flash_s is not None and abs(i / fps - flash_s) < 0.5 / fps)
        found.append(np.clip(fields * gain, 0, 255).ravel())
        gain *= (90 / found[-1].mean()) ** follows
    noise = np.random.default_rng(seed).normal(0, 0.3, (count, 64))
    return np.array(found) + noise, np.rint(1e9 * np.arange(count) / fps).astype(np.int64)


@pytest.mark.parametrize("follows", [0.0, 0.2, 0.6])
@pytest.mark.parametrize("grey", [0, 250])
def test_what_passes_near_the_lens_at_once_is_no_flash_and_hides_none(grey, follows):
    """Nor is the exposure that followed something dark."""
    assert video_flash.flashes(*passing(grey, 0.3, follows)) is None
    found = video_flash.flashes(*passing(grey, 0.3, follows, flash_s=6.0))
    assert found.at_s == pytest.approx([6.0], abs=0.04)


def test_what_covers_more_than_half_of_the_picture_leaves_open_which_is_a_flash():
    light, pts_ns = passing(90, 0.0, 0.0, flash_s=6.0)
    assert video_flash.flashes(light, pts_ns) is not None
    light[100, :38] += 110
    assert video_flash.flashes(light, pts_ns) is None


@pytest.mark.parametrize("fps", [24.0, 25.0, 30.0, 50.0, 60.0, 120.0])
@pytest.mark.parametrize("phase", [0.0, 0.3, 0.9])
def test_a_lamp_that_is_on_for_a_fifth_of_a_second_is_told(fps, phase):
    """A picture's exposure is as long as it is shown, so that a part of the light is in one more."""
    light, pts_ns = curve(fps=fps)
    seconds, on_s = pts_ns / 1e9, 5.0 + phase / fps
    share = np.clip(np.minimum(seconds + 1 / fps, on_s + 0.2) - np.maximum(seconds, on_s), 0, None) * fps
    found = video_flash.flashes(light + 40 * share, pts_ns)
    assert found.at_s == pytest.approx([on_s], abs=1.1 / fps)
    longer = (seconds >= 5) & (seconds < 5.2 + 3 / fps)
    assert video_flash.flashes(light + 40 * longer, pts_ns) is None


def test_strong_flicker_and_what_brightens_by_and_by_tell_nothing():
    light, pts_ns = curve()
    assert video_flash.flashes(changed(light, flicker=20), pts_ns) is None
    assert video_flash.flashes(light + 4 * (np.arange(len(light)) % 23), pts_ns) is None


def test_the_first_and_last_pictures_and_a_few_tell_nothing():
    assert seen([0.1]) is None and seen([9.95]) is None
    assert video_flash.flashes(None, np.arange(5)) is None
    assert video_flash.flashes(np.array([1.0, 99.0]), np.arange(2)) is None


def test_a_camera_that_began_late_is_put_where_it_saw_the_flash(tmp_path):
    """By `frames`, from the files: cam02 began 1 s late, cam03 saw nothing."""
    for camera, flash in (("cam01", 45), ("cam02", 15), ("cam03", None)):
        pictures = [numbered(i) // (1 if i == flash else 3) for i in range(60)]
        write(tmp_path / f"{camera}.mp4", pictures)
    videos = {camera: tmp_path / f"{camera}.mp4" for camera in ("cam01", "cam02", "cam03")}
    frames.run(
        sequence="w", bags=[], data_root=tmp_path, topics=dict.fromkeys(videos, "video0"), out=tmp_path / "f.parquet",
        recorded=Recorded(videos),
    )  # fmt: skip
    table, told = tables.read(tmp_path / "f.parquet", "frames"), video_starts.told(tmp_path / "f.parquet")
    first = {camera: int(tables.of_camera(table, camera)["stamp_ns"][0]) for camera in videos}
    assert (first["cam02"] - first["cam01"]) / 1e9 == pytest.approx(1.0, abs=1e-6)
    assert first["cam03"] == first["cam01"]
    assert {camera: one["source"] for camera, one in told.items()} == {
        "cam01": "none", "cam02": "flash", "cam03": "none",
    }  # fmt: skip
    assert [told[camera]["apart_sigma_s"] for camera in videos] == pytest.approx([1 / 30, 1 / 30, 5.0], abs=1e-4)


def test_cameras_with_a_flash_of_their_own_are_not_near_the_others(tmp_path):
    """cam01's stamps are exact and it saw no flash: how far the two others are off it is as open as before."""
    for camera, flash in (("cam01", None), ("cam02", 45), ("cam03", 15)):
        write(tmp_path / f"{camera}.mp4", [numbered(i) // (1 if i == flash else 3) for i in range(60)])
    (tmp_path / "cam01.csv").write_text("frame,stamp_ns\n0,1708000000000000000\n")
    videos = {camera: tmp_path / f"{camera}.mp4" for camera in ("cam01", "cam02", "cam03")}
    frames.run(
        sequence="w", bags=[], data_root=tmp_path, topics=dict.fromkeys(videos, "video0"), out=tmp_path / "f.parquet",
        recorded=Recorded(videos, {"cam01": tmp_path / "cam01.csv"}),
    )  # fmt: skip
    told = video_starts.told(tmp_path / "f.parquet")
    assert [told[camera]["apart_sigma_s"] for camera in videos] == [0.0, 5.0, 5.0]
    assert [told[camera]["source"] for camera in videos] == ["sidecar", "none", "flash"]
    assert video_starts.search_s(tmp_path / "f.parquet") > 15


def test_beside_a_camera_that_is_no_video_a_flash_tells_nothing_of_it(tmp_path):
    for camera, flash in (("cam02", 45), ("cam03", 15)):
        write(tmp_path / f"{camera}.mp4", [numbered(i) // (1 if i == flash else 3) for i in range(60)])
    videos = {camera: tmp_path / f"{camera}.mp4" for camera in ("cam02", "cam03")}
    for others_ns, apart_s in ((None, 1 / 30), (1_708_000_000 * 10**9, 5.0)):
        films = video_frames.films("w", dict.fromkeys(videos, "video0"), Recorded(videos), others_ns)
        assert [film.stamps.apart_sigma_s for film in films.values()] == pytest.approx([apart_s] * 2, abs=1e-4)
        first, second = (int(film.stamps.stamp_ns[0]) for film in films.values())
        assert (second - first) / 1e9 == pytest.approx(1.0, abs=1e-6)


def test_where_a_third_saw_two_flashes_one_in_each_of_two_is_not_the_same(tmp_path):
    for camera, flashes in (("cam01", [20]), ("cam02", [45]), ("cam03", [20, 45])):
        write(tmp_path / f"{camera}.mp4", [numbered(i) // (1 if i in flashes else 3) for i in range(70)])
    videos = {camera: tmp_path / f"{camera}.mp4" for camera in ("cam01", "cam02", "cam03")}
    films = video_frames.films("w", dict.fromkeys(videos, "video0"), Recorded(videos), None)
    assert {film.stamps.source for film in films.values()} == {"none"}
    assert len({int(film.stamps.stamp_ns[0]) for film in films.values()}) == 1
