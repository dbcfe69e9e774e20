"""Of broken projects `dior check` tells all that is wrong at once, by file and line; and nothing of whole ones."""

import json
import os
import re
import shutil
import tempfile
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

from dior.check import check, computer, found_people, recordings
from dior.cli import main
from dior.errors import DiorError
from dior.project import missing
from dior.project.project import load as read
from tests.check import recorded
from tests.project.test_project import edit, root  # noqa: F401

REPOSITORY = Path(__file__).parents[2]
REAL = REPOSITORY.parent / "shared/data/real_outdoor"
WALKS = "config/sequences.tsv"


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recorded")
    recorded.record(folder)
    return folder


@pytest.fixture
def project(root, data):  # noqa: F811
    """A whole project, to be broken."""
    return recorded.of_project(root, data)


def found(folder, capsys):
    """(exit code, faults, warnings, plan) by the JSON; a fault as `<file>:<line> <text>`."""
    code = check.run(folder, as_json=True)
    told = json.loads(capsys.readouterr().out)
    faults, warnings = (
        [f"{one['file'].removeprefix('config/')}:{one['line'] or ''} {one['text']}" for one in told[key]]
        for key in ("faults", "warnings")
    )
    assert code == bool(faults) and str(folder) not in "".join(faults + warnings)
    return faults, warnings, told["plan"]


def test_of_a_whole_project_it_says_what_will_be_done_and_what_to_type(project, capsys):
    assert main.main(["check", str(project)]) == 0
    text = capsys.readouterr().out
    assert text.startswith(
        "All is well.\n3 walks of 2 sessions, 4 s in all: 7 recordings of cameras, 280 pictures, in 5"
    )
    assert f"Type\n  dior run {project}\n\nBefore a release:\n  config/config.yaml: release.authors" in text
    faults, warnings, plan = found(project, capsys)
    assert not faults and not warnings
    assert (plan["walks"], plan["recordings"], plan["pictures"], plan["files"]) == (3, 7, 280, 5)


def nothing_there(project):
    shutil.rmtree(project / "data")
    (project / "datas").mkdir()
    return [r"config.yaml:1 data_root is 'data', where there is no folder \(did you mean 'datas'\?\)"]


def names_of_files(project):
    (project / "data/in_1/a.bag").rename(project / "data/in_1/aa.bag")
    (project / "data/out_1/mlkit").rename(project / "data/out_1/ml_kit")
    (project / "data/in_1/mocap.c3d").unlink()
    return [
        r"sequences.tsv:3 'out_1': data/out_1/mlkit/cam01.jsonl is not there \(detections of cam01\); not even the "
        r"folder data/out_1/mlkit \(did you mean 'ml_kit'\?\)",
        r"sequences.tsv:3 'out_1': data/out_1/mlkit/cam02.jsonl is not there \(detections of cam02\)",
        r"sequences.tsv:4 'in_1': data/in_1/a.bag is not there \(bag\) \(did you mean 'aa.bag'\?\)",
        r"sequences.tsv:4 'in_1': data/in_1/mocap.c3d is not there \(motion capture\)$",
    ]


def links_to_nothing(project):
    for path, to in (("out_1/mlkit/cam01.jsonl", "cam01.json"), ("in_1/mocap.c3d", "../mocap.c3d")):
        (project / f"data/{path}").unlink()
        (project / f"data/{path}").symlink_to(to)
    return [
        r"sequences.tsv:3 'out_1': data/out_1/mlkit/cam01.jsonl \(detections of cam01\) is a link to "
        "cam01.json, which is not there",
        r"sequences.tsv:4 'in_1': data/in_1/mocap.c3d \(motion capture\) is a link to ../mocap.c3d, which is not",
    ]


def broken_bags(project):
    for name in ("out_1/a.bag", "in_1/a.bag"):
        path = project / "data" / name
        path.write_bytes(path.read_bytes()[:-2000])
    (project / "data/out_2/b.bag").write_bytes(b"")
    return [
        r"sequences.tsv:2 'out_2': data/out_2/b.bag: the file is empty",
        r"sequences.tsv:3 'out_1': data/out_1/a.bag: the bag is truncated",
        r"sequences.tsv:4 'in_1': data/in_1/a.bag: the bag is truncated",
    ]


def wrong_topics(project):
    edit(project, "sessions/field/cam02.yaml", "cam02/color", "cam02/colour")
    edit(project, "sessions/field/cam03.yaml", "/cam03/image", "/cam03/camera_info")
    edit(project, "sessions/lab/cam01.yaml", "topic: /cam01/image", "topic: /cam01/image\nbag: _0123")
    return [
        r"sessions/field/cam02.yaml:2 /cam02/colour/image_raw/compressed is not there \(did you mean '/cam02/color/",
        r"sessions/field/cam03.yaml:2 /cam03/camera_info: its type is sensor_msgs/msg/CameraInfo, not",
        r"sessions/lab/cam01.yaml:3 'bag' is '_0123', which is in the name of no bag; they are a.bag",
    ]


