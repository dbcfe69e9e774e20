"""Which cameras of a sequence are in its bags and which in its videos, and what is wrong with what the sheet says."""

import pytest

from dior.project import project
from tests.project.test_project import edit, fails, root  # noqa: F401

LENS = "intrinsics: {file: lenses.toml, name: x}\n"


def filmed(folder, videos="out_1/{camera}.mp4", stamps="", bags="out_1/a.bag; out_1/b.bag", cameras=("cam02",)):
    """The project with videos in its sheet, as `filmed` in out_1, and these cameras without a topic."""
    sheet = folder / "config/sequences.tsv"
    header, *rows = sheet.read_text().splitlines()
    there = {"out_1": (videos, stamps), "out_2": ("out_2/{camera}.mp4", "")}
    rows = [row + "\t" + "\t".join(there.get(row.split("\t")[0], ("", ""))) for row in rows]
    sheet.write_text("\n".join([f"{header}\tvideos\tstamps", *rows]).replace("out_1/a.bag; out_1/b.bag", bags) + "\n")
    for camera in cameras:
        edit(folder, f"sessions/field/{camera}.yaml", f"topic: /{camera}/color/image_raw/compressed\n", LENS)
    return folder


def test_cameras_without_a_topic_are_in_the_videos(root):  # noqa: F811
    p = project.load(filmed(root, stamps="out_1/{camera}.csv"))
    assert p.videos("out_1") == {"cam02": "data/out_1/cam02.mp4"} and p.sidecars("out_2") == {}
    assert p.sidecars("out_1") == {"cam02": "data/out_1/cam02.csv"}
    assert p.topics("out_1") == {
        "cam01": "/cam01/color/image_raw/compressed", "cam02": "video0", "cam03": "/cam03/image",
    }  # fmt: skip
    assert p.picture_files("out_1") == [
        *("data/out_1/a.bag", "data/out_1/b.bag", "data/out_1/cam02.mp4", "data/out_1/cam02.csv")
    ]
    assert p.recordings("out_1")["video.cam02"] == "data/out_1/cam02.mp4"
    assert p.recordings("out_1")["stamps.cam02"] == "data/out_1/cam02.csv"
    assert p.videos("in_1") == {}


def test_without_bags_all_cameras_are_in_the_videos_read_as_their_yaml_says(root):  # noqa: F811
    filmed(root, bags="")
    edit(root, "sessions/field/cam02.yaml", "locate", "video: {stream: 1, frame: stored, fps: 240}\nlocate")
    p = project.load(root)
    assert set(p.videos("out_1")) == {"cam01", "cam02", "cam03"}
    assert p.topics("out_1") == {"cam01": "video0", "cam02": "video1/stored", "cam03": "video0"}
    assert p.video_rates("out_1") == {"cam02": "240"}


@pytest.mark.parametrize(
    ("how", "parts"),
    [
        ({"bags": "", "videos": ""}, ["line 3: sequence 'out_1' has no bags and no videos"]),
        ({"videos": ""}, ["line 3: sequence 'out_1' has no videos, and", "sessions/field/cam02.yaml has no topic"]),
        ({"cameras": ()}, ["'out_1' has bags and videos, and every camera of session 'field' has a topic"]),
        ({"videos": "/disk/{camera}.mp4"}, ["videos '/disk/{camera}.mp4' must be relative to data_root"]),
        ({"videos": "out_1/{cam}.mp4"}, ["line 3", "'videos' is 'out_1/{cam}.mp4'"]),
        (
            {"videos": "out_1/all.mkv", "cameras": ("cam01", "cam02")},
            ["cameras 'cam01' and 'cam02' of sequence 'out_1' are the same video0 of data/out_1/all.mkv"],
        ),
    ],
)
def test_what_is_wrong_is_said(root, how, parts):  # noqa: F811
    fails(filmed(root, **how), *parts)


def test_a_camera_without_a_topic_has_no_camera_info(root):  # noqa: F811
    filmed(root)
    edit(root, "sessions/field/cam02.yaml", LENS, "")
    fails(root, "sessions/field/cam02.yaml: 'intrinsics' is camera_info, which bags have and videos have not")


def test_stamps_are_of_videos(root):  # noqa: F811
    filmed(root, videos="", stamps="out_1/{camera}.csv", cameras=())
    sheet = root / "config/sequences.tsv"
    sheet.write_text(sheet.read_text().replace("out_2/{camera}.mp4", ""))
    fails(root, "sequence 'out_1' has stamps of videos, but no videos")
