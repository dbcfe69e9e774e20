"""The config is read as written, and each slip in it is one sentence that names where and the nearest word."""

import dataclasses
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from dior.errors import DiorError, DiorErrors, Faults, nearest
from dior.project import licenses, project, schema_check

SEQUENCES = (
    "sequence session_order subject session environment outfit walk bags mocap detections trigger_log exclude_reason"
).split()
CLOSE = "role: close\ntopic: /{name}/color/image_raw/compressed\nlocate: tape\ntape: {{position_m: [{x}, 0, 1.5]}}\n"
LONG = (
    "role: long_range\ntopic: /cam03/image\nlocate: align\ntape: {position_m: [60, 0, 2]}\n"
    + "nudge: {azimuth_deg: 0.2}\n"
)


def row(**cells):
    return "\t".join(cells.get(column, "") for column in SEQUENCES)


@pytest.fixture
def root(tmp_path):
    """A project of two subjects: one indoor and two outdoor sequences, and an excluded one."""
    texts = {
        "config.yaml": "data_root: data\ntriangulate: {method: rays}\n"
        "release: {version: 0.1.0, title: A test, license: CC-BY-4.0}\n",
        "sequences.tsv": "\n".join(
            [
                "\t".join(SEQUENCES),
                row(
                    sequence="out_2",
                    session_order="10",
                    subject="S02",
                    session="field",
                    environment="outdoor",
                    bags="out_2/a.bag;out_2/b.bag",
                    detections="out_2/mlkit/{camera}.jsonl",
                ),
                row(
                    sequence="out_1",
                    session_order="9",
                    subject="S01",
                    session="field",
                    environment="outdoor",
                    bags="out_1/a.bag; out_1/b.bag",
                    detections="out_1/mlkit/{camera}.jsonl",
                ),
                row(
                    sequence="in_1",
                    session_order="1",
                    subject="S01",
                    session="lab",
                    environment="indoor",
                    bags="in_1/a.bag",
                    mocap="in_1/mocap.c3d",
                    trigger_log="in_1/trigger.jsonl#walk 3",
                ),
                row(
                    sequence="out_3",
                    session_order="11",
                    subject="S01",
                    session="field",
                    environment="outdoor",
                    bags="out_3/a.bag",
                    exclude_reason="rain",
                ),
            ]
        )
        + "\n",
        "subjects.tsv": "subject\tpseudonym\theight_m\theight_sigma_m\tconsent_release\tconsent_processing\n"
        "S01\tzebra-0001\t1.72\t0.01\tyes\t\nS02\tapple-0002\t\t\tno\tyes\n",
        "sessions/field/session.yaml": "cameras: [cam01, cam02, cam03]\nadjust: {out_1: {count: 100}}\n",
        "sessions/field/cam01.yaml": CLOSE.format(name="cam01", x=4),
        "sessions/field/cam02.yaml": CLOSE.format(name="cam02", x=-4),
        "sessions/field/cam03.yaml": LONG,
        "sessions/lab/session.yaml": "cameras: [cam01]\n",
        "sessions/lab/cam01.yaml": "role: close\ntopic: /cam01/image\nlocate: marks\n",
        "sessions/lab/cam01.marks.csv": "sequence,frame,joint,u,v\nin_1,3,LASI,10,20\nin_1,9,LASI,11,21\n",
        "offsets/in_1.yaml": "cam01: {offset_s: 0.12}\n",
        "boxes/out_1.cam03.csv": "frame,u_min,v_min,u_max,v_max\n",
        "checks/out_1.cam01.csv": "sequence,frame,joint,u,v\n",
    }
    for name, text in texts.items():
        path = tmp_path / "config" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path


POINTED = "seeds: [{camera: cam01, frame: 5, u: 1.5, v: 2}]\n"


def edit(root, name, old, new, count=1):
    path = root / "config" / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, count))


def fails(root, *parts):
    with pytest.raises(DiorError) as caught:
        project.load(root)
    text = str(caught.value)
    for part in parts:
        assert part in text
    assert "\n" not in text and str(root) not in text
    return text


def test_one_table_of_detections_may_hold_all_cameras(root):
    edit(root, "sequences.tsv", "out_1/mlkit/{camera}.jsonl", "out_1/xy_RTMPOSE.csv")
    found = project.load(root).recordings("out_1")
    assert {found[f"detections.{camera}"] for camera in ("cam01", "cam02")} == {"data/out_1/xy_RTMPOSE.csv"}


def test_what_is_written_is_what_is_read(root):
    p = project.load(root)
    assert p.sequences == ("out_1", "out_2", "in_1"), "by session, order as a number, name"
    assert p.excluded == {"out_3": "rain"}
    assert p.sessions == ("field", "lab")
    assert p.bags("out_1") == ["data/out_1/a.bag", "data/out_1/b.bag"]
    assert p.close("field") == ["cam01", "cam02"] and list(p.cameras("field")) == ["cam01", "cam02", "cam03"]
    assert p.first_sequence("field") == "out_1"
    assert p.sequences_of("field") == ["out_1", "out_2"]
    assert p.sequences_of_subject("zebra-0001") == ["out_1", "in_1"]
    assert (p.mocap("in_1"), p.mocap("out_1")) == (["data/in_1/mocap.c3d"], [])
    assert p.trigger_log("in_1") == ["data/in_1/trigger.jsonl"] and p.capture("in_1") == "walk 3"
    assert (p.trigger_log("out_1"), p.capture("out_1")) == ([], "")
    assert p.mocap_settings("in_1") == {"units": "", "up": "", "prefix": ""}
    assert p.marks_sequences("lab", "cam01") == p.marks_mocap("lab", "cam01") == ["in_1"]
    assert p.boxes("out_1") == {"cam03": "config/boxes/out_1.cam03.csv"}
    assert p.checks("out_1") == {"cam01": "config/checks/out_1.cam01.csv"}
    assert (p.offsets("in_1"), p.offsets("out_1")) == (["config/offsets/in_1.yaml"], [])
    assert p.truth("out_1") == [], "a column that the sheet lacks is empty"
    assert p.released_subjects == ("zebra-0001",) and p.released_sequences == ("out_1", "in_1")
    assert set(p.sequence("out_1")) == {*SEQUENCES, "truth", "videos", "stamps"}


def test_defaults_are_filled_in(root):
    p = project.load(root)
    assert p.config["triangulate"]["method"] == "rays" and p.config["triangulate"]["max_error_px"] == 45.0
    assert p.config["adjust"]["min_views"] == 3 and p.config["release"]["authors"] == []
    assert p.window("field") == {"out_1": {"first": 0, "count": 100, "step": 1}} and p.window("lab") == {}
    camera = p.cameras("field")["cam01"]
    assert camera["intrinsics"] == "camera_info" and camera["tape"]["target_m"] == [0.0, 0.0, 0.0]
    assert p.cameras("field")["cam03"]["nudge"] == {"azimuth_deg": 0.2, "elevation_deg": 0.0, "distance_m": 0.0}


def test_a_config_read_elsewhere_is_used_and_left_alone(root):
    given = yaml.safe_load((root / "config/config.yaml").read_text())
    given["triangulate"]["method"] = "robust"
    assert project.load(root, given).config["triangulate"]["method"] == "robust"
    assert "adjust" not in given and given["triangulate"] == {"method": "robust"}


