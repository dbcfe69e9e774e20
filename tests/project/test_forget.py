"""What is left of people who are gone is found, and deleted only on demand; everything else stays."""

import json
from base64 import urlsafe_b64encode

import pytest

from dior.cli import main
from dior.errors import DiorError
from dior.project import forget
from tests.project.test_consent import people
from tests.project.test_project import edit, root  # noqa: F401

KEPT = """
results/frames/in_1.parquet results/reproject/out_1.cam01.parquet results/adjust/field.parquet
results/adjust/field.metrics.parquet results/locate/lab/cam01.parquet results/evaluate/metrics.csv
results/evaluate/statistics.csv results/evaluate/out_1.frames.parquet results/evaluate/to_mark/boxes/out_1.cam03.csv
results/reid/out_1.skeleton.parquet results/reid/table.csv results/reid/cmc.csv results/reid/left_out.csv
results/reid/index.html results/reid/plots/reid_cmc.svg logs/recognise/recognise.log logs/inputs/out_1.log
results/report/index.html results/report/cost.html results/report/sequences/out_1.html
results/report/sequences/.snakemake_timestamp
results/report/assets/plots/out_2.svg results/report/assets/out_1/cam01.jpg results/timing.csv
results/gallery/gallery.parquet results/gallery/gallery.findings.parquet results/frames/out_3.parquet
results/frames/out_1.parquet
results/simulate/out_1/pc1.bag results/simulate/truth/out_1/labels_2d.parquet results/mine/out_2.txt
results/zoom/out_1.cam03/frame_000000.png logs/frames/in_1.log logs/adjust/field.timing.json
logs/package/package.log logs/metrics/metrics.benchmark.tsv logs/evaluate/to_mark.log logs/report/report.log
logs/tarballs/zebra-0001.log .snakemake/log/1.snakemake.log
results/release/dior-1.0.0/labels_2d/zebra-0001/out_1.cam01.parquet results/release/dior-1.0.0-exports/coco/all.json
results/release/dior-1.0.0-exports/SHA256SUMS results/release/dior-1.0.0-zebra-0001.tar
results/release/dior-1.0.0-metadata.tar results/release/.dior-1.0.0-zebra-0001.part.tar
results/release/.dior-1.0.0-zebra-0001.part.json
results/.sha256/frames/in_1.parquet results/.sha256/simulate/truth/out_1/labels_2d.parquet
results/.sha256/evaluate/metrics.csv results/.sha256/locate/lab/cam01.parquet
""".split()
# of out_2, whose subject S02 (apple-0002) withdrew, of a session and of a sequence that are not there any more
GONE = """
results/frames/out_2.parquet results/frames/.out_2.part.parquet results/reproject/out_2.cam01.parquet
results/reid/out_2.parquet results/reid/out_2.skeleton.parquet logs/inputs/out_2.log
results/evaluate/out_2.parquet results/evaluate/to_mark/boxes/out_2.cam03.csv results/adjust/hall.parquet
results/locate/hall results/audit/walk_7.findings.parquet results/report/sequences/out_2.html
results/report/assets/out_2 results/simulate/out_2 results/simulate/truth/out_2 results/zoom/out_2.cam03
logs/frames/out_2.log logs/clocks/out_2.cam01.benchmark.tsv logs/tarballs/apple-0002.log
.snakemake/log/0.snakemake.log
results/release/dior-0.9.0 results/release/dior-0.9.0-exports results/release/dior-0.9.0-zebra-0001.tar
results/release/dior-0.9.0-metadata.tar results/release/dior-1.0.0-apple-0002.tar results/release/.dior-1.0.0.part
results/release/.dior-1.0.0-apple-0002.part.tar results/release/.dior-1.0.0-metadata.part.tar
results/frames/.out_2.8fab0a-7c0deb-123-4567-1.part.parquet results/.sha256/frames/out_2.parquet
results/.sha256/locate/hall results/.sha256/simulate/truth/out_2
""".split()


@pytest.fixture
def withdrawn(root):  # noqa: F811
    """A project after a run, whose S02 has withdrawn since an earlier one."""
    people(root, "yes yes", "no")
    for name in (*KEPT, *GONE):
        path = root / name
        path = path if path.suffix and not path.name.startswith("dior-0.9.0") else path / "file.bin"
        if path.name == "file.bin" and name.endswith((".tar", "SUMS", "_timestamp", "out_2.cam03")):
            path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x")
    for name, walks in (("1.0.0", ["zebra-0001/out_1"]), ("0.9.0", ["zebra-0001/out_1", "apple-0002/out_2"])):
        lines = [f"{'0' * 64}  labels_2d/{walk}.cam01.parquet\n" for walk in walks]
        (root / f"results/release/dior-{name}").mkdir(exist_ok=True)
        (root / f"results/release/dior-{name}/SHA256SUMS").write_text("".join(lines) + f"{'0' * 64}  README.md\n")
    (root / ".snakemake/log/0.snakemake.log").write_text("output: results/frames/out_2.parquet\n")
    (root / ".snakemake/log/1.snakemake.log").write_text("output: results/frames/out_1.parquet\nout_21 _out_2\n")
    for output in ("results/frames/out_1.parquet", "results/frames/out_2.parquet"):
        record = root / ".snakemake/metadata" / urlsafe_b64encode(output.encode()).decode()
        record.parent.mkdir(exist_ok=True)
        record.write_text("{}")
    return root


