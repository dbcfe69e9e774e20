"""What is wrong with a release is found, all of it, and named."""

import io
import shutil
import subprocess
import tarfile

import numpy as np
import pytest

from dior.cli import main
from dior.evaluate import evaluate
from dior.label import reproject
from dior.release import checksums, tarballs
from dior.release.verify import walk_checks
from dior.tables import tables
from tests.cases import some
from tests.release import made as project
from tests.release import made_up

PARTS = (*made_up.EVERYONE, checksums.METADATA)
LABELS = "labels_2d/zebra-0001/walk_2.cam02.parquet"
FRAMES = "frames/zebra-0001/walk_2.cam02.parquet"
SKELETON = "skeletons_3d/zebra-0001/walk_2.parquet"


@pytest.fixture(scope="module")
def packed(whole):
    """The tarballs of the release by part."""
    found = {part: whole.with_name(f"{part}.tar") for part in PARTS}
    for part, out in found.items():
        tarballs.run(release=whole, subject=part, out=out)
    return found


@pytest.fixture
def verified(capsys):
    def lines(*paths):
        """The lines of problems; none for what is whole."""
        code = main.main(["verify", *map(str, paths)])
        said = capsys.readouterr()
        found = said.out.splitlines()
        # on a busy machine there may be progress before it
        last = said.err.splitlines()[-1:]
        if code == 0:
            assert len(found) == 1 and "checksums right" in found[0]
            return []
        if found:
            assert last == [f"dior verify: {len(found)} problem{'s' if len(found) > 1 else ''}"]
        return found or last

    return lines


def flipped(path, at):
    content = bytearray(path.read_bytes())
    content[at] ^= 1
    path.write_bytes(content)