def all_marked(root, marks):
    """Both close cameras of the outdoor session are located by marks, so that nothing is adjusted."""
    edit(root, "sessions/field/session.yaml", "adjust: {out_1: {count: 100}}", "")
    for camera in ("cam01", "cam02"):
        (root / f"config/sessions/field/{camera}.marks.csv").write_text(marks)
        edit(root, f"sessions/field/{camera}.yaml", "locate: tape", "locate: marks")


def test_marks_with_3d_points_need_no_mocap(root):
    edit(root, "subjects.tsv", "\tno", "\tyes")
    all_marked(root, "sequence,frame,joint,u,v,x,y,z\nout_2,0,post,1,2,3,4,5\nout_1,0,post,1,2,3,4,5\n")
    p = project.load(root)
    assert p.marks_sequences("field", "cam01") == ["out_2", "out_1"] and p.marks_mocap("field", "cam01") == []


def test_cameras_by_marks_are_not_adjusted_and_cameras_by_tape_are(root):
    (root / "config/sessions/field/cam01.marks.csv").write_text("sequence,frame,joint,u,v\n")
    edit(root, "sessions/field/cam01.yaml", "locate: tape", "locate: marks")
    fails(root, "config/sessions/field/session.yaml", "cam01 has 'locate: marks'")
    edit(root, "sessions/field/session.yaml", "adjust: {out_1: {count: 100}}", "")
    fails(root, "config/sessions/field/session.yaml", "cam02 are placed by tape", "adjust: {out_")


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        (
            "method: rays",
            "metod: rays",
            ["unknown key 'triangulate.metod' (did you mean 'method'?)"],
        ),
        ("triangulate:", "trianguate:", ["unknown key 'trianguate' (did you mean 'triangulate'?)"]),
        ("method: rays", "method: ray", ["'triangulate.method' is 'ray'", "robust, rays", "did you mean 'rays'"]),
        ("method: rays", "max_error_px: abc", ["'triangulate.max_error_px' is 'abc' but should be a number above 0"]),
        ("method: rays", "max_error_px: -1", ["'triangulate.max_error_px' is -1", "above 0"]),
        ("{method: rays}", "[rays]", ["'triangulate' is ['rays'] but should be keys with values"]),
        ("{method: rays}", "", ["'triangulate' is nothing but should be keys with values"]),
        ("data_root: data\n", "- data\n# ", ["config/config.yaml line"]),
        ("version: 0.1.0", "version: 1.0", ["'release.version' is 1.0 but should be a version such as 0.1.0"]),
        ("version: 0.1.0", "version: ../x", ["'release.version' is '../x'"]),
        ("data_root: data", "data_root: data\ndata_root: else", ["key 'data_root' is given twice, on lines 1 and 2"]),
        ("{method: rays}", "{method: rays", ["config/config.yaml line", "not valid YAML"]),
        ("triangulate:", "simulate: {fsp: 30}\ntriangulate:", ["unknown key 'simulate.fsp' (did you mean 'fps'?)"]),
        (
            "triangulate:",
            "simulate: {detector: {level: x}}\ntriangulate:",
            ["'simulate.detector.level' is 'x'", "ideal"],
        ),
        ("license: CC-BY-4.0", "license: CC-BY-4.0, authors: me", ["'release.authors' is 'me' but should be a list"]),
    ],
)
def test_config_errors(root, old, new, parts):
    edit(root, "config.yaml", old, new)
    fails(root, "config/config.yaml", *parts)


@pytest.mark.parametrize(
    ("sheet", "old", "new", "parts"),
    [
        ("sequences", "out_1\t9", "out_2\t9", ["sequence 'out_2' is there twice, on lines 2 and 3"]),
        ("subjects", "S02", "S01", ["subject 'S01' is there twice, on lines 2 and 3"]),
        (
            "sequences",
            "out_2\t",
            "Out_1\t",
            ["sequence 'Out_1' and 'out_1' on lines 2 and 3 differ by capitals alone"],
        ),
        ("sequences", "out_1\t9", "out.1\t9", ["line 3", "'sequence' is 'out.1'", "letters, digits"]),
        ("sequences", "out_1\t9\t", "out_1\tninth\t", ["line 3", "'session_order' is 'ninth'", "whole number"]),
        ("sequences", "9\tS01", "9\tS1", ["line 3", "'S1'", "not in config/subjects.tsv (did you mean 'S01'?)"]),
        ("sequences", "9\tS01\tfield", "9\tS01\tfeild", ["line 3", "session 'feild'", "did you mean 'field'"]),
        ("sequences", "9\tS01\tfield\toutdoor", "9\tS01\tfield\toutdors", ["'environment' is 'outdors'", "'outdoor'"]),
        ("sequences", "in_1/mocap.c3d", "", ["line 4", "'in_1' is indoor but has no mocap"]),
        ("sequences", "out_1/mlkit/{camera}.jsonl", "", ["line 3", "'out_1' is outdoor but has no detections"]),
        ("sequences", "out_1/mlkit/{camera}.jsonl", "out_1/x.jsonl", ["line 3", "{camera}"]),
        ("sequences", "out_1/mlkit/{camera}.jsonl\t", "a/{camera}.jsonl\tlog", ["'out_1' is outdoor", "trigger_log"]),
        ("sequences", "in_1/trigger", "/in_1/trigger", ["trigger_log '/in_1/trigger.jsonl#walk 3' must be relative"]),
        ("sequences", "in_1/a.bag", "", ["line 4: sequence 'in_1' has no bags and no videos"]),
        ("sequences", "in_1/a.bag", "/disk/a.bag", ["line 4", "bags '/disk/a.bag' must be relative to data_root"]),
        ("sequences", "out_1\t9", "s01_out-1\t9", ["line 3", "'s01_out-1' holds that of subject 'S01'"]),
        ("sequences", "out_1\t9", "take-S02\t9", ["line 3", "'take-S02' holds that of subject 'S02'"]),
        ("sequences", "outfit", "outfitt", ["unknown column 'outfitt' (did you mean 'outfit'?)"]),
        ("sequences", "\toutfit\twalk", "\twalk\twalk", ["column 'walk' is there twice"]),
        ("sequences", "\toutfit\twalk", "\toutfit\t\twalk", ["column 7 has no name; delete it"]),
        ("sequences", "rain", "rain\tx\ty", ["line 5: 14 cells but the sheet has 12 columns"]),
        ("subjects", "\tconsent_release", "", ["column 'consent_release' is missing"]),
        ("subjects", "zebra-0001", "zebra", ["line 2", "'pseudonym' is 'zebra'", "8 or more letters"]),
        ("subjects", "apple-0002", "zebra-0001", ["'S01' and 'S02' share the pseudonym"]),
        ("subjects", "apple-0002", "Metadata", ["pseudonym 'metadata', as a tarball is called"]),
        ("subjects", "1.72", "172", ["line 2", "'height_m' is '172' but should be a height in metres"]),
        ("subjects", "S02", "-S02", ["line 3", "'subject' is '-S02' but should be a name of", "- (not first"]),
        ("subjects", "apple-0002", "-apple-02", ["line 3", "'pseudonym' is '-apple-02'", "- (not first"]),
        ("subjects", "\tyes", "\tmaybe", ["line 2", "'consent_release' is 'maybe'", "yes or no"]),
    ],
)
def test_sheet_errors(root, sheet, old, new, parts):
    edit(root, f"{sheet}.tsv", old, new)
    fails(root, f"config/{sheet}.tsv", *parts)