def pictures_and_lenses(project):
    recorded.bag(project / "data/out_2/b.bag", [recorded.COLOUR.format(2)], 0.2, size=(24, 32))
    edit(project, "sessions/field/cam03.yaml", "topic: /cam03/image\n", "topic: /cam03/image\ncamera_info: /lens\n")
    lens = "topic: /cam01/image\nintrinsics: {file: lens.toml, name: cam9}\n"
    edit(project, "sessions/lab/cam01.yaml", "topic: /cam01/image\n", lens)
    (project / "data/lens.toml").write_text(LENS)
    return [
        r"sessions/field/cam02.yaml: cam02: the pictures are 32x24 but the intrinsics are for 64x48",
        r"sessions/field/cam03.yaml: the bags with its pictures have no message of /lens; name its topic",
        r"sessions/lab/cam01.yaml:3 data/lens.toml: no camera 'cam9' \(did you mean 'cam01'\?\)",
    ]


def lenses_of_another_size(project):
    pictures_and_lenses(project)
    edit(project, "sessions/lab/cam01.yaml", "cam9", "cam01")
    edit(project, "sessions/field/cam03.yaml", "camera_info: /lens\n", "")
    recorded.bag(project / "data/out_2/b.bag", [recorded.COLOUR.format(2)], 0.2)
    edit(project, "sessions/field/cam01.yaml", "locate: tape", "intrinsics: {chessboard: {path: board, rows: 7, "
         "columns: 4, square_m: 0.06}}\nlocate: tape")  # fmt: skip
    return [
        r"sessions/field/cam01.yaml:3 'intrinsics': data/board is not there",
        r"sessions/lab/cam01.yaml:3 cam01: the pictures are 64x48 but the intrinsics are for 1920x1080",
    ]


def other_times(project):
    recorded.bag(project / "data/out_1/b.bag", [recorded.COLOUR.format(2)], 5.0)
    recorded.detections(project / "data/out_1/mlkit/cam02.jsonl", start_s=5.0)
    log = project / "data/in_1/trigger.jsonl"
    log.write_text(log.read_text().replace(str(recorded.T0), str(recorded.T0 + 10**11)))
    return [
        r"sequences.tsv:3 out_1: the recordings do not overlap: that of cam01, cam03 \(a.bag\) ended 3.7 s before that "
        r"of cam02 \(b.bag\) began",
        r"sequences.tsv:4 data/in_1/trigger.jsonl: the capture 'walk 3' began 100.0 s after the first picture",
    ]


def clocks_that_cannot_be(project):
    (project / "config/offsets").mkdir(exist_ok=True)
    (project / "config/offsets/out_1.yaml").write_text("cam02: {offset_s: 1.0e+9}\n")
    return [
        r"offsets/out_1.yaml: with offset_s 1e\+09 the pictures of 'cam02' begin \d+ s after the other cameras' end"
    ]


def sure_of_nothing(project):
    (project / "config/offsets").mkdir(exist_ok=True)
    (project / "config/offsets/out_1.yaml").write_text("cam02: {offset_s: 0, sigma_s: 1.0e+9}\n")
    return [r"offsets/out_1.yaml(:1|:) 'cam02.sigma_s' .*at most 10"]


def marks_and_boxes(project):
    edit(project, "sessions/lab/cam01.marks.csv", "3,LASI", "3,LASY")
    edit(project, "sessions/lab/cam01.marks.csv", "9,LASI", "90,LASI")
    edit(project, "sessions/lab/cam01.marks.csv", "RASI,12,30", "RASI,12,48")
    boxes = "v_max\n12,1,1,9,9\n400,1,1,9,9\n13,9,1,1,9\n14,60,1,70,9\n"
    edit(project, "boxes/out_1.cam03.csv", "v_max\n", boxes)
    edit(project, "checks/out_1.cam01.csv", "u,v\n", "u,v\nout_1,40,LASI,3,4\nout_2,4,LASI,3,4\nout_1,4,LASI,3,-4\n")
    (project / "config/people").mkdir()
    (project / "config/people/out_1.yaml").write_text("seeds: [{camera: cam01, frame: 50, u: 1.5, v: 2}]\n")
    return [
        r"boxes/out_1.cam03.csv:3 frame 400 is not in the recording, whose frames are 0 to 39",
        r"boxes/out_1.cam03.csv:4 the box is inside out",
        r"boxes/out_1.cam03.csv:5 the middle of the box, \(65, 5\), is outside of the 64x48 picture; was it drawn in",
        r"checks/out_1.cam01.csv:2 frame 40 is not in the recording",
        r"checks/out_1.cam01.csv:3 is of sequence 'out_2', not 'out_1'",
        r"checks/out_1.cam01.csv:4 \(3, -4\) is outside of the 64x48 picture",
        r"people/out_1.yaml: seed 1: frame 50 is not in 'out_1'",
        r"sessions/lab/cam01.marks.csv:2 \(12, 48\) is outside of the 64x48 picture",
        r"sessions/lab/cam01.marks.csv:4 'LASY' is no marker of the motion capture of 'in_1' \(did you mean 'LASI'\?\)",
        r"sessions/lab/cam01.marks.csv:5 frame 90 is not in 'in_1', whose frames are 0 to 39; is it of another walk",
    ]


