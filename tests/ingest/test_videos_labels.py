"""A simulated walk written again as videos: the labels are those from its bags, all steps work from its pictures."""

import numpy as np
import pytest

from dior.ingest import frames, video_starts
from dior.ingest.video_frames import Recorded
from dior.label import reproject
from dior.tables import tables
from tests.end_to_end.workflow import snakemake
from tests.ingest import videofiles
from tests.ingest.test_bags_labels import CAMERAS, WALK, simulated  # noqa: F401

# chosen: a hundredth of what a detector resolves
SAME_PX = 0.01


@pytest.fixture(scope="module")
def filmed(simulated, tmp_path_factory):  # noqa: F811
    """A folder with the videos, cam03 turned and cam04 in Matroska, and the first stamp (ns) of each camera."""
    _, bags, _ = simulated
    folder = tmp_path_factory.mktemp("filmed")
    first = videofiles.from_bags(bags, folder, turned=["cam03"], matroska=["cam04"])
    return folder, {camera: stamp for camera, (stamp, _) in first.items()}


@pytest.mark.parametrize("stamps", ["of every picture", "of the first"])
def test_labels_from_videos_are_those_from_bags(simulated, filmed, tmp_path, stamps):  # noqa: F811
    made, (folder, first) = simulated[0] / "made", filmed
    sidecars = {camera: folder / f"{camera}.csv" for camera in CAMERAS}
    if stamps == "of the first":
        sidecars = {camera: tmp_path / f"{camera}.csv" for camera in CAMERAS}
        for camera, path in sidecars.items():
            path.write_text(f"frame,stamp_ns\n0,{first[camera]}\n")
    indexed = tmp_path / f"{WALK}.parquet"
    frames.run(
        sequence=WALK, bags=[], data_root=folder, topics=dict.fromkeys(CAMERAS, "video0"), out=indexed,
        recorded=Recorded({camera: folder / f"{camera}.mp4" for camera in CAMERAS}, sidecars),
    )  # fmt: skip
    assert {one["source"] for one in video_starts.told(indexed).values()} == {"sidecar"}
    bag, film = (tables.read(path, "frames") for path in (made / f"{WALK}.parquet", indexed))
    assert (bag["frame"] == film["frame"]).all() and (bag["height"] == film["height"]).all()
    for camera in CAMERAS:
        out = tmp_path / f"{camera}.labels.parquet"
        reproject.run(
            sequence=WALK, subject="S01", labelled=[camera], cameras=[made / f"{camera}.placed.parquet"], makers=[],
            covariance=[made / f"{camera}.covariance.parquet"], skeleton=made / "mocap.parquet", frames=indexed,
            clocks=[made / "clocks.parquet"], clock_gains=[made / "clock_gains.parquet"], source="mocap", out=[out],
        )  # fmt: skip
        ours, theirs = (tables.read(path, "labels_2d") for path in (out, made / f"{camera}.labels.parquet"))
        for key in ("u", "v", "sigma_u", "sigma_v"):
            np.testing.assert_allclose(ours[key], theirs[key], atol=SAME_PX)


@pytest.mark.slow
def test_the_workflow_makes_of_videos_what_it_makes_of_bags(tmp_path):
    """Up to the release, from videos of which nothing says when they began, all with sound."""
    from benchmarks import videos

    bag, film = tmp_path / "bags", tmp_path / "videos"
    videos.simulated(bag, videos.SMALL)
    snakemake(bag, "all", "release")
    film.mkdir()
    sound = videos.scene_of(videos.SMALL["duration_s"])
    videos.on_videos(bag, film, bag / "results/simulate", None, sound, ["cam03"], ["cam01"])
    snakemake(film, "all", "release")
    for sequence, camera, off, lost in videos.apart(bag, film):
        # the clocks are found anew
        assert np.nanmax(off) < 0.3 and not lost, (sequence, camera)
    of_each = [(one / "results/pixels").glob("*.cam0?.parquet") for one in (bag, film)]
    pictures = [sum(len(tables.read(path, "released_frames")["image"]) for path in paths) for paths in of_each]
    assert pictures[0] == pictures[1] > 0
    assert "video.cam01" in (film / "results/provenance/outdoor_01.json").read_text()