def _cell(column):
    """The sheet of sequences with {text} in a cell of the last row."""

    def text(root):
        lines = (root / "config/sequences.tsv").read_text().splitlines()
        cells = lines[-1].split("\t") + [""] * (len(SEQUENCES) - len(lines[-1].split("\t")))
        cells[SEQUENCES.index(column)] = "{text}"
        return "\n".join([*lines[:-1], "\t".join(cells)]) + "\n"

    return text


SHEETS_TEXT = {
    "sequences": [(column, _cell(column)) for column in ("outfit", "walk", "exclude_reason")],
    "gallery": [("outfit", lambda root: "subject\toutfit\tangle\tpath\nS01\t{text}\tfrontal\tg\n")],
    "effort": [("what", lambda root: "what\tminutes\n{text}\t3\n")],
}


@pytest.mark.parametrize("text", ["=HYPERLINK(1)", "+1+1", "-1+cmd|' /C calc'!A0", "@SUM(1)", "＝1"])
@pytest.mark.parametrize("sheet", ["sequences", "gallery", "effort"])
def test_free_text_that_a_spreadsheet_would_run_is_refused(root, sheet, text):
    """By the sheets' readers, so that no CSV or TSV of a report, a release or an export can have it."""
    for column, line in SHEETS_TEXT[sheet]:
        path = root / f"config/{sheet}.tsv"
        before = path.read_text() if path.exists() else None
        path.write_text(line(root).replace("{text}", text))
        fails(root, f"config/{sheet}.tsv line", f"'{column}' is ", "free text", "= + - or @")
        path.write_text(before) if before else path.unlink()


@pytest.mark.parametrize(
    "text", ["-", "+", "-0.5", "coat = 2 m", "a-b", "Mantel, rot", "赤い", "(none)", "'s coat", "5 kg +"]
)
def test_other_free_text_is_taken(root, text):
    for column, line in SHEETS_TEXT["sequences"]:
        (root / "config/sequences.tsv").write_text(line(root).replace("{text}", text))
        assert text in {row[column] for row in project.load(root).rows.values()}


@pytest.mark.parametrize(
    ("file", "old", "new", "parts"),
    [
        ("field/cam01.yaml", "locate", "locat", ["unknown key 'locat' (did you mean 'locate'?)"]),
        ("field/cam01.yaml", "position_m", "positon_m", ["unknown key 'tape.positon_m' (did you mean 'position_m'?)"]),
        ("field/cam01.yaml", "role: close\n", "", ["key 'role' is missing"]),
        ("field/cam01.yaml", "tape: {position_m: [4, 0, 1.5]}", "", ["needs the key 'tape'"]),
        ("field/cam01.yaml", "[4, 0, 1.5]", "[4, 0]", ["'tape.position_m' is [4, 0]", "a list of 3 numbers"]),
        ("field/cam01.yaml", "[4, 0, 1.5]", "[4, 0, high]", ["'tape.position_m.2' is 'high' but should be a number"]),
        ("field/cam01.yaml", "[4, 0, 1.5]", "[0, 0, 0]", ["looks nowhere"]),
        ("field/cam01.yaml", "locate: tape", "locate: align", ["is for long_range cameras"]),
        ("field/cam03.yaml", "locate: align", "locate: tape", ["use 'locate: align'"]),
        ("field/cam01.yaml", "locate: tape", "locate: reference", ["needs the key 'reference'"]),
        ("field/cam01.yaml", "locate: tape", "locate: tpe", ["'locate' is 'tpe'", "did you mean 'tape'"]),
        ("field/cam01.yaml", "locate: tape", "locate: tape\nnudge: {distance_m: 1}", ["'nudge' has no effect"]),
        (
            "field/cam01.yaml",
            "locate",
            "intrinsics: camerainfo\nlocate",
            ["'intrinsics' is 'camerainfo'"],
        ),
        ("field/cam01.yaml", "locate", "intrinsics: {fil: a, name: b}\nlocate", ["unknown key 'intrinsics.fil'"]),
        ("field/cam01.yaml", "locate", "intrinsics: {file: a}\nlocate", ["key 'intrinsics.name' is missing"]),
        (
            "field/cam02.yaml",
            "[-4, 0, 1.5]",
            "[4, 0, 1.5]",
            ["'cam01' and 'cam02' are at the same place"],
        ),
        ("field/cam02.yaml", "[-4, 0, 1.5]", "[-400, 0, 150]", ["'tape.position_m' is 427 m from", "centimetres"]),
        ("field/cam02.yaml", "/cam02/", "/cam01/", ["'cam01' and 'cam02' have the same topic"]),
        (
            "field/cam02.yaml",
            "role: close",
            "role: close\nrole: close",
            ["key 'role' is given twice, on lines 1 and 2"],
        ),
        ("field/session.yaml", "cam02", "kam02", ["'kam02' has no file", "did you mean 'cam02'"]),
        ("field/session.yaml", "cam02", "cam01", ["camera 'cam01' is listed twice"]),
        ("field/session.yaml", "[cam01, cam02, cam03]", "[]", ["'cameras' is []", "a list of 1 or more words"]),
        ("field/session.yaml", "[cam01, cam02, cam03]", "[cam01, a/b]", ["'cameras.1' is 'a/b'", "letters, digits"]),
        ("field/session.yaml", "[cam01, cam02, cam03]", "[cam01, cam03]", ["at least 2 close cameras", "has 1"]),
        ("field/session.yaml", "out_1", "out_4", ["'adjust.out_4' is no sequence of session 'field'", "'out_"]),
        ("field/session.yaml", "out_1", "out_3", ["'adjust.out_3' is an excluded sequence"]),
        ("field/session.yaml", "out_1", "out.1", ["'adjust.out.1' is not a name of letters"]),
        ("field/session.yaml", "out_1", "1", ["key 'adjust.1' is read as a int, not as text; put it in quotes"]),
        ("field/session.yaml", "out_1", "[a]", ["the key on line 2 is no plain word"]),
        ("field/session.yaml", "count", "cout", ["unknown key 'adjust.out_1.cout' (did you mean 'count'?)"]),
        ("lab/cam01.marks.csv", "in_1,9", "in_2,9", ["line 3", "'in_2' is no processed sequence", "'in_1'"]),
        ("lab/cam01.marks.csv", "joint", "joints", ["unknown column 'joints' (did you mean 'joint'?)"]),
        ("lab/cam01.marks.csv", ",v\n", "\n", ["column 'v' is missing"]),
    ],
)
def test_session_errors(root, file, old, new, parts):
    edit(root, f"sessions/{file}", old, new)
    text = fails(root, *parts)
    assert "config/se" in text


def test_a_camera_that_is_not_marked_yet_is_told_and_can_be_looked_at(root):
    (root / "config/sessions/lab/cam01.marks.csv").unlink()
    fails(root, "lab/cam01.yaml", "needs the file", "lab/cam01.marks.csv", "3-10 frames")
    faults = Faults()
    found = project.as_far_as_it_goes(root, faults)
    assert len(faults.found) == 1 and "in_1" in found.sequences and "cam01" in found.cameras("lab")