def what_detectors_found(project):
    data = project / "data"
    recorded.detections(data / "out_1/mlkit/cam01.jsonl", 1)
    recorded.detections(data / "out_1/mlkit/cam02.jsonl", 0, 90)
    (data / "out_2/mlkit/cam01.jsonl").write_text('{"what": "is this?"}\n')
    edit(project, "config.yaml", "data_root: data\n", "data_root: data\ndetector: {format: mlkit}\n")
    (data / "out_2/mlkit/cam02.jsonl").write_text("")
    return [
        r"sequences.tsv:2 out_2, cam01: the file .*cam01.jsonl is something else, not mlkit; correct detector.format",
        r"sequences.tsv:2 out_2, cam02: the file .*cam02.jsonl is empty; run the detector",
        r"sequences.tsv:3 out_1, cam01: .* has frames 1 to 40, and the recording has frames 0 to 39; are they counted "
        r"from 1\? Then `detector.first_frame` in config.yaml should be 1",
        r"sequences.tsv:3 out_1, cam02: .* has frames 0 to 89, and the recording has frames 0 to 39; are they of",
    ]


def too_few_marks(project):
    edit(project, "sessions/lab/cam01.marks.csv", "in_1,9,LASI,11,21\n", "in_1,9,LASI,eleven,21\n")
    aligned(project, "from: marks")
    marks = "sequence,frame,joint,u,v\n" + "".join(f"out_1,{i},nose,3,4\n" for i in range(3)) + "out_2,3,nose,3,4\n"
    (project / "config/sessions/field/cam03.marks.csv").write_text(marks)
    return [
        r"sessions/field/cam03.marks.csv: 6 usable edges and clicked coordinates; draw boxes on at least 4 pictures",
        r"sessions/lab/cam01.marks.csv:5 u is 'eleven', not a number",
    ]


def too_few_boxes(project):
    edit(project, "sessions/lab/cam01.marks.csv", "in_1,9,LASI,11,21\n", "")
    aligned(project, "from: boxes")
    edit(project, "boxes/out_1.cam03.csv", "v_max\n", "v_max\n12,1,1,9,9\n13,,,,\n")
    return [
        r"boxes/out_1.cam03.csv: 4 usable edges and clicked coordinates; draw boxes on at least 4 pictures",
        r"sessions/lab/cam01.marks.csv: 3 usable marks, but at least 4 are needed; mark more points",
    ]


def aligned(project, how):
    nudged, fitted = "nudge: {azimuth_deg: 0.2}", f"align: {{{how}, sequences: [out_1]}}"
    edit(project, "sessions/field/cam03.yaml", nudged, fitted)


def boxes_of_walks_that_are_left_out(project):
    aligned(project, "from: boxes")
    edit(project, "sessions/field/cam03.yaml", "[out_1]", "[out_1, out_3]")
    return [r"sessions/field/cam03.yaml: align.sequences names 'out_3', which has an exclude_reason"]


def a_bag_twice(project):
    edit(project, "sequences.tsv", "out_1/a.bag; out_1/b.bag", "out_1/a.bag;out_1/b.bag;out_1/b.bag")
    return [r"sequences.tsv:3 'out_1': bag data/out_1/b.bag is given twice; delete one"]


def more_views_than_cameras(project):
    edit(project, "config.yaml", "adjust: {min_views: 2}\n", "")
    return [r"config.yaml: 'adjust.min_views' is 3, and field has 2 close cameras to adjust; write 2"]


def boxes_of_no_walk(project):
    aligned(project, "from: boxes")
    edit(project, "sessions/field/cam03.yaml", "[out_1]", "[out_7]")
    return [r"sessions/field/cam03.yaml: align.sequences: 'out_7' is no sequence of field"]


def detections_of_others(project):
    """Of another time, cut off, one file for two cameras, a folder whose last file is cut off."""
    mlkit = project / "data/out_1/mlkit"
    recorded.detections(mlkit / "cam01.jsonl", start_s=-60.0)
    text = (mlkit / "cam02.jsonl").read_text()
    (mlkit / "cam02.jsonl").write_text(text[:-30])
    edit(project, "sequences.tsv", "out_2/mlkit/{camera}.jsonl", "out_2/all.csv")
    rows = [",".join([f"walk_{i}.jpg", "walks", *["5"] * 99]) for i in range(recorded.COUNT)]
    (project / "data/out_2/all.csv").write_text("\n".join([*rows, rows[0][:-2]]))
    return [
        r"sequences.tsv:2 data/out_2/all.csv: the last line has 100 columns, and that before it 101; was the detector",
        r"sequences.tsv:3 out_1, cam01: data/out_1/mlkit/cam01.jsonl has a stamp 60.0 s before the first picture",
        r"sequences.tsv:3 data/out_1/mlkit/cam02.jsonl: the last line: not the JSON of ML Kit .*was the detec",
    ]


def motion_captures(project):
    recorded.c3d(project / "data/in_1/mocap.c3d", ("A1", "A2", "A3", "A4", "A5"))
    edit(project, "sequences.tsv", "#walk 3", "#walk 4")
    return [
        r"sequences.tsv:4 data/in_1/trigger.jsonl: no capture of this trigger log is called 'walk 4'.*'walk 3'",
        r"sequences.tsv:4 data/in_1/mocap.c3d: 0 of the 39 Plug-in-Gait markers are there",
    ]