def test_what_is_whole_is_told_with_its_counts(whole, packed, capsys):
    assert main.main(["verify", "--decode", str(whole)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("dior-0.1.0: 55 files, ") and said.count("\n") == 1
    assert "46 tables, 2 subjects, 3 walks, 6 recordings; 72 labels on 24 frames; 33 points in 3D, 18 pictures" in said
    assert "(decoded)" in said
    assert main.main(["verify", *map(str, packed.values())]) == 0
    assert capsys.readouterr().out == said.replace("decoded", "headers read"), "all tarballs are the release"
    for part, out in packed.items():
        assert main.main(["verify", str(out)]) == 0
        assert "not all of the release was given" in capsys.readouterr().out, part


def evaluated(arguments):
    """A project of `made` whose labels are projections and whose figures are theirs: by the steps that make them."""
    results = arguments["project"] / "results"
    for path in arguments["skeletons"]:
        table = tables.read(path, "skeletons_3d")
        who, name = table["subject"][0], table["sequence"][0]
        n = 4 * len(project.JOINTS)
        columns = {
            "subject": [who] * n, "sequence": [name] * n, "joint": list(project.JOINTS) * 4,
            "instant": np.repeat(np.arange(4), 2), "stamp_ns": np.repeat(np.arange(4) * 10**8, 2),
            "x": np.tile([0.001, 0.9], 4), "y": np.full(n, 0.002), "z": np.full(n, 2.0), "status": ["ok"] * n,
        }  # fmt: skip
        tables.write(path, "skeletons_3d", columns)
        clock = {"sequence": [name] * 3, "camera": list(project.ROLES), "offset_s": [0.0, 0.02, 0.01],
                 "drift_ppm": [0.0, 5.0, 0.0], "source": ["reference"] * 3}  # fmt: skip
        tables.write(results / f"clocks/{name}.parquet", "offsets", clock)
        session = next(walk[2] for walk in project.WALKS if walk[0] == name)
        labels = [results / f"reproject/{name}.{camera}.parquet" for camera in project.ROLES]
        reproject.run(
            sequence=name, subject=who, labelled=list(project.ROLES), cameras=[results / f"place/{session}.parquet"],
            makers=[], covariance=[], skeleton=path, frames=results / f"frames/{name}.parquet",
            clocks=[results / f"clocks/{name}.parquet"], clock_gains=[], source="mocap", out=labels,
        )  # fmt: skip
        detected = results / f"detections/{name}.parquet"
        boxes, checks = (arguments["project"] / f"config/{one}" for one in ("boxes", "checks"))
        evaluate.run(
            sequence=name, subject=who, labels=labels, skeleton=None,
            cameras=[results / f"place/{session}.parquet"], roles=project.ROLES,
            detected=evaluate.Detected(detected if detected.exists() else None, 0.3, None, []),
            yardsticks=evaluate.Yardsticks(
                {"cam02": boxes / f"{name}.cam02.csv"} if (boxes / f"{name}.cam02.csv").exists() else {}, [],
                [results / "locate/field/cam01.marks.parquet"] if session == "field" else [],
                {"cam01": checks / f"{name}.cam01.csv"} if (checks / f"{name}.cam01.csv").exists() else {}, None,
            ),
            out=results / f"evaluate/{name}.parquet", out_frames=results / "f.parquet",
            out_checks=results / "c.parquet", out_quantiles=results / "q.parquet", findings=results / "e.parquet",
        )  # fmt: skip
    return arguments


@pytest.fixture(scope="module")
def packaged(tmp_path_factory):
    """The folder of a release that the step `package` has built."""
    arguments = project.project(tmp_path_factory.mktemp("packaged"))
    # it has no real heads
    arguments["config"]["release"]["faces"] = "shown"
    return project.build(evaluated(arguments))


def test_what_package_builds_is_whole(packaged, tmp_path, verified):
    assert verified(packaged) == []
    for part in ("zebra-0001", "metadata"):
        tarballs.run(release=packaged, subject=part, out=tmp_path / f"{part}.tar")
        assert verified(tmp_path / f"{part}.tar") == []


@pytest.mark.slow
def test_one_flipped_byte_in_each_kind_of_file(whole, made, verified):
    kinds = {}
    for path in sorted(path for path in made.rglob("*") if path.is_file()):
        name = path.relative_to(made).as_posix()
        kinds.setdefault(name.split("/")[0] if "/" in name else name, name)
    assert len(kinds) == 9 + 1 + 14, "tables by person, their checksums, what is at the top"
    for name in sorted(set(kinds.values()) - {"SHA256SUMS"}):
        shutil.copy(whole / name, made / name)
        flipped(made / name, (made / name).stat().st_size // 2)
        wrong = verified(made)
        assert wrong == [
            f"dior-0.1.0/{name}: its SHA-256 is not the listed one: damaged, changed or of another build; get it again"
        ]
        shutil.copy(whole / name, made / name)


@pytest.mark.parametrize("at", some([0, 64, 65, 66, 80, -1], 0, 66))
def test_a_flipped_byte_in_the_list_of_checksums(made, verified, at):
    flipped(made / "SHA256SUMS", at)
    assert verified(made) and all("dior-0.1.0/" in line for line in verified(made))


def test_a_file_removed_one_added_and_one_damaged_are_all_told(made, verified):
    (made / LABELS).unlink()
    (made / "labels_2d/zebra-0001/more.txt").touch()
    (made / ".DS_Store").touch()
    (made / "splits.parquet").write_bytes(b"")
    assert [line.split(":")[0] for line in verified(made)] == [
        "dior-0.1.0/.DS_Store", "dior-0.1.0/labels_2d/zebra-0001/more.txt", f"dior-0.1.0/{LABELS}",
        "dior-0.1.0/splits.parquet",
    ]  # fmt: skip
    shutil.rmtree(made / "labels_2d")
    assert len([line for line in verified(made) if line.endswith("is missing")]) == 6


@pytest.mark.parametrize(
    ("lines", "problem"),
    [
        ("nonsense\n", "SHA256SUMS: line 1 is not '<SHA-256>  <path>'"),
        ("{0}  /etc/passwd\n", "SHA256SUMS: line 1: '/etc/passwd' is not a path inside the release"),
        ("{0}  ../outside\n", "SHA256SUMS: line 1: '../outside' is not a path inside the release"),
        ("{0}  a//b/c\n", "SHA256SUMS: line 1: 'a//b/c' is not a path inside the release"),
        ("{0}  LICENSE\n{0}  LICENSE\n", "SHA256SUMS: line 2: 'LICENSE' is listed twice"),
        ("{0}  LICENSE", "SHA256SUMS: the last line does not end, so that the file is cut off"),
        ("", "README.md: should not be in the files"),
        ("{0}  a/b\n", "a/b: lies where a release has no files"),
    ],
)
def test_a_malformed_list_of_checksums(made, verified, lines, problem):
    (made / "SHA256SUMS").write_text(lines.format("0" * 64))
    assert f"dior-0.1.0/{problem}" in verified(made)


def test_no_list_of_checksums_at_all(made, verified, tmp_path):
    (made / "SHA256SUMS").unlink()
    assert "has no SHA256SUMS, so that it is no release" in verified(made)[0]
    assert "there is no such folder or tarball" in verified(tmp_path / "nothing")[0]
    (tmp_path / "x.tar").write_bytes(b"no tarball" * 200)
    assert "is no tarball of a release" in verified(tmp_path / "x.tar")[0]


def test_a_link_is_no_file(made, verified, tmp_path):
    (made / LABELS).rename(tmp_path / "elsewhere")
    (made / LABELS).symlink_to(tmp_path / "elsewhere")
    assert f"dior-0.1.0: {LABELS}: is a symbolic link, which a release has none of" in verified(made)


def labels(changed):
    return LABELS, "labels_2d", made_up.labels("walk_2", "cam02", **changed)


def frames(changed):
    return FRAMES, "released_frames", made_up.frames("walk_2", "cam02", **changed)


def changed_row(function, column, row, value, *args):
    values = np.array(function(*args)[column], object)
    values[row] = value
    if column in ("u", "v", "x", "stamp_ns", "frame", "instant"):
        values = values.astype(float if column in "uvx" else np.int64)
    return {column: values}


def label_row(column, row, value):
    return labels(changed_row(made_up.labels, column, row, value, "walk_2", "cam02"))


def frame_row(column, row, value):
    return frames(changed_row(made_up.frames, column, row, value, "walk_2", "cam02"))


def skeleton_row(column, row, value):
    columns = made_up.skeleton("walk_2", **changed_row(made_up.skeleton, column, row, value, "walk_2"))
    return SKELETON, "skeletons_3d", columns


N = made_up.FRAMES * len(made_up.JOINTS)
STAMPS = made_up.stamps()
MIRRORED = np.diag([1, 1, -1, 1.0]).ravel()


@pytest.mark.parametrize(
    ("table", "problems"),
    [
        (
            labels({"frame": np.repeat([0, 1, 2, 7], 3)}),
            [
                f"{LABELS}: 3 rows in frames that camera cam02 does not have, first frame 7, joint nose",
                f"{LABELS}: 1 frames without labels, first frame 3",
            ],
        ),
        (
            label_row("stamp_ns", 5, STAMPS[1] + 1),
            [f"{LABELS}: 1 rows whose stamp is not that of the frame of camera cam02, first frame 1, joint right_hip"],
        ),
        (
            label_row("joint", 4, "nose"),
            [f"{LABELS}: is not complete: every frame must have a row for each of its 3 joints, in one order"],
        ),
        (
            label_row("frame", 4, 2),
            [
                f"{LABELS}: is not complete or not sorted by frame",
                f"{LABELS}: 1 rows whose stamp is not that of the frame of camera cam02, first frame 2, joint left_hip",
            ],
        ),
        (
            label_row("u", 4, np.nan),
            [f"{LABELS}: 1 labels without a pixel although their status says otherwise, first frame 1, joint left_hip"],
        ),
        (
            label_row("u", 4, 31.6),
            [
                f"{LABELS}: 1 labels outside the picture although their status says otherwise, first frame 1, "
                "joint left_hip"
            ],
        ),
        (
            label_row("status", 4, "behind_camera"),
            [
                f"{LABELS}: 1 labels with a pixel although their status says otherwise, first frame 1, joint left_hip",
            ],
        ),
        (label_row("status", 4, ""), [f"{LABELS}: 1 rows without a status, first frame 1, joint left_hip"]),
        (
            labels({"subject": ["apple-0002"] * N}),
            [f"{LABELS}: subject 'apple-0002' in a file of 'zebra-0001'"],
        ),
        (labels({"camera": ["cam01"] * N}), [f"{LABELS}: camera 'cam01' in a file of 'cam02'"]),
        (
            label_row("status", 4, "out_of_frame"),
            [
                f"{LABELS}: 1 labels have a status that the 3D denies, first frame 1, joint left_hip: out_of_frame",
            ],
        ),
        (
            (FRAMES, "labels_2d", made_up.labels("walk_2", "cam02")),
            [
                f"{FRAMES}: holds the table 'labels_2d', not 'released_frames'",
            ],
        ),
        (
            frame_row("no_image", 1, "no_consent"),
            [f"{FRAMES}: 1 rows with a picture and a reason for none, first frame 1"],
        ),
        (frame_row("no_image", 3, ""), [f"{FRAMES}: 1 rows with neither a picture nor a reason, first frame 3"]),
        (
            frame_row("image", 1, made_up.jpeg(1, (24, 33))),
            [f"{FRAMES}: 1 pictures: 33x24 px where the row says 32x24, first frame 1"],
        ),
        (
            frame_row("image", 1, made_up.jpeg(1)[:-1]),
            [f"{FRAMES}: 1 pictures: no JPEG, or one that is cut off, first frame 1"],
        ),
        (
            frame_row("image", 2, b"\xff\xd8\xff\xe1\x00\x08Exif\0\0" + made_up.jpeg(1)[2:]),
            [f"{FRAMES}: 1 pictures: more than the picture is in it (JPEG segment 0xe1), first frame 2"],
        ),
        (
            frames({"width": [40] * 4, "image": np.array([None] * 4), "no_image": ["no_consent"] * 4}),
            [f"{FRAMES}: 40x24 px where cameras.parquet says 32x24"],
        ),
        (
            frames({"stamp_ns": STAMPS[[0, 1, 2, 0]]}),
            [
                f"{FRAMES}: 1 stamps that go back, first frame 3",
                f"{LABELS}: 3 rows whose stamp is not that of the frame of camera cam02, first frame 3, joint nose",
                "detections/zebra-0001/walk_2.cam02.parquet: 1 rows whose stamp is not that of the frame of camera "
                "cam02, first frame 3, joint nose",
            ],
        ),
        (
            ("marks/zebra-0001/walk_1.parquet", "released_marks", made_up.marks("walk_1", frame=[9])),
            ["marks/zebra-0001/walk_1.parquet: 1 rows in frames that camera cam01 does not have, first frame 9, "
             "joint LASI"],
        ),
        (
            ("marks/zebra-0001/walk_1.parquet", "released_marks", made_up.marks("walk_1", camera=["cam09"])),
            ["marks/zebra-0001/walk_1.parquet: is about camera 'cam09', of which there is no table of frames"],
        ),
        (skeleton_row("instant", 4, 7), [f"{SKELETON}: is not complete or not sorted by instant"]),
        (
            skeleton_row("x", 4, np.nan),
            [f"{SKELETON}: 1 points that are missing although their status says otherwise, "
             "first instant 1, joint left_hip"],
        ),
        (
            ("sequences.parquet", "sequences", made_up.sequences(subject=["zebra-0001", "zebra-0001", "ghost-0009"])),
            [
                "labels_2d/: sequence 'apple-0002 walk_3' is not in sequences.parquet",
                "sequences.parquet: subject 'ghost-0009' is not in subjects.parquet",
                "sequences.parquet: sequence 'ghost-0009 walk_3' is not in labels_2d/",
            ],
        ),
        (
            ("subjects.parquet", "subjects", {"subject": ["zebra-0001", "apple-0002", "ghost-0009"]}),
            ["subjects.parquet: subject 'ghost-0009' is not in labels_2d/"],
        ),
        (
            ("cameras.parquet", "released_cameras", made_up.cameras(camera=["cam01", "cam03", "cam01", "cam02"])),
            [
                "camera_covariance.parquet: session and camera 'field cam02' is not in cameras.parquet",
                "labels_2d/: session and camera 'field cam02' is not in cameras.parquet",
            ],
        ),
        (
            ("cameras.parquet", "released_cameras", made_up.cameras(wTc=np.tile(MIRRORED, (4, 1)))),
            [f"cameras.parquet: session and camera '{name}' has a pose that is no rotation and translation"
             for name in ("field cam01", "field cam02", "lab cam01", "lab cam02")],
        ),
        (
            ("clocks.parquet", "released_clocks", made_up.clocks(camera=["cam01", "cam02"] * 2 + ["cam01", "cam03"])),
            ["clocks.parquet: recording 'apple-0002 walk_3 cam03' is not in labels_2d/",
             "clocks.parquet: recording 'apple-0002 walk_3 cam02' has no clock"],
        ),
        (
            ("splits.parquet", "splits", made_up.splits(part=["test", "test", "test", "train", "train", "val"])),
            ["splits.parquet: subject 'zebra-0001' is in test and train and val by subject"],
        ),
        (
            ("splits.parquet", "splits", made_up.splits(camera=["cam01", "cam02", "cam01", "cam02", "cam01", "cam07"])),
            [
                "splits.parquet: recording 'zebra-0001 walk_2 cam02' is in no part by subject",
                "splits.parquet: recording 'zebra-0001 walk_2 cam07' is not in labels_2d/",
            ],
        ),
        (
            ("detection/zebra-0001/walk_2.cam02.parquet", "released_detections", made_up.detections("walk_2", "cam02")),
            ["detection/zebra-0001/walk_2.cam02.parquet: lies in a folder that a release does not have (did you "
             "mean 'detections'?)"],
        ),
        (
            ("boxes/zebra-0001/walk_2.parquet", "released_boxes", made_up.boxes("walk_2", "cam02")),
            ["boxes/zebra-0001/walk_2.parquet: is not called as boxes/<subject>/<sequence>.<camera>.parquet"],
        ),
    ],
)  # fmt: skip
def test_tables_that_contradict_each_other_with_checksums_made_anew(made, verified, table, problems):
    made_up.write(made, *table)
    assert verified(made) == sorted(f"dior-0.1.0/{problem}" for problem in problems)


def test_a_damaged_scan_is_found_by_decoding_only(made, verified, capsys):
    """The header is whole, the end is there, and between them is a marker that no JPEG has there."""
    data = made_up.jpeg(1)
    broken = data[: data.index(b"\xff\xda") + 2] + b"\0\0" + data[-2:]
    made_up.write(made, *frame_row("image", 1, broken))
    assert verified(made) == []
    assert main.main(["verify", "--decode", str(made)]) == 1
    assert f"dior-0.1.0/{FRAMES}: 1 pictures: cannot be decoded, first frame 1" in capsys.readouterr().out


def test_a_column_that_is_gone_renamed_or_of_another_type(made, verified):
    import pyarrow.parquet as pq

    table = pq.ParquetFile(made / LABELS).read()
    renamed = [{"depth": "depths"}.get(name, name) for name in table.column_names]
    for changed, problem in (
        (table.drop_columns(["depth"]), "has no column 'depth'"),
        (table.rename_columns(renamed), "has no column 'depth' (did you mean 'depths'?)"),
        (table.append_column("name", table["subject"]), "has a column 'name' that the table labels_2d does not have"),
        (table.set_column(6, "u", table["u"].cast("float64")), "column 'u' is double, not float"),
        (table.select(table.column_names[::-1]), "has its columns in another order"),
        (table.replace_schema_metadata({}), "holds the table 'unknown', not 'labels_2d'"),
    ):
        if problem[-1] != "'":
            changed = changed.replace_schema_metadata(table.schema.metadata)
        pq.write_table(changed, made / LABELS)
        made_up.remade(made)
        (line,) = verified(made)
        assert line.startswith(f"dior-0.1.0/{LABELS}: {problem}")
    (made / LABELS).write_bytes(b"PAR1 rubbish PAR1")
    made_up.remade(made)
    assert f"dior-0.1.0/{LABELS}: is not a readable Parquet file" in verified(made)[0]


def test_files_that_a_release_must_have(made, verified):
    for name in ("LICENSE", "splits.parquet", "skeletons_3d/zebra-0001/walk_2.parquet", FRAMES):
        (made / name).unlink()
    made_up.remade(made)
    assert [
        line for line in verified(made) if line.startswith(("dior-0.1.0/LI", "dior-0.1.0/sp", "dior-0.1.0/sk"))
    ] == [
        "dior-0.1.0/LICENSE: is missing; a release has it",
        "dior-0.1.0/skeletons_3d/zebra-0001/walk_2.parquet: is not in the release, which has other tables of that walk",
        "dior-0.1.0/splits.parquet: is missing; a release has it",
    ]
    assert f"dior-0.1.0/{FRAMES}: is not in the release, which has other tables of that walk" in verified(made)


def test_texts_that_do_not_fit(made, verified):
    (made / "provenance.json").write_text("{")
    (made / "croissant.json").write_text('{"distribution": [{"contentUrl": "splits.parquet", "sha256": "0"}]}')
    header = ",".join(tables.columns_of("metrics"))
    (made / "metrics.csv").write_text(f"{header}\ncoverage,,ghost-0009,walk_9,cam01,,,,,,,\n")
    made_up.remade(made)
    assert [line.split(" (")[0] for line in verified(made)] == [
        "dior-0.1.0/croissant.json: has another SHA-256 of splits.parquet than SHA256SUMS",
        "dior-0.1.0/metrics.csv: sequence 'walk_9' is not in sequences.parquet",
        "dior-0.1.0/metrics.csv: subject 'ghost-0009' is not in subjects.parquet",
        "dior-0.1.0/provenance.json: is not the JSON that dior writes",
    ]
    (made / "metrics.csv").write_text("metric,value\n")
    made_up.remade(made)
    assert "dior-0.1.0/metrics.csv: has the columns metric, value, not metric, tool" in "\n".join(verified(made))


def test_a_subjects_list_that_is_not_of_the_whole_one(made, verified):
    path = made / checksums.list_of("zebra-0001")
    path.write_text(path.read_text().split("\n", 1)[1])
    found = checksums.read(made)
    found[checksums.list_of("zebra-0001")] = checksums.digest(open(path, "rb"))
    (made / "SHA256SUMS").write_text(checksums.text(found))
    assert verified(made) == [
        "dior-0.1.0/checksums/zebra-0001/SHA256SUMS: is not the part of SHA256SUMS that is about zebra-0001"
    ]


def test_every_byte_of_a_tarball_counts(packed, tmp_path, verified):
    """Headers, padding and the end of a tarball are known to the last bit, too."""
    content = packed["apple-0002"].read_bytes()
    with tarfile.open(packed["apple-0002"]) as tar:
        entries = tar.getmembers()
    second = entries[1]
    places = [0, 155, second.offset, second.offset + 100, second.offset + 136, second.offset + 257, second.offset + 511]
    places += [second.offset_data, second.offset_data + second.size, entries[2].offset - 1, len(content) - 1]
    places += [entries[-1].offset_data + entries[-1].size, len(content) - 10240 // 2]
    out = tmp_path / "x.tar"
    for at in places:
        out.write_bytes(content)
        flipped(out, at)
        assert verified(out), at
    out.write_bytes(content)
    assert verified(out) == []


def test_a_tarball_that_is_cut_off_anywhere_or_longer(packed, tmp_path, verified):
    content = packed["apple-0002"].read_bytes()
    with tarfile.open(packed["apple-0002"]) as tar:
        third = tar.getmembers()[3]
    out = tmp_path / "x.tar"
    for size in (third.offset, third.offset + 7, third.offset + 512, third.offset_data + 9, len(content) - 1):
        out.write_bytes(content[:size])
        lines = verified(out)
        assert any(f"{out}: cut off" in line for line in lines), (size, lines)
        if size < len(content) - 1:
            assert f"dior-0.1.0/{third.name.split('/', 1)[1]}: is missing of {out}" in lines
    for more in (b"\0", b"x" * 10240):
        out.write_bytes(content + more)
        (line,) = verified(out)
        assert "too many" in line or "something was added" in line


def repacked(out, entries):
    """A tarball of (name, content, type) entries."""
    with tarfile.open(out, "w", format=tarfile.PAX_FORMAT) as tar:
        for name, content, kind in entries:
            entry = tarfile.TarInfo(name)
            entry.size, entry.mode, entry.type = len(content), 0o644, kind
            if kind != tarfile.REGTYPE:
                entry.linkname = "/etc/passwd"
            tar.addfile(entry, io.BytesIO(content))
    return out


@pytest.mark.parametrize(
    ("name", "kind", "problem"),
    [
        ("/etc/cron.d/x", tarfile.REGTYPE, "would be unpacked outside of dior-0.1.0/"),
        ("../x", tarfile.REGTYPE, "would be unpacked outside of dior-0.1.0/"),
        ("dior-0.1.0/../../x", tarfile.REGTYPE, "would be unpacked outside of dior-0.1.0/"),
        ("dior-0.2.0/x", tarfile.REGTYPE, "would be unpacked outside of dior-0.1.0/"),
        ("dior-0.1.0/x", tarfile.SYMTYPE, "is a link or another thing that is no plain file"),
        ("dior-0.1.0/x", tarfile.LNKTYPE, "is a link or another thing that is no plain file"),
        ("dior-0.1.0/x", tarfile.FIFOTYPE, "is a link or another thing that is no plain file"),
        ("dior-0.1.0/LICENSE", tarfile.REGTYPE, "is in the tarball twice"),
        ("dior-0.1.0/x", tarfile.REGTYPE, "should not be in the files"),
    ],
)
def test_traps_in_a_tarball(whole, tmp_path, verified, name, kind, problem):
    members = [
        (f"dior-0.1.0/{n}", (whole / n).read_bytes(), tarfile.REGTYPE) for n in tarballs.members(whole, "metadata")
    ]
    out = repacked(tmp_path / "x.tar", members)
    assert verified(out) == []
    content = b"evil" if kind == tarfile.REGTYPE else b""
    lines = verified(repacked(out, [*members, (name, content, kind)]))
    assert len(lines) == 1 and problem in lines[0] and name.removeprefix("dior-0.1.0/") in lines[0]


def test_a_tarball_packed_with_an_owner_or_in_an_unsafe_folder(packed, tmp_path, verified):
    with tarfile.open(packed["metadata"]) as tar:
        tar.extractall(tmp_path, filter="data")
    out = tmp_path / "x.tar"
    subprocess.run(["tar", "cf", out, "dior-0.1.0/SHA256SUMS", "dior-0.1.0/LICENSE"], cwd=tmp_path, check=True)
    assert "its entry is not as dior writes it" in "\n".join(verified(out))
    assert "is no tarball of a release" in verified(repacked(out, [("../SHA256SUMS", b"", tarfile.REGTYPE)]))[0]


def test_tarballs_of_two_builds_do_not_fit(packed, made, tmp_path, verified):
    made_up.write(made, *labels({"sigma_u": np.full(N, 0.6)}))
    out = tmp_path / "newer.tar"
    tarballs.run(release=made, subject="zebra-0001", out=out)
    assert verified(out) == []
    (first, second) = verified(out, packed["metadata"])
    assert first.startswith("dior-0.1.0/checksums/zebra-0001/SHA256SUMS: its SHA-256 is not the listed one")
    assert second.startswith(f"dior-0.1.0/{LABELS}: its SHA-256 is not the listed one")


def test_an_exports_folder(tmp_path, verified):
    folder = tmp_path / "dior-0.1.0-exports"
    (folder / "opengait/zebra-0001/coat/090").mkdir(parents=True)
    (folder / "opengait/zebra-0001/coat/090/090.pkl").write_bytes(b"pickle")
    (folder / "coco").mkdir()
    (folder / "coco/labels.json").write_text("{}")
    names = ("coco/labels.json", "opengait/zebra-0001/coat/090/090.pkl")
    (folder / "SHA256SUMS").write_text(
        checksums.text({name: checksums.digest(open(folder / name, "rb")) for name in names})
    )
    assert verified(folder) == []
    flipped(folder / names[0], 0)
    (folder / names[1]).unlink()
    (folder / "coco/more.json").touch()
    assert [line.split(":")[0] for line in verified(folder)] == [
        f"dior-0.1.0-exports/{name}" for name in (names[0], "coco/more.json", names[1])
    ]


def test_a_release_of_a_newer_version_is_one_sentence(made, verified):
    made_up.of_version(made, b"99")
    assert verified(made) == [
        f"{made.name}: its tables are of version '99', this dior knows 1; take the dior that made it"
    ]
    flipped(made / LABELS, 0)
    assert len(verified(made)) == 2, "checksums are looked at all the same"


def test_paths_that_are_no_release(tmp_path, verified):
    (tmp_path / "file").write_text("no release")
    (tmp_path / "empty").mkdir()
    assert verified(tmp_path / "gone") == [f"dior verify: {tmp_path / 'gone'}: there is no such folder or tarball"]
    (said,) = verified(tmp_path / "file")
    assert said.startswith(f"dior verify: {tmp_path / 'file'}: is no tarball of a release")
    (said,) = verified(tmp_path / "empty")
    assert said.startswith(f"dior verify: {tmp_path / 'empty'}: has no SHA256SUMS")


@pytest.mark.parametrize("stray", ["labels_2d/stray.parquet", "labels_2d/a/b/c.parquet"])
def test_a_file_where_a_release_has_none(made, verified, stray):
    (made / stray).parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(made / LABELS, made / stray)
    made_up.remade(made)
    assert f"{made.name}/{stray}: lies where a release has no files" in verified(made)


@pytest.mark.parametrize("marker", [0xFE, 0xE1, 0xED, 0xEF])
def test_a_comment_or_an_application_segment_in_a_picture_is_a_problem(marker):
    data = made_up.jpeg()
    assert walk_checks.jpeg_size(data) == (made_up.HEIGHT, made_up.WIDTH)
    with pytest.raises(ValueError, match=f"more than the picture is in it .JPEG segment {marker:#x}"):
        walk_checks.jpeg_size(data[:2] + bytes([0xFF, marker, 0, 6]) + b"home" + data[2:])