@pytest.mark.parametrize(
    ("align", "part"),
    [
        ("{from: boxes, sequences: [out_4]}", "'out_4' is no sequence of field (did you mean 'out_"),
        ("{from: boxes, sequences: [in_1]}", "'in_1' is no sequence of field"),
        ("{from: boxes, sequences: [out_3]}", "'out_3', which has an exclude_reason"),
        ("{from: boxes, sequences: [out_1, out_2]}", "needs the file config/boxes/out_2.cam03.csv"),
        ("{from: marks, sequences: [out_1]}", "needs the file config/sessions/field/cam03.marks.csv"),
        ("{from: boxes, sequences: []}", "a list of 1 or more"),
        ("{from: boxs, sequences: [out_1]}", "did you mean 'boxes'"),
    ],
)
def test_what_a_camera_is_aligned_to_must_be_there(root, align, part):
    edit(root, "subjects.tsv", "\tno", "\tyes")
    edit(root, "sessions/field/cam03.yaml", "nudge: {azimuth_deg: 0.2}", f"align: {align}")
    fails(root, "config/sessions/field/cam03.yaml", part)


def test_a_camera_that_is_aligned_to_boxes(root):
    edit(root, "sessions/field/cam03.yaml", "nudge: {azimuth_deg: 0.2}", "align: {from: boxes, sequences: [out_1]}")
    found = project.load(root).cameras("field")["cam03"]["align"]
    asked = {"from": "boxes", "sequences": ["out_1"]}
    assert found == asked | {"fit": "range", "around": "body", "habit_px": 0.5, "occluder": "auto"}
    edit(root, "sessions/field/cam01.yaml", "locate: tape", "locate: tape\nalign: {from: boxes, sequences: [out_1]}")
    fails(root, "config/sessions/field/cam01.yaml", "'align' has no effect")


def test_marks_without_3d_points_need_the_mocap(root):
    all_marked(root, "sequence,frame,joint,u,v\nout_1,0,LASI,1,2\n")
    assert told(root) == ["sessions/field/cam01.marks.csv line 2", "sessions/field/cam02.marks.csv line 2"]
    known = root / "config/sessions/field/cam02.marks.csv"
    known.write_text("sequence,frame,joint,u,v,x,y,z\nout_1,0,LASI,1,2,0,0,1\n")
    fails(root, "config/sessions/field/cam01.marks.csv line 2", "'out_1' has no mocap")


@pytest.mark.parametrize(
    ("file", "text", "parts"),
    [
        ("offsets/oat_1.yaml", "cam01: {offset_s: 0}\n", ["'oat_1' is not in config/sequences.tsv", "'out_1'"]),
        (
            "offsets/out_1.yaml",
            "cam1: {offset_s: 0}\n",
            ["'cam1' is no camera of this sequence", "'cam01'"],
        ),
        ("offsets/out_1.yaml", "cam01: {ofset_s: 0}\n", ["unknown key 'cam01.ofset_s' (did you mean 'offset_s'?)"]),
        (
            "offsets/out_1.yaml",
            "cam01: {offset_s: 1e-3}\n",
            ["'cam01.offset_s' is '1e-3' but should be a number at least", "YAML takes that for a word, write 0.001"],
        ),
        ("people/oat_1.yaml", POINTED, ["config/people/oat_1.yaml: 'oat_1' is not in config/sequences.tsv", "'out_1'"]),
        ("people/out_1.yaml", POINTED.replace("01", "1"), ["seed 1: 'cam1' is no close camera of this", "'cam01'"]),
        ("people/out_1.yaml", POINTED.replace("01", "03"), ["seed 1: 'cam03' is no close camera of this sequence"]),
        (
            "people/out_1.yaml",
            POINTED.replace("5, u", "5.5, u"),
            ["'seeds.0.frame' is 5.5 but should be a whole number"],
        ),
        ("people/out_1.yaml", "seeds: []\n", ["'seeds' is [] but should be a list of 1 or more values"]),
        ("people/in_1.yaml", POINTED, ["'in_1' is indoor, where the motion capture says where the subject is"]),
        ("boxes/out_1.cam3.csv", "", ["'cam3' is no camera of session 'field' (did you mean 'cam03'?)"]),
        ("boxes/oat_1.cam03.csv", "", ["'oat_1' is not in config/sequences.tsv (did you mean 'out_1'?)"]),
        ("checks/out_1.csv", "", ["<sequence>.<camera>.csv"]),
        (
            "offsets/out_1.yml",
            "cam01: {offset_s: 0}\n",
            ["out_1.yml: is not read, as its name must end in .yaml"],
        ),
        ("boxes/out_1.cam03.CSV", "", ["boxes/out_1.cam03.CSV: is not read, as its name must end in .csv; rename it"]),
        ("sessions/field/cam01@oat_2.yaml", "", ["'oat_2' is no sequence of session 'field'", "'out_2'"]),
        ("sessions/field/cam1@out_2.yaml", "", ["cam1.yaml is missing beside it (did you mean 'cam01'?)"]),
        ("sessions/field/cam01@out_2.marks.csv", "", ["cam01@out_2.yaml is missing beside it"]),
        ("sessions/field/cam01@out_2.yml", "", ["<camera>@<first sequence>.yaml"]),
        ("sessions/field/cam01@out_1.yaml", "", ["out_1 is the first sequence of the session; edit cam01.yaml itself"]),
    ],
)
def test_errors_of_files_beside(root, file, text, parts):
    (root / "config/people").mkdir()
    (root / "config" / file).write_text(text)
    fails(root, f"config/{file}", *parts)


def test_a_folder_that_nothing_reads_is_named(root):
    (root / "config/peple").mkdir()
    fails(root, "config/peple: no such folder is read (did you mean 'people'?); rename it")
    (root / "config/peple").rmdir()
    for own in ("photographs", "notes", "boxes_old", "docs", "old", "scripts", "calibration"):
        (root / "config" / own).mkdir()
    (root / "config/offsets").mkdir(exist_ok=True)
    (root / "config/offsets/notes.csv").touch()
    assert project.load(root).sequences, "a lab's own"


@pytest.mark.parametrize("name", ["config.yaml", "sequences.tsv", "subjects.tsv"])
def test_missing_files(root, name):
    (root / "config" / name).unlink()
    fails(root, f"config/{name}: there is no such file")


def test_sheets_with_nothing_to_process(root):
    path = root / "config/sequences.tsv"
    header = path.read_text().splitlines()[0]
    path.write_text(header + "\n")
    fails(root, "config/sequences.tsv has no rows yet")
    path.write_text("")
    fails(root, "config/sequences.tsv: the file is empty")
    path.write_text(header.replace("\t", ",") + "\n")
    fails(root, "must be separated by tabs")
    path.write_text(
        header
        + "\n"
        + row(
            sequence="a",
            session_order="1",
            subject="b",
            session="c",
            environment="indoor",
            bags="d",
            exclude_reason="lost",
        )
        + "\n"
    )
    fails(root, "every row has an exclude_reason")


def test_a_sheet_from_a_spreadsheet_program_is_read(root):
    """A byte order mark, Windows line ends, blanks around cells and dropped empty cells at the end do no harm."""
    path = root / "config/sequences.tsv"
    expected = project.load(root).rows
    lines = [line.rstrip("\t").replace("\t", "\t ") for line in path.read_text().splitlines()]
    path.write_bytes("\ufeff".encode() + "\r\n".join([*lines, "", "\t\t"]).encode())
    assert project.load(root).rows == expected