def odd_recordings(project):
    recorded.bag(project / "data/in_1/a.bag", [recorded.LAB], stamped=False)
    recorded.c3d(project / "data/in_1/mocap.c3d", units=("furlong",))
    recorded.bag(project / "data/out_1/c.bag", [recorded.COLOUR.format(2)], 1.0, size=(24, 32))
    edit(project, "sequences.tsv", "out_1/b.bag", "out_1/b.bag;out_1/c.bag")
    picture = recorded.COLOUR.format(1)
    edit(
        project, "sessions/field/cam03.yaml", "topic: /cam03/image\n", f"topic: /cam03/image\ncamera_info: {picture}\n"
    )
    return [
        r"sequences.tsv:4 data/in_1/mocap.c3d: POINT:UNITS is 'furlong', not one of mm, cm, m",
        r"sessions/field/cam02.yaml:2 .* has pictures of 64x48 and 32x24 px; a camera must keep one resolution",
        r"sessions/field/cam03.yaml: data/out_1/a.bag: the first message of .* is a sensor_msgs/msg/Compressed",
        r"sessions/lab/cam01.yaml:2 /cam01/image: the header stamps are zero",
    ]


def test_what_is_unusual_is_no_mistake(project, capsys):
    """A lens that only the second of two bags has, a marked point that is no marker, frames that count from 1."""
    recorded.bag(project / "data/out_1/c.bag", [recorded.COLOUR.format(1)], -1.0, lenses=False)
    edit(project, "sequences.tsv", "out_1/a.bag", "out_1/c.bag;out_1/a.bag")
    marks = "sequence,frame,joint,u,v,x,y,z\nin_1,3,LASI,10,20,,,\nin_1,9,corner,11,21,1,2,0\n"
    marks += "in_1,9,LASI,63.4,47.4,,,\nin_1,9,RASI,-0.5,-0.5,,,\n"
    (project / "config/sessions/lab/cam01.marks.csv").write_text(marks)
    edit(project, "config.yaml", "data_root: data\n", "data_root: data\ndetector: {first_frame: 1}\n")
    for walk in ("out_1", "out_2"):
        for camera, start_s in (("cam01", -recorded.STEP / 1e9), ("cam02", 0.2 - recorded.STEP / 1e9)):
            recorded.detections(project / "data" / walk / "mlkit" / f"{camera}.jsonl", 1, start_s=start_s)
    # a box that sticks out, and hand checks that are still to be marked
    edit(project, "boxes/out_1.cam03.csv", "v_max\n", "v_max\n12,50,1,75,20\n13,,,,\n")
    edit(project, "checks/out_1.cam01.csv", "u,v\n", "u,v\nout_1,3,nose,,\n")
    faults, warnings, _ = found(project, capsys)
    assert not faults and not warnings


def test_nothing_could_run_where_each_walk_lacks_something(project):
    p = read(project)
    lines = dict.fromkeys(p.rows, 1)
    (project / "data/in_1/a.bag").unlink()
    (project / "data/out_1/b.bag").unlink()
    assert not missing.nothing_could_run(p, missing.of_project(p, lines))
    (project / "data/out_2/mlkit/cam01.jsonl").unlink()
    assert missing.nothing_could_run(p, missing.of_project(p, lines))


def files_and_recordings(project):
    """What one session's files have wrong hides nothing of the other's recordings."""
    edit(project, "sessions/lab/cam01.yaml", "role: close", "role: clsoe\ncolour: red")
    edit(project, "sessions/field/cam02.yaml", "cam02/color", "cam02/colour")
    (project / "data/out_1/mlkit/cam02.jsonl").unlink()
    return [
        r"sequences.tsv:3 'out_1': data/out_1/mlkit/cam02.jsonl is not there \(detections of cam02\)",
        r"sessions/field/cam02.yaml:2 /cam02/colour/image_raw/compressed is not there",
        r"sessions/lab/cam01.yaml:1 'role' is 'clsoe' but should be one of close, long_range",
        r"sessions/lab/cam01.yaml:2 unknown key 'colour'",
    ]


def sheets_and_recordings(project):
    """Nor does a wrong sheet hide which recordings are missing."""
    edit(project, "subjects.tsv", "zebra-0001", "z")
    edit(project, "config.yaml", "triangulate", "tringulate")
    (project / "data/in_1/a.bag").unlink()
    (project / "data/in_1/trigger.jsonl").unlink()
    return [
        r"config.yaml:3 unknown key 'tringulate' \(did you mean 'triangulate'\?\)",
        r"sequences.tsv:4 'in_1': data/in_1/a.bag is not there",
        r"sequences.tsv:4 'in_1': data/in_1/trigger.jsonl is not there",
        r"subjects.tsv:2 'pseudonym' is",
    ]


def still_to_do(project):
    """It hides nothing else of the same files, nor a session that is not there."""
    edit(project, "sessions/field/cam01.yaml", "role: close", "role: TODO\ncolour: red")
    edit(project, "config.yaml", "data_root: data\n", "data_root: data\npeople: TODO\ntime: {max_gap: much}\n")
    edit(project, "sequences.tsv", "out_1\t9\tS01", "out_1\t9\tTODO: S01 or S02")
    edit(project, "sequences.tsv", "out_2\t10\tS02\tfield\toutdoor", "out_2\t10\tS02\tfeild\toutside")
    edit(project, "sequences.tsv", "\train", "\tTODO: why?")
    (project / "data/in_1/a.bag").unlink()
    return [
        r"config.yaml: still TODO: people \(line 2\)",
        r"config.yaml:3 'time.max_gap' is 'much' but should be a number",
        r"sequences.tsv: still TODO: subject \(line 3\), exclude_reason \(line 5\)",
        r"sequences.tsv:2 'environment' is 'outside'",
        r"sequences.tsv:2 session 'feild' of sequence 'out_2' has no config/sessions/feild/session.yaml \(did you",
        r"sequences.tsv:4 'in_1': data/in_1/a.bag is not there",
        r"sessions/field/cam01.yaml: still TODO: role \(line 1\)",
        r"sessions/field/cam01.yaml:2 unknown key 'colour'",
    ]