def record(output):
    return f".snakemake/metadata/{urlsafe_b64encode(output.encode()).decode()}"


def present(folder):
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def test_a_folder_that_is_no_project_is_named(capsys, tmp_path):
    for folder in (tmp_path, "/nope"):
        assert main.main(["forget", "--project", str(folder)]) == 1
        assert f"{folder}: is no project (there is no config/ in it)" in capsys.readouterr().err


def test_what_is_left_is_listed_and_stays(withdrawn, capsys):
    before = present(withdrawn)
    assert main.main(["forget", "--project", str(withdrawn)]) == 0
    told = capsys.readouterr().out
    listed = {line for line in told.splitlines() if line.startswith(("results/", "logs/", ".snakemake/"))}
    assert listed == {*GONE, record("results/frames/out_2.parquet")}
    assert f"{len(listed)} files and folders" in told and "--yes does it" in told
    assert present(withdrawn) == before


def test_deleting_leaves_everything_else(withdrawn, capsys):
    before = present(withdrawn)
    (withdrawn / "config/boxes/out_2.cam03.csv").touch()
    (withdrawn / "data/out_2").mkdir(parents=True)
    (withdrawn / "data/out_2/a.bag").touch()
    assert main.main(["forget", "--project", str(withdrawn), "--yes"]) == 0
    told = capsys.readouterr().out
    assert "Deleted 33 files and folders" in told
    assert told.split("dior deletes none of these:\n")[1].split() == [
        "data/out_2/a.bag",
        "config/boxes/out_2.cam03.csv",
    ]
    after = present(withdrawn) - {"config/boxes/out_2.cam03.csv", "data/out_2/a.bag"}
    gone = {name for name in before if name.startswith(tuple(GONE)) or name == record("results/frames/out_2.parquet")}
    assert after == before - gone and {record("results/frames/out_1.parquet"), *KEPT} <= after
    assert forget.left(withdrawn) == []
    forget.run(project=withdrawn, yes=True)
    assert capsys.readouterr().out.startswith("Nothing is left in results/ and logs/")


def test_rows_that_were_taken_out_are_gone_too(withdrawn):
    """Nobody remembers the name then, but nothing that is there has it."""
    sheet = withdrawn / "config/sequences.tsv"
    sheet.write_text("".join(line for line in sheet.open() if not line.startswith("out_2")))
    people = withdrawn / "config/subjects.tsv"
    people.write_text("".join(line for line in people.open() if not line.startswith("S02")))
    assert {str(path) for path in forget.left(withdrawn)} == {n for n in GONE if not n.startswith(".snakemake")}


def test_the_last_one_can_be_forgotten(withdrawn):
    people(withdrawn, "no", "no")
    left = {str(path) for path in forget.left(withdrawn)}
    assert {"results/frames/in_1.parquet", "results/adjust/field.parquet", "results/release/dior-1.0.0"} <= left
    assert "results/evaluate/metrics.csv" not in left and "results/mine/out_2.txt" not in left


def test_who_may_be_processed_but_not_published_is_in_no_release(withdrawn):
    edit(withdrawn, "subjects.tsv", "\tno", "\tno\tno\tyes")
    left = {str(path) for path in forget.left(withdrawn)}
    assert "results/frames/out_2.parquet" not in left and "results/release/dior-0.9.0" in left


def noted(root, output, **content):  # noqa: F811
    """Write Snakemake's record of an output."""
    path = root / record(output)
    path.write_text(json.dumps({"rule": "r", "input": [], "params": [], **content}))
    return path