def test_references_must_differ(root):
    text = "role: close\ntopic: /{}\nlocate: reference\nreference: {{file: a.toml, name: cam_01}}\n"
    for name in ("cam01", "cam02"):
        (root / f"config/sessions/field/{name}.yaml").write_text(text.format(name))
    fails(root, "'cam01' and 'cam02' take the same pose 'cam_01'")


BOARD = "{path: board, rows: 7, columns: 4, square_m: 0.06}"


FACT = "distances: [{between: [cam01, cam02], length_m: 8.0, sigma_m: 0.02}]\n"
MOCAP = "mocap: {units: cm, up: y, prefix: {S01: Anna}}\n"


def test_how_a_c3d_is_read(root):
    edit(root, "sessions/lab/session.yaml", "cameras: [cam01]", "cameras: [cam01]\n" + MOCAP)
    assert project.load(root).mocap_settings("in_1") == {"units": "cm", "up": "y", "prefix": "Anna"}


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("S01", "S10", ["'mocap.prefix.S10': 'S10' walks in no sequence of session 'lab'", "did you mean 'S01'?"]),
        ("cm", "inch", ["'mocap.units' is 'inch'"]),
        ("y,", "w,", ["'mocap.up' is 'w'"]),
        ("Anna", "''", ["'mocap.prefix.S01'"]),
        ("units", "unit", ["unknown key 'mocap.unit' (did you mean 'units'?)"]),
    ],
)
def test_slips_in_how_a_c3d_is_read(root, old, new, words):
    edit(root, "sessions/lab/session.yaml", "cameras: [cam01]", "cameras: [cam01]\n" + MOCAP.replace(old, new))
    fails(root, "config/sessions/lab/session.yaml", *words)


THIGH = "keypoint_distance: [{subject: S01, joints: [left_hip, left_knee], length_m: 0.42, sigma_m: 0.01}]\n"


@pytest.mark.parametrize(
    ("text", "old", "new", "parts"),
    [
        (FACT, "8.0", "-8.0", ["'distances.0.length_m'", "-8.0"]),
        (FACT, "length_m", "lenght_m", ["key 'distances.0.length_m' is missing"]),
        (FACT, "[cam01", "[cam1", ["'distances.0.between' begins with 'cam1', which is no close camera", "'cam01'"]),
        (FACT, "cam02", "cam01", ["'distances.0.between' names 'cam01' twice"]),
        (THIGH, "S01", "S10", ["'keypoint_distance.0.subject' is 'S10', who walks in no sequence of session", "'S01'"]),
        (THIGH, "0.42", "0", ["'keypoint_distance.0.length_m'"]),
    ],
)
def test_metric_facts_that_are_wrong_name_file_and_key(root, text, old, new, parts):
    path = root / "config/sessions/field/session.yaml"
    right = path.read_text()
    path.write_text(right + text)
    project.load(root)
    path.write_text(right + text.replace(old, new, 1))
    fails(root, "config/sessions/field/session.yaml", *parts)


def test_stature_without_a_height_that_is_known_is_refused(root):
    path = root / "config/sessions/field/session.yaml"
    path.write_text(path.read_text() + "stature: true\n")
    edit(root, "subjects.tsv", "1.72\t0.01", "1.72\t")
    fails(root, "field/session.yaml: 'stature' needs height_m and height_sigma_m in config/subjects.tsv", "S01")


def test_metric_facts_have_sequences_for_subjects_and_the_heights_of_all(root):
    path = root / "config/sessions/field/session.yaml"
    path.write_text(path.read_text() + FACT + THIGH + "stature: true\n")
    known = project.load(root).metric_facts("field")
    assert known["keypoint_distance"][0]["sequences"] == ["out_1"] and "subject" not in known["keypoint_distance"][0]
    measured = {"subject": "zebra-0001", "height_m": 1.72, "sigma_m": 0.01, "sequences": ["out_1"]}
    assert known["stature"] == known["heights"] == [measured]
    edit(root, "sessions/field/session.yaml", "stature: true\n", "")
    edit(root, "subjects.tsv", "1.72\t0.01", "1.72\t")
    known = project.load(root).metric_facts("field")
    assert known["stature"] == []
    assert known["heights"] == [measured | {"sigma_m": 0.0}]
    edit(root, "subjects.tsv", "1.72\t", "\t")
    assert project.load(root).metric_facts("field")["heights"] == []


def test_intrinsics_from_a_board_and_placement_by_a_tag(root):
    path = root / "config/sessions/field/cam01.yaml"
    text = path.read_text().replace("locate: tape", f"intrinsics: {{chessboard: {BOARD}}}\nlocate: apriltag")
    path.write_text(text)
    edit(root, "sessions/field/session.yaml", "adjust:", "tag: {id: 3, size_m: 0.4}\nadjust:")
    loaded = project.load(root)
    camera = loaded.cameras("field")["cam01"]
    assert camera["intrinsics"]["chessboard"]["rows"] == 7 and camera["locate"] == "apriltag"
    tag = loaded.session_files["field"]["tag"]
    assert tag["family"] == "36h11" and tag["normal"] == [0, 0, 1] and tag["up"] == [0, 1, 0]
    edit(root, "sessions/field/session.yaml", "id: 3,", "id: 3, sequence: in_1,")
    fails(root, "field/session.yaml", "'tag.sequence' is 'in_1', no processed sequence of session 'field'")
    edit(root, "sessions/field/session.yaml", "tag: {id: 3, sequence: in_1, size_m: 0.4}\n", "")
    fails(root, "field/session.yaml", "camera 'cam01' has 'locate: apriltag', which needs the key 'tag'")


@pytest.mark.parametrize(
    ("given", "parts"),
    [
        (f"{{chessboard: {BOARD}, file: a, name: b}}", ["names file and chessboard; give one of"]),
        ("{}", ["'intrinsics' names nothing"]),
        ("{chessboard: {path: board, rows: 7, columns: 4}}", ["key 'intrinsics.chessboard.square_m' is missing"]),
        (f"{{chesboard: {BOARD}}}", ["unknown key 'intrinsics.chesboard' (did you mean 'chessboard'?)"]),
        (f"{{charuco: {BOARD[:-1]}, dictionary: 4X4_50}}}}", ["key 'intrinsics.charuco.marker_m' is missing"]),
        (f"{{chessboard: {BOARD}}}\ndistortion_model: inverse_brown_conrady", ["a chessboard gives a plumb_bob lens"]),
    ],
)
def test_intrinsics_that_contradict_themselves(root, given, parts):
    path = root / "config/sessions/field/cam01.yaml"
    lines = [line for line in path.read_text().splitlines() if not line.startswith("distortion_model")]
    path.write_text("\n".join([*lines, f"intrinsics: {given}"]) + "\n")
    fails(root, "field/cam01.yaml", *parts)


def test_the_network_must_be_there_where_a_sequence_asks_for_it(root):
    edit(root, "sequences.tsv", "out_2/mlkit/{camera}.jsonl", "detect")
    fails(root, "line 2: sequence 'out_2' has 'detections: detect', which needs the pose network `detector.model`")
    edit(root, "config.yaml", "triangulate:", "detector: {model: nets/pose.task}\ntriangulate:")
    fails(root, "`detector.model` in config/config.yaml is 'nets/pose.task', where there is no file; it is relative to")
    (root / "nets").mkdir()
    (root / "nets/pose.task").touch()
    assert project.load(root).detected_here("out_2")