def still_to_do_in_a_session(project):
    """The walks of the others are looked at."""
    edit(project, "sessions/field/cam01.yaml", "/cam01/color/image_raw/compressed", "TODO")
    edit(project, "sessions/field/session.yaml", "cameras", "kameras")
    edit(project, "sessions/field/cam02.yaml", "role: close", "role: clse")
    edit(project, "sessions/field/cam03.yaml", "topic: /cam", "lens: d455\ndistortion_model: plumb_bob\ntopic: -cam")
    edit(project, "sessions/lab/cam01.yaml", "/cam01/image", "/cam01/imag")
    (project / "data/out_1/b.bag").unlink()
    return [
        r"sequences.tsv:3 'out_1': data/out_1/b.bag is not there",
        r"sessions/field/cam01.yaml: still TODO: topic \(line 2\)",
        r"sessions/field/cam02.yaml:1 'role' is 'clse'",
        r"sessions/field/cam03.yaml:2 'lens' and 'distortion_model' say the same thing",
        r"sessions/field/cam03.yaml:4 'topic' is '-cam03/image', which begins with -",
        r"sessions/field/session.yaml:1 unknown key 'kameras' \(did you mean 'cameras'\?\)",
        r"sessions/lab/cam01.yaml:2 /cam01/imag is not there",
    ]


def links_and_folders(project):
    (project / "data/in_1/a.bag").unlink()
    (project / "data/in_1/a.bag").symlink_to("/nowhere/a.bag")
    (project / "data/out_1/b.bag").write_bytes(b"0123456789")
    (project / "config/boxes/out_1.cam03.csv").unlink()
    (project / "config/boxes/out_1.cam03.csv").mkdir()
    return [
        r"boxes/out_1.cam03.csv: is a folder; put the file there, or remove it",
        r"sequences.tsv:3 'out_1': data/out_1/b.bag: this is not a bag \(it begins with b'0123456789', and ends after "
        r"10 bytes\); copy it again",
        r"sequences.tsv:4 'in_1': data/in_1/a.bag \(bag\) is a link to /nowhere/a.bag, which is not there; copy the",
    ]


def ways_of_writing(project):
    path = project / "config/config.yaml"
    path.write_bytes(path.read_bytes() + "# Größe\n".encode("latin-1"))
    edit(project, "sessions/field/session.yaml", "adjust: {out_1", "adjust:\n\tout_1: {")
    (project / "config/subjects.tsv").unlink()
    (project / "config/sessions/lab/cam01.yaml").unlink()
    (project / "config/sessions/lab/cam01.yaml").symlink_to("/nowhere/cam01.yaml")
    return [
        r"config.yaml:5 the byte 0xf6 is not UTF-8, .*; save it again as UTF-8 \(in the list of encodings where",
        r"sessions/field/session.yaml:3 not valid YAML .*; a line is indented with blanks, and this one holds a tab",
        r"sessions/lab/cam01.yaml: there is no such file as that to which it is a link, /nowhere/cam01.yaml; mend",
        r"subjects.tsv: there is no such file; write one with a row for each subject and the columns subject, pseu",
    ]


def silent_cameras(project):
    recorded.bag(project / "data/out_1/b.bag", [recorded.COLOUR.format(2)], count=1)
    recorded.bag(project / "data/out_2/a.bag", [recorded.COLOUR.format(1)])
    edit(project, "sequences.tsv", "out_2/mlkit/{camera}", "out_2/mlkit/{camera}_x")
    return [
        r"sequences.tsv:2 'out_2': .* is not there \(detections of cam01\) \(did you mean 'cam01.jsonl'\?\)",
        r"sequences.tsv:2 'out_2': .* is not there \(detections of cam02\)",
        r"sessions/field/cam02.yaml:2 /cam02/color/image_raw/compressed: one picture is no recording",
        r"sessions/field/cam03.yaml:2 /cam03/image is not there; of pictures there are /cam01/color/",
    ]


def filmed(project):
    """cam02 is in videos of both walks: a folder of pictures, and one with a single stream."""
    pytest.importorskip("av", reason="pip install -e '.[video]'")
    from tests.ingest import videofiles

    sheet = project / "config/sequences.tsv"
    header, *rows = sheet.read_text().splitlines()
    rows = [f"{row}\t{row.split(chr(9))[0]}/{{camera}}.mp4" if row.startswith("out") else f"{row}\t" for row in rows]
    sheet.write_text("\n".join([f"{header}\tvideos", *rows]) + "\n")
    small = {"1920.0, 1080.0": "64.0, 48.0", "960.0, 0.0, 960.0": "60.0, 0.0, 31.5", "960.0, 540.0": "60.0, 23.5"}
    lens = LENS
    for old, new in small.items():
        lens = lens.replace(old, new)
    (project / "data/lens.toml").write_text(lens)
    lens = "intrinsics: {file: lens.toml, name: cam01}\n"
    edit(project, "sessions/field/cam02.yaml", "topic: /cam02/color/image_raw/compressed\n", lens)
    pictures = [videofiles.numbered(i) for i in range(recorded.COUNT)]
    created = {"creation_time": "2001-01-01T10:20:30"}
    videofiles.write(project / "data/out_2/cam02.mp4", pictures, metadata=created)
    folder = project / "data/out_1/cam02.mp4"
    folder.mkdir()
    for i in range(recorded.COUNT):
        (folder / f"{i}.jpg").write_bytes(recorded.encoded(recorded.picture(i, recorded.SIZE), ".jpg").tobytes())