def test_what_is_about_all_but_was_made_of_who_is_gone_is_found_by_its_record(withdrawn, capsys):
    """As where nothing asks for it any more: one person is left to recognise, or nobody in the gallery."""
    table = noted(
        withdrawn, "results/reid/table.csv", input=["results/reid/out_1.parquet", "results/reid/out_2.parquet"]
    )
    page = noted(withdrawn, "results/reid/index.html", input=["results/reid/table.csv"])
    rows = json.dumps(json.dumps([{"subject": "apple-0002", "outfit": "coat"}]))
    gallery = noted(withdrawn, "results/gallery/gallery.parquet", params=[rows])
    marked = noted(withdrawn, "results/evaluate/to_mark", input=["results/reproject/out_2.cam03.parquet"])
    kept = noted(withdrawn, "results/evaluate/metrics.csv", input=["results/evaluate/out_1.parquet"], params=["S02_"])
    forget.run(project=withdrawn, yes=True)
    assert not any(path.exists() for path in (table, page, gallery, marked)) and kept.exists()
    assert not any((withdrawn / f"results/{name}").exists() for name in ("reid/table.csv", "reid/index.html"))
    assert not (withdrawn / "results/gallery/gallery.parquet").exists()
    assert (withdrawn / "results/evaluate/metrics.csv").exists() and (withdrawn / "results/evaluate/to_mark").exists()
    capsys.readouterr()
    forget.run(project=withdrawn)
    assert capsys.readouterr().out.startswith("Nothing is left")


def test_what_older_versions_noted_is_found(withdrawn):
    """The sheets in the parameters of the release, names in shell lines, records of files that are gone, logs."""
    sheets = json.dumps(json.dumps([{"out_1": {"subject": "S01"}}, {"S02": {"height_m": "1.8"}}]))
    packed = noted(withdrawn, "results/release/dior-1.0.0/labels_2d/zebra-0001/out_1.cam01.parquet", params=[sheets])
    shell = noted(withdrawn, "results/timing.csv", shellcmd="dior refine --subject S02 --out x")
    gone = [
        noted(withdrawn, f"results/release/dior-1.0.0/{name}")
        for name in ("labels_2d/apple-0002/out_2.cam01.parquet", "cameras.parquet")
    ]
    unlike = noted(withdrawn, "results/reid/cmc.csv", params=["S021", "'xS02'"], code="S02 is a word here")
    notes = [withdrawn / name for name in ("logs/report/report.log", ".snakemake/scripts/tmp1.step.py")]
    for path in notes:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("S02 would be 1.80 m tall\n")
    listed = set(forget._made_of(withdrawn, forget._Telling(forget.Known(withdrawn))))
    forget.run(project=withdrawn, yes=True)
    assert not any(path.exists() for path in (packed, shell, *gone, *notes)) and unlike.exists()
    assert packed.relative_to(withdrawn) in listed
    assert (withdrawn / "results/release/dior-1.0.0/labels_2d/zebra-0001/out_1.cam01.parquet").exists()


@pytest.mark.parametrize("name", ["7", "07", "A"])
def test_a_number_or_a_letter_is_no_name_to_look_for(withdrawn, name):
    edit(withdrawn, "subjects.tsv", "S02\t", f"{name}\t")
    edit(withdrawn, "sequences.tsv", "\tS02\t", f"\t{name}\t")
    kept = noted(withdrawn, "results/evaluate/metrics.csv", params=[f"'{name}'"], shellcmd=f"dior x --width {name} ")
    forget.run(project=withdrawn, yes=True)
    assert kept.exists() and (withdrawn / "results/evaluate/metrics.csv").exists()


def test_files_that_name_a_person_are_told(withdrawn, capsys):
    path = withdrawn / "config/sessions/field/session.yaml"
    path.write_text(path.read_text() + "# S02 carried a stick\n")
    forget.run(project=withdrawn)
    assert "config/sessions/field/session.yaml" in capsys.readouterr().out.split("dior deletes none of these:")[1]


@pytest.mark.parametrize("name", ["S02", "7"])
def test_pictures_of_the_gallery_are_recordings_of_a_person_too(withdrawn, capsys, name):
    header = "subject\toutfit\tangle\tpath\tbag\ttopic\n"
    edit(withdrawn, "subjects.tsv", "S02\t", f"{name}\t")
    edit(withdrawn, "sequences.tsv", "\tS02\t", f"\t{name}\t")
    rows = f"{name}\tcoat\tfrontal\tpics/b\t\t\nS01\tcoat\tfrontal\tpics/a\t\t\n"
    (withdrawn / "config/gallery.tsv").write_text(header + rows)
    for name in "ab":
        (withdrawn / "data/pics" / name).mkdir(parents=True)
    forget.run(project=withdrawn)
    named = capsys.readouterr().out.split("dior deletes none of these:")[1]
    assert "pics/b" in named and "pics/a" not in named


def test_nothing_is_forgotten_while_a_run_is_at_work(withdrawn, monkeypatch):
    before = present(withdrawn)
    monkeypatch.setattr(forget.running, "at_work", lambda folder: "process 7 is at work here")
    with pytest.raises(DiorError, match="process 7 is at work here; what it is making now would be deleted"):
        forget.run(project=withdrawn, yes=True)
    assert present(withdrawn) == before