def test_the_gallery_may_be_there(root):
    assert project.load(root).gallery == {}
    header = "subject\toutfit\tangle\tpath\tbag\ttopic\n"
    sheet = root / "config/gallery.tsv"
    sheet.write_text(f"{header}S01\tcoat\tfrontal\tgallery/a/\t\t\nS01\tcoat\tdown45\t\tg.bag\t/cam/image\n")
    loaded = project.load(root)
    assert list(loaded.gallery) == [("zebra-0001", "coat", "frontal"), ("zebra-0001", "coat", "down45")]
    assert loaded.gallery_files() == [loaded.in_data("gallery/a"), loaded.in_data("g.bag")]
    for line, text in (
        ("S09\tcoat\tfrontal\ta\t\t", "subject 'S09' is not in config/subjects.tsv"),
        ("S01\tcoat\tfrontal\t\t\t", "give either path .* or bag"),
        ("S01\tcoat\tfrontal\ta\tb.bag\t/c", "give either path .* or bag"),
        ("S01\tcoat\tfrontal\t\tb.bag\t", "bag needs its topic"),
        ("S01\tcoat\tfrontal\t/a\t\t", "must be relative to data_root"),
        ("S01\tcoat of s01\tfrontal\ta\t\t", "must not hold the name of subject 'S01'"),
        ("S01\tcoat\tfrom above\ta\t\t", "'angle' is 'from above'"),
    ):
        sheet.write_text(f"{header}{line}\n")
        with pytest.raises(DiorError, match=f"config/gallery.tsv line 2.*{text}"):
            project.load(root)
    sheet.write_text(header + "S01\tcoat\tfrontal\ta\t\t\n" * 2)
    fails(root, "subject, outfit, angle 'S01, coat, frontal' is there twice, on lines 2 and 3")


def test_a_row_added_above_changes_no_other_row(root):
    before = project.load(root).sequence("in_1")
    edit(
        root,
        "sequences.tsv",
        "out_2\t10",
        row(
            sequence="new",
            session_order="12",
            subject="S01",
            session="field",
            environment="outdoor",
            bags="x",
            detections="{camera}",
        )
        + "\nout_2\t10",
    )
    assert project.load(root).sequence("in_1") == before


DETECTORS = "sequence\tcamera\ttool\tzoom\tpath\n"


def test_outputs_of_other_detectors_may_be_there(root):
    assert project.load(root).detectors_of("out_1") == []
    sheet = root / "config/detectors.tsv"
    sheet.write_text(DETECTORS + "out_1\tcam03\tmlkit\t4\tz/a.jsonl\nout_1\tcam03\tmlkit\t1\tr/\n")
    loaded = project.load(root)
    assert loaded.detectors_of("out_1") == [
        {"camera": "cam03", "tool": "mlkit", "zoom": "1", "path": loaded.in_data("r")},
        {"camera": "cam03", "tool": "mlkit", "zoom": "4", "path": loaded.in_data("z/a.jsonl")},
    ]
    assert loaded.detectors_of("out_2") == []
    sheet.write_text("first_frame\t" + DETECTORS + "1\tout_1\tcam03\tmlkit\t1\tr\n")
    assert [row["first_frame"] for row in project.load(root).detectors_of("out_1")] == ["1"]


@pytest.mark.parametrize(
    "line, text",
    [
        ("out_9\tcam03\tmlkit\t1\ta", "line 2: 'out_9' is not in config/sequences.tsv"),
        ("out_1\tcam3\tmlkit\t1\ta", "'cam3' is no camera of session 'field'"),
        ("out_1\tcam03\tmlkit 4x\t4\ta", "'tool'"),
        ("out_1\tcam03\tmlkit\t0\ta", "'zoom' is '0' but should be 1 or the zoom"),
        ("out_1\tcam03\tmlkit\t4x\ta", "'zoom'"),
        ("out_1\tcam03\tmlkit\t1\t/a", "relative to data_root"),
        ("out_1\tcam03\tmlkit\t1\t", "'path' is nothing"),
        ("out_1\tcam03\tm\t1\ta\nout_1\tcam03\tm\t1\tb", "there twice, on lines 2 and 3"),
    ],
)
def test_wrong_outputs_of_other_detectors_are_refused(root, line, text):
    (root / "config/detectors.tsv").write_text(DETECTORS + line + "\n")
    with pytest.raises(DiorError, match=f"config/detectors.tsv.*{text}"):
        project.load(root)


def test_the_schemas_themselves_are_documented_and_strict():
    from jsonschema import Draft202012Validator

    folder = Path(project.__file__).parents[2] / "dior/project/schemas"
    paths = sorted(folder.glob("*.schema.yaml"))
    kinds = ["camera", "config", "detectors", "effort", "gallery", "markers", "offsets", "people", "sequences"]
    kinds += ["session", "subjects"]
    assert [p.name.split(".")[0] for p in paths] == kinds

    def walk(schema, where):
        keys = {**schema.get("properties", {}), **schema.get("patternProperties", {})}
        if keys:
            assert schema["additionalProperties"] is False, where
        for key, value in keys.items():
            assert value.get("description"), f"{where}.{key} has no description"
            walk(value, f"{where}.{key}")

    for path in paths:
        schema = yaml.safe_load(path.read_text())
        Draft202012Validator.check_schema(schema)
        walk(schema, path.name)


def test_cameras_that_are_one_device_have_their_lens_said_once(root):
    edit(root, "config.yaml", "triangulate:", "lenses: {d455: inverse_brown_conrady}\ntriangulate:")
    edit(root, "sessions/field/cam01.yaml", "role:", "lens: d455\nrole:")
    camera = project.load(root).cameras("field")["cam01"]
    assert camera["distortion_model"] == "inverse_brown_conrady" and "lens" not in camera
    edit(root, "sessions/field/cam01.yaml", "role:", "distortion_model: plumb_bob\nrole:")
    fails(root, "config/sessions/field/cam01.yaml: 'lens' and 'distortion_model' say the same thing")
    edit(root, "sessions/field/cam01.yaml", "lens: d455\ndistortion_model: plumb_bob", "lens: d456")
    fails(root, "lens 'd456' is not in `lenses` of config/config.yaml", "'d455'")


def test_the_template_names_every_key_with_its_default():
    folder = Path(project.__file__).parents[2]
    schema = yaml.safe_load((folder / "dior/project/schemas/config.schema.yaml").read_text())["properties"]
    text = (folder / "dior/project/templates/config.yaml").read_text()
    template = yaml.safe_load(text)
    assert set(template) == set(schema) - {"simulate"} and template["data_root"] == "data"
    assert template["people"] == schema["people"]["default"] == "subject"
    assert template["lenses"] == schema["lenses"]["default"] == {}
    for section in set(template) - {"data_root", "people", "lenses"}:
        assert set(template[section]) == set(schema[section]["properties"])
        for key, value in template[section].items():
            # no licence is everybody's
            if key != "license":
                assert schema[section]["properties"][key]["default"] == value
            at = text.splitlines().index(next(n for n in text.splitlines() if n.startswith(f"  {key}:")))
            assert text.splitlines()[at - 1].startswith("  #"), f"{section}.{key} has no comment"