def videos(project):
    filmed(project)
    edit(project, "sessions/field/cam02.yaml", "role", "video: {stream: 3}\nrole")
    return [
        r"sessions/field/cam02.yaml:1 data/out_1/cam02.mp4 is a folder of pictures, which have no time; give `video:",
        r"sessions/field/cam02.yaml:1 /video3 is not there .*; of pictures there are /video0, /video0/stored",
    ]


def test_of_broken_videos_it_is_said_what_they_are(project, capsys):
    filmed(project)
    edit(project, "sessions/field/cam02.yaml", "role", "video: {fps: 30}\nrole")
    path, folder = project / "data/out_2/cam02.mp4", project / "data/out_1/cam02.mp4"
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    for picture in folder.iterdir():
        picture.rename(picture.with_suffix(".txt"))
    first, second = found(project, capsys)[0]
    assert first.startswith("sequences.tsv:2 'out_2': data/out_2/cam02.mp4: the video is truncated or was not closed")
    assert second.startswith("sequences.tsv:3 'out_1': data/out_1/cam02.mp4: this folder holds neither pictures (.jpeg")
    path.write_bytes(b"")
    shutil.rmtree(folder)
    first, second = found(project, capsys)[0]
    assert "data/out_2/cam02.mp4: the file is empty; copy it again" in first
    assert "data/out_1/cam02.mp4 is not there (video of cam02)" in second


def test_of_whole_videos_nothing_is_wrong(project, capsys):
    filmed(project)
    edit(project, "sessions/field/cam02.yaml", "role", "video: {fps: 30}\nrole")
    faults, warnings, plan = found(project, capsys)
    assert not faults and not warnings and plan["recordings"] == 7


LENS = (
    '[cam01]\nname = "cam01"\nsize = [1920.0, 1080.0]\nmatrix = [[960.0, 0.0, 960.0], [0.0, 960.0, 540.0], '
    "[0.0, 0.0, 1.0]]\ndistortions = [0.0, 0.0, 0.0, 0.0]\nrotation = [0.0, 0.0, 0.0]\n"
    "translation = [0.0, 0.0, 0.0]\nfisheye = false\n"
)
BROKEN = [
    nothing_there, names_of_files, links_to_nothing, broken_bags, wrong_topics, pictures_and_lenses,
    lenses_of_another_size, other_times, clocks_that_cannot_be, sure_of_nothing,
    marks_and_boxes, what_detectors_found, motion_captures, files_and_recordings, sheets_and_recordings,
    odd_recordings, still_to_do, still_to_do_in_a_session, silent_cameras, videos, too_few_marks, too_few_boxes,
    boxes_of_walks_that_are_left_out, boxes_of_no_walk,
    more_views_than_cameras, a_bag_twice,
    detections_of_others, links_and_folders, ways_of_writing,
]  # fmt: skip


@pytest.mark.parametrize("breaking", BROKEN)
def test_all_that_is_wrong_is_told_at_once(breaking, project, capsys):
    said = breaking(project)
    faults, warnings, plan = found(project, capsys)
    assert len(faults) == len(said), faults
    for sentence, fault in zip(said, faults, strict=True):
        assert re.match(sentence, fault), (sentence, fault)
    assert plan is None and not warnings


def test_people_read_it_by_file_with_the_walks_of_a_fault_named_once(project, capsys):
    wrong_topics(project)
    assert main.main(["check", str(project)]) == 1
    lines = capsys.readouterr().out.splitlines()
    at = lines.index("config/sessions/field/cam02.yaml")
    assert lines[at + 1].startswith("  line 2: /cam02/colour/image_raw/") and lines[at + 1].endswith("(out_1, out_2)")
    assert lines[-1] == f"3 to mend in 3 files; then: dior check {project}"


def test_a_recording_of_two_walks_is_told_unless_it_is_said_who_is_whose(project, capsys):
    edit(project, "sequences.tsv", "out_1/a.bag; out_1/b.bag", "out_2/a.bag;out_2/b.bag")
    edit(project, "sequences.tsv", "out_1/mlkit", "out_2/mlkit")
    faults, warnings, _ = found(project, capsys)
    assert not faults and warnings == [
        "sequences.tsv:3 'out_1' has data/out_2/a.bag, which 'out_2' has, too, and both label it; is it of another "
        "walk?"
    ]
    (project / "config/people").mkdir()
    for name in ("out_1", "out_2"):
        (project / f"config/people/{name}.yaml").write_text("seeds: [{camera: cam01, frame: 3, u: 20, v: 20}]\n")
    assert found(project, capsys)[:2] == ([], [])