def test_the_simulated_captures_schema_is_its_dataclass():
    """A key that a preset sets has no default in the schema: the default would hide the preset."""
    from dior.simulate.settings import PRESETS, SECTIONS, Settings

    folder = Path(project.__file__).parents[2]
    config = yaml.safe_load((folder / "dior/project/schemas/config.schema.yaml").read_text())
    schema, real = config["properties"]["simulate"]["properties"], PRESETS["real"]
    parts = [(schema, Settings(), real)]
    parts += [(schema[name]["properties"], cls(), real.get(name, {})) for name, cls in SECTIONS.items()]
    for keys, settings, preset in parts:
        assert set(keys) == {field.name for field in dataclasses.fields(settings)}
        for key, description in keys.items():
            value = getattr(settings, key)
            if dataclasses.is_dataclass(value):
                continue
            assert ("default" in description) == (key not in preset), key
            if key not in preset:
                assert description["default"] == (list(value) if isinstance(value, tuple) else value), key


def test_a_preset_reaches_the_simulated_capture(root):
    from dior.simulate.settings import from_dict

    given = "simulate: {preset: real, clocks: {dropped: 0.2}}\ntriangulate:"
    edit(root, "config.yaml", "triangulate:", given)
    used = from_dict(project.load(root).config["simulate"])
    assert used.detector.level == "real" and used.mocap_hz == 120.0
    assert used.clocks.dropped == 0.2 and used.clocks.jitter_ms == 0.5
    edit(root, "config.yaml", "dropped: 0.2", "dropped: 2")
    fails(root, "config/config.yaml", "'simulate.clocks.dropped' is 2 but should be a number", "below 1")


def test_importing_the_module_is_light():
    heavy = "('numpy', 'yaml', 'pandas', 'jsonschema')"
    code = f"import sys, dior.project.project; print([m for m in {heavy} if m in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert found.strip() == "[]"


def test_a_slip_in_the_noted_minutes_shows_at_the_start(root):
    sheet = root / "config/effort.tsv"
    sheet.write_text("what\tminutes\nmarks\t30\n")
    project.load(root)
    sheet.write_text("what\tminute\nmarks\t30\n")
    with pytest.raises(DiorError, match="config/effort.tsv.*minute"):
        project.load(root)


def test_whose_clock_is_found_by_the_known_walker(root):
    """Outdoors a long-range camera; indoors only one that is aligned, since markers tell the others' clocks."""
    found = project.load(root)
    assert found.followed("out_1") == ["cam03"]
    assert found.followed("in_1") == [] and found.clocked("in_1") == found.cameras_of("in_1")
    found.camera_files["lab"]["cam01"]["role"] = "long_range"
    assert found.followed("in_1") == []
    found.camera_files["lab"]["cam01"]["locate"] = "align"
    assert found.followed("in_1") == ["cam01"]


def test_a_default_that_somebody_changes_is_not_everybodys():
    first, second = (
        schema_check.check(yaml.safe_load(CLOSE.format(name="cam01", x=1)), "camera", "cam01") for _ in range(2)
    )
    nested = [key for key, value in first.items() if isinstance(value, dict) and key != "tape"]
    assert nested
    for key in nested:
        first[key]["changed"] = True
        default = schema_check._schema("camera")["properties"][key]["default"]
        assert "changed" not in second[key] and "changed" not in default


@pytest.mark.parametrize("word", [".nan", ".inf", "-.inf"])
def test_a_length_is_a_finite_number(root, word):
    edit(root, "sessions/field/cam01.yaml", "position_m: [4, 0, 1.5]", f"position_m: [4, {word}, 1.5]")
    fails(root, "'tape.position_m.1' is", "finite number")


def test_a_word_that_is_like_none_gets_no_suggestion():
    assert nearest("xylophone", ["robust", "rays"]) == ""
    assert nearest("robost", ["robust", "rays"]) == " (did you mean 'robust'?)"


def test_privacy_masks_are_rectangles_of_a_camera(root):
    path = root / "config/sessions/field/session.yaml"
    before = path.read_text()
    path.write_text(before + "privacy_masks: {cam03: [[0, 180, 90, 300], [5, 5, 6, 7.5]]}\n")
    assert project.load(root).privacy_masks("field") == {"cam03": [[0, 180, 90, 300], [5, 5, 6, 7.5]]}
    assert project.load(root).privacy_masks("lab") == {}
    path.write_text(before + "privacy_masks: {cam30: [[0, 180, 90, 300]]}\n")
    fails(root, "field/session.yaml: privacy_masks names 'cam30', no camera of it", "did you mean 'cam03'")
    path.write_text(before + "privacy_masks: {cam03: [[90, 180, 0, 300]]}\n")
    fails(root, "privacy_masks of cam03: [90, 180, 0, 300] holds no pixel", "u_min, v_min, u_max, v_max")
    path.write_text(before + "privacy_masks: {cam03: [[90, 180, 100]]}\n")
    fails(root, "field/session.yaml", "privacy_masks")


@pytest.mark.parametrize(
    "file",
    ["offsets/out_1.yaml", "people/out_1.yaml", "boxes/out_1.cam03.csv", "heads/out_1.cam03.parquet", "effort.tsv"],
)
def test_what_need_not_be_there_is_not_left_out_in_silence(root, file):
    path = root / "config" / file
    path.parent.mkdir(exist_ok=True)

    def asked():
        made = project.load(root)
        return made.boxes("out_1"), made.seeds("out_1"), made.earlier_heads("out_1", "cam03"), made.effort()

    path.unlink(missing_ok=True)
    path.symlink_to("/nowhere/at/all")
    with pytest.raises(DiorError, match=f"config/{file}: (is a link to nothing|there is no such file)"):
        asked()
    path.unlink()
    path.mkdir()
    with pytest.raises(DiorError, match=f"config/{file}: is a folder"):
        asked()


def test_a_gallery_that_cannot_be_read_is_not_none(root):
    (root / "config/gallery.tsv").symlink_to("/nowhere/at/all")
    fails(root, "config/gallery.tsv: there is no such file")


@pytest.mark.parametrize("key", ["heads_checked", "detections_checked"])
def test_who_has_looked_is_told_by_camera(root, key):
    path = root / "config/sessions/field/session.yaml"
    before = path.read_text()
    path.write_text(before + f"{key}: {{cam03: all of out_1 looked at}}\n")
    assert getattr(project.load(root), key)("field") == {"cam03": "all of out_1 looked at"}
    assert getattr(project.load(root), key)("lab") == {}
    path.write_text(before + f"{key}: {{cam30: all of out_1 looked at}}\n")
    fails(root, f"field/session.yaml: {key} names 'cam30', no camera of it", "did you mean 'cam03'")
    path.write_text(before + f"{key}: {{cam03: S01 has looked at them}}\n")
    fails(root, f"{key} cam03 'S01 has looked at them' must not hold the name of subject 'S01'")
    path.write_text(before + f"{key}: {{cam03: yes}}\n")
    fails(root, "field/session.yaml", key)


def test_who_accepts_a_red_light_is_told_by_walk_or_camera(root):
    path = root / "config/sessions/field/session.yaml"
    before = path.read_text()

    def given(text):
        path.write_text(before + f"labels_accepted: {{{text}}}\n")

    given("out_1/cam03: the boxes are of the coat, out_1: mocap and floor are right")
    accepted = {"out_1/cam03": "the boxes are of the coat", "out_1": "mocap and floor are right"}
    assert project.load(root).labels_accepted("field") == accepted
    assert project.load(root).labels_accepted("lab") == {}
    shown = "field/session.yaml: labels_accepted names"
    given("out_11/cam03: the boxes are of the coat")
    fails(root, f"{shown} 'out_11', no sequence of this session", "did you mean 'out_1'")
    given("in_1: the boxes are of the coat")
    fails(root, f"{shown} 'in_1', no sequence of this session")
    given("out_1/cam30: the boxes are of the coat")
    fails(root, f"{shown} 'out_1/cam30', no camera of it", "did you mean 'cam03'")
    given("out_1: S01 has looked at them")
    fails(root, "labels_accepted 'S01 has looked at them' must not hold the name of subject 'S01'")
    for empty in ('""', '"              "', "yes", "null"):
        given(f"out_1: {empty}")
        fails(root, "field/session.yaml", "labels_accepted.out_1")


def test_all_people_are_asked_for_where_close_cameras_can_see_them(root):
    assert project.load(root).config["people"] == "subject"
    edit(root, "config.yaml", "data_root: data\n", "data_root: data\npeople: all\n")
    assert project.load(root).config["people"] == "all"
    edit(root, "config.yaml", "people: all", "people: al")
    fails(root, "config/config.yaml", "people", "'al'", "all")
    edit(root, "config.yaml", "people: al", "people: all")
    for name in ("out_1", "out_2"):
        line = next(text for text in (root / "config/sequences.tsv").read_text().splitlines() if text.startswith(name))
        edit(root, "sequences.tsv", line, f"{line}rain")
    fails(root, "config/config.yaml: 'people' is all, but no sequence is outdoors in a session with two close cameras")


@pytest.mark.parametrize("text", ["", "# nothing but this\n", "data_root: data\n"])
def test_every_key_of_the_config_may_be_left_out(root, text):
    (root / "config/config.yaml").write_text(text)
    p = project.load(root)
    assert p.data_root == "data" and p.config["release"]["version"] == "0.1.0" and p.config["release"]["license"] == ""
    template = yaml.safe_load((Path(project.__file__).parent / "templates/config.yaml").read_text())
    template["release"]["license"] = ""
    assert p.config == template


def test_only_a_release_needs_a_licence(root):
    edit(root, "config.yaml", ", license: CC-BY-4.0", "")
    release = project.load(root).config["release"]
    for asked in (lambda: licenses.check_chosen(release), lambda: licenses.text(release, root)):
        with pytest.raises(DiorError, match="'release.license' is not given, .*take one of CC0-1.0"):
            asked()


def told(root):
    """The files that the faults of a project name, of each the line or key."""
    with pytest.raises(DiorError) as caught:
        project.load(root)
    return [re.match(r"config/([\w./]+(?: line \d+)?): ", line)[1] for line in str(caught.value).split("\n")]


def test_faults_of_several_files_are_told_together(root):
    edit(root, "sessions/field/cam01.yaml", "role: close", "role: closed")
    edit(root, "sessions/field/cam03.yaml", "topic:", "tpic:")
    edit(root, "sessions/lab/session.yaml", "cameras:", "camras:")
    cameras = ["sessions/field/cam01.yaml", "sessions/field/cam03.yaml", "sessions/lab/session.yaml"]
    assert told(root) == cameras
    # also where sheets are wrong, without which nobody knows which of them are used
    edit(root, "sequences.tsv", "\tindoor", "\tindor")
    edit(root, "subjects.tsv", "\tyes", "\tmaybe")
    edit(root, "config.yaml", "method: rays", "method: ray")
    assert told(root) == ["config.yaml", "sequences.tsv line 4", "subjects.tsv line 2", *cameras]


def test_rows_that_name_what_is_not_there_are_told_together(root):
    for name in ("S01", "S02"):
        edit(root, "sequences.tsv", f"\t{name}\tfield", f"\t{name}\tfeild")
    edit(root, "sessions/lab/cam01.yaml", "role: close", "role: closed")
    assert told(root) == ["sequences.tsv line 3", "sequences.tsv line 2", "sessions/lab/cam01.yaml"]


def test_hand_made_files_are_told_together(root):
    edit(root, "offsets/in_1.yaml", "cam01", "cam07")
    (root / "config/boxes/out_1.cam09.csv").write_text("frame,u_min,v_min,u_max,v_max\n")
    edit(root, "sessions/field/session.yaml", "out_1", "out_9")
    assert len(told(root)) == 3


def test_of_many_faults_the_first_are_told():
    found = DiorErrors(DiorError(f"line {n}\nof it") for n in range(30))
    lines = str(found).split("\n")
    assert len(lines) == 21 and lines[0] == "line 0 of it" and lines[-1] == "and 10 more"


def sentences(root):
    """What is wrong with a project, a sentence each."""
    with pytest.raises(DiorErrors) as caught:
        project.load(root)
    return [str(one) for one in caught.value.found]


def test_all_slips_of_one_file_come_together(root):
    edit(root, "sessions/field/cam01.yaml", "role: close", "role: clsoe\ncolour: red\nnuge: {}")
    edit(root, "sessions/field/cam01.yaml", "[4, 0, 1.5]", "[4, 0]")
    cam01 = "config/sessions/field/cam01.yaml"
    assert sentences(root) == [
        f"{cam01}: unknown key 'colour'", f"{cam01}: unknown key 'nuge' (did you mean 'nudge'?)",
        f"{cam01}: 'role' is 'clsoe' but should be one of close, long_range (did you mean 'close'?)",
        f"{cam01}: 'tape.position_m' is [4, 0] but should be a list of 3 numbers",
    ]  # fmt: skip


def test_what_is_missing_hides_no_other_slip(root):
    edit(root, "sessions/field/cam01.yaml", "role: close\n", "")
    edit(root, "sessions/field/cam01.yaml", "[4, 0, 1.5]", "[4, 0]")
    missing, wrong = sentences(root)
    assert "cam01.yaml: key 'role' is missing" in missing and "cam01.yaml: 'tape.position_m' is [4, 0]" in wrong


def test_all_slips_of_all_rows_come_together(root):
    edit(root, "sequences.tsv", "\toutdoor", "\toutdor", 2)
    edit(root, "sequences.tsv", "out_1\t9", "out_1\tninth")
    edit(root, "subjects.tsv", "zebra-0001", "z")
    where = "config/sequences.tsv line"
    enough = "'environment' is 'outdor' but should be one of indoor, outdoor (did you mean 'outdoor'?)"
    assert [text.partition(";")[0] for text in sentences(root)] == [
        f"{where} 2: {enough}",
        f"{where} 3: 'session_order' is 'ninth' but should be a whole number, the place of the sequence in the order "
        "of recording within its session",
        f"{where} 3: {enough}",
        "config/subjects.tsv line 2: 'pseudonym' is 'z' but should be a made-up name of 8 or more letters, digits, _ "
        "and - (not first",
    ]


def test_all_columns_that_nobody_knows_come_together(root):
    edit(root, "sequences.tsv", "outfit\twalk", "outfits\twalks")
    assert sentences(root) == [
        "config/sequences.tsv: unknown column 'outfits' (did you mean 'outfit'?)",
        "config/sequences.tsv: unknown column 'walks' (did you mean 'walk'?)",
    ]