def test_of_many_faults_that_are_alike_people_read_the_first(project, capsys):
    rows = "".join(f"in_1,{frame},LASI,10,20\n" for frame in range(100, 150))
    edit(project, "sessions/lab/cam01.marks.csv", "in_1,9,LASI,11,21\n", f"in_1,9,LASY,11,21\n{rows}")
    assert main.main(["check", str(project)]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "config/sessions/lab/cam01.marks.csv" and lines[3] == "" and lines[4].startswith("51 to mend")
    assert "'LASY' is no marker" in lines[1] and lines[2].startswith("  line 6: frame 100 is not in 'in_1', whose")
    assert lines[2].endswith("is it of another walk?; and 49 more like it, to line 55")
    assert len(found(project, capsys)[0]) == 51


def test_the_ends_of_detections_are_told_as_their_reader_would_have_them(tmp_path):
    """JSON lines by frame or by stamp, whatever the file is called, a list, rows; of each, whole and cut off."""
    line = '{"frame": %d, "stamp_ns": %d, "landmarks": []}\n'
    stamped = '{"timestamp_ms": %d, "pose_landmarks": []}\n'
    numbered = '{"frame": %d, "timestamp_ms": 5, "pose_landmarks": []}\n'
    for kind, text, ends in (
        ("mlkit", "".join(line % (i, 50 - i) for i in range(9, 2, -1)), ((3, 9), (41, 47))),
        ("mlkit", line % (4, 7), ((4, 4), (7, 7))),
        ("mediapipe", "".join(stamped % i for i in range(3)), (None, (0, 2_000_000))),
        ("mediapipe", "".join(numbered % i for i in range(3)), ((0, 2), None)),
        ("coco", '[{"image_id": 1, "keypoints": []}, {"image_id": 2, "keypoints": []}]', (None, None)),
        ("yolo", "0 1 2 3\n1 1 2 3\n2 1 2 3\n", (None, None)),
    ):
        path = tmp_path / "cam01.json"
        path.write_text(f"\ufeff{text}")
        told = found_people._ends(path, kind)
        assert (told.frames, told.stamps) == ends
        path.write_text(text.rstrip()[:-1])
        with pytest.raises(DiorError, match="was the detector interrupted"):
            found_people._ends(path, kind)
    path.write_text("\n".join(['{"frame": 0}', '{"frame": 1, "long": "%s"}' % ("x" * 2 * found_people.END_BYTES)]))
    assert found_people._ends(path, "mlkit").frames is None


@pytest.mark.parametrize("form", ["db3", "mcap", "mcap zstd", "db3 alone", "mcap alone"])
def test_bags_of_ros_2_whole_and_broken(form, project, capsys):
    path = recorded.bag(project / "data/in_1/a.bag", [recorded.LAB], form=form)
    name = path.relative_to(project / "data").as_posix()
    edit(project, "sequences.tsv", "in_1/a.bag", name)
    faults, warnings, plan = found(project, capsys)
    assert not faults and not warnings and plan["pictures"] == 280
    edit(project, "sessions/lab/cam01.yaml", "/cam01/image", "/cam01/picture")
    files = [path] if path.is_file() else sorted(one for one in path.iterdir() if one.suffix != ".yaml")
    assert re.match(
        r"sessions/lab/cam01.yaml:2 /cam01/picture is not there \(did you mean", found(project, capsys)[0][0]
    )
    content = files[0].read_bytes()
    files[0].write_bytes(content[: len(content) // 2])
    faults, *_ = found(project, capsys)
    assert len(faults) == 1 and faults[0].startswith(f"sequences.tsv:4 'in_1': data/{name}: ")
    assert "truncated or was not closed" in faults[0]
    files[0].unlink()
    faults, *_ = found(project, capsys)
    assert (
        len(faults) == 1 and faults[0].startswith(f"sequences.tsv:4 'in_1': data/{name}") and "not there" in faults[0]
    )


def as_nobody(function, folder):
    """What a function prints that is called in a folder by a user who is not root."""
    # what it imports may not be readable by others
    with tempfile.TemporaryFile("w+") as printed:
        child = os.fork()
        if not child:
            with redirect_stdout(printed), redirect_stderr(printed):
                if os.geteuid() == 0:
                    os.setgroups([])
                    os.setgid(65534)
                    os.setuid(65534)
                os.chdir(folder)
                function()
            printed.flush()
            os._exit(0)
        os.waitpid(child, 0)
        printed.seek(0)
        return printed.read()


def test_what_one_may_not_read_is_told_with_the_rest(project):
    """By somebody else than root, in a folder that everybody may enter, with blanks in its name."""
    with tempfile.TemporaryDirectory(prefix="dior check ") as folder:
        project = Path(shutil.copytree(project, Path(folder, "my walks")))
        for path in (Path(folder), *Path(folder).rglob("*")):
            path.chmod(0o755 if path.is_dir() else 0o644)
        with chdir(folder):
            assert main.main(["check", "my walks"]) == 0
        closed = ["config/sessions/lab/cam01.yaml", "data/out_1/a.bag", "data/out_2/mlkit", "data/in_1/mocap.c3d"]
        for name in closed:
            (project / name).chmod(0)

        def told():
            return as_nobody(lambda: main.main(["check", "my walks"]), folder)

        text = told()
        for name in closed:
            assert f"try `chmod -R u+rX {name}`, or ask whose it is" in text
        assert text.endswith("5 to mend in 2 files; then: dior check 'my walks'\n")
        (project / "config/sessions/field").chmod(0o600)
        assert told().startswith("config/sessions/field\n  cannot be read (Permission denied); try `chmod")
        (project / "config/sessions/field").chmod(0o755)
        (project / "data").chmod(0)
        assert "data_root: you have no right to look into data; try `chmod -R u+rX data`" in told()
        for name in ("data", *closed):
            (project / name).chmod(0o755)


def test_a_walk_that_is_excluded_or_of_somebody_who_did_not_agree_is_not_looked_at(project, capsys):
    for name in ("out_1", "in_1"):
        shutil.rmtree(project / "data" / name)
    edit(project, "subjects.tsv", "\tyes\t\n", "\tno\t\n")
    edit(project, "sessions/field/session.yaml", "adjust: {out_1", "adjust: {out_2")
    faults, _, plan = found(project, capsys)
    assert not faults and plan["walks"] == 1
    edit(project, "sequences.tsv", "out_2/mlkit/{camera}.jsonl\t\t", "out_2/mlkit/{camera}.jsonl\t\train")
    faults, _, _ = found(project, capsys)
    assert faults == ["sequences.tsv: every row has an exclude_reason, so there is nothing to process"]


def test_many_recordings_are_looked_at_by_several_processes_to_the_same_end(project, monkeypatch, capsys):
    broken_bags(project)
    alone = found(project, capsys)
    monkeypatch.setattr(recordings, "FEW", 1)
    monkeypatch.setattr(recordings, "cores", lambda: 2)
    assert found(project, capsys) == alone


def test_too_little_room_fails_where_nothing_is_made_yet(project, monkeypatch, capsys):
    monkeypatch.setattr(computer, "PICTURE_BYTES", 10**12)
    faults, _, _ = found(project, capsys)
    assert len(faults) == 1 and re.match(r"results/: the results take about 280\.0 TB, and .* are free", faults[0])
    (project / "results").mkdir()
    faults, warnings, plan = found(project, capsys)
    assert not faults and len(warnings) == 1 and plan


def test_little_memory_is_a_warning(project, monkeypatch, capsys):
    monkeypatch.setattr(computer, "free_memory", lambda: 500_000_000)
    monkeypatch.setattr(computer, "cores", lambda: 4)
    faults, warnings, _ = found(project, capsys)
    assert not faults and "4 jobs at once may take 1.6 GB of memory, and 500.0 MB are free" in warnings[0]
    assert "-j1" in warnings[0]


def test_packages_that_are_asked_for(project, monkeypatch, capsys):
    monkeypatch.setattr(computer, "find_spec", lambda name: None)
    assert not found(project, capsys)[0]
    (project / "net.onnx").touch()
    edit(project, "config.yaml", "data_root: data\n", "data_root: data\ndetector: {model: net.onnx}\n")
    edit(project, "sequences.tsv", "out_2/mlkit/{camera}.jsonl", "detect")
    (project / "data/out_1/cam02.mp4").touch()
    edit(project, "sequences.tsv", "exclude_reason", "exclude_reason\tvideos")
    edit(
        project, "sequences.tsv", "out_1/mlkit/{camera}.jsonl\t\t", "out_1/mlkit/{camera}.jsonl\t\t\tout_1/{camera}.mp4"
    )
    edit(project, "sequences.tsv", "detect\t\t", "detect\t\t\tout_1/{camera}.mp4")
    lens = "intrinsics: {chessboard: {path: out_1, rows: 7, columns: 4, square_m: 0.06}}\n"
    edit(project, "sessions/field/cam02.yaml", "topic: /cam02/color/image_raw/compressed\n", lens)
    faults, _, _ = found(project, capsys)
    assert faults == [
        "config.yaml:2 `detections: detect` needs onnxruntime; install it: pip install -e '.[detect]'",
        "sequences.tsv: data/out_1/cam02.mp4 is a video, which needs PyAV; install it: pip install -e '.[video]'",
    ]


def test_a_bag_that_is_compressed_as_a_whole_is_not_unpacked(project, capsys):
    from backports import zstd

    path = project / "data/in_1/a.bag"
    path.write_bytes(zstd.compress(path.read_bytes()))
    faults, warnings, _ = found(project, capsys)
    assert not faults and len(warnings) == 1
    assert warnings[0].startswith("sequences.tsv:4 'in_1': data/in_1/a.bag is compressed as a whole")


def test_what_will_be_simulated_is_not_missed(tmp_path, capsys):
    from dior.simulate import config, settings

    config.write(settings.from_dict({"subjects": 1, "sequences": 1, "duration_s": 1.0}), tmp_path / "config")
    assert main.main(["check", str(tmp_path)]) == 0
    assert "2 walks of 2 sessions, which are simulated first. Type" in capsys.readouterr().out


@pytest.mark.skipif(not REAL.exists(), reason="no recordings of others")
def test_nothing_is_wrong_with_a_real_recording(capsys):
    faults, warnings, plan = found(REPOSITORY / "tests/projects/real_outdoor", capsys)
    assert not faults and not warnings and plan["pictures"] == 400


def test_where_there_is_no_project(tmp_path):
    with pytest.raises(DiorError, match="there is no config/ in it"):
        check.run(tmp_path)
