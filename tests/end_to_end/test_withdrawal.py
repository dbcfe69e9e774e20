"""Somebody withdraws: nothing is left of the person, and everything else is as if that one had never come.

The search decodes every table, JSON, tar member, picture and page, and is first seen to find what is there.
"""

import re
import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from dior.cli import main
from dior.project import project, secret
from dior.tables import tables
from tests.end_to_end import lab
from tests.end_to_end.search import holding
from tests.end_to_end.workflow import planned, snakemake

pytestmark = pytest.mark.slow

GONE, WALKS = "Lindqvist", ("hall_quartz", "lawn_quartz")
RELEASED = Path("results/release")
# what others get to see
SHOWN = ("results/release", "results/report", "results/evaluate/metrics.csv", "results/evaluate/statistics.csv")
# what people wrote and recorded; of all else nothing may tell who somebody is
THEIRS = ("config", "recordings")
# exports of the part of the split in which there was nobody else
EMPTIED = ("coco/person_keypoints_val.json", "gaitgraph/dior_pose_valid.csv")
ALONE_IN = {f"dior-0.1.0-exports/{name}" for name in EMPTIED}
# a hash of session.yaml, which a person edits, is in the one, and of that file in the others
TELLS_THE_CONFIG = ("provenance.json", "SHA256SUMS", ".tar")


@pytest.fixture(scope="module")
def before(tmp_path_factory):
    """A finished run with a release of three people."""
    folder = tmp_path_factory.mktemp("lab") / "gait"
    with pytest.MonkeyPatch.context() as monkeypatch:
        lab.write(folder, monkeypatch)
    sheet = folder / "config/subjects.tsv"
    # a height that is found nowhere by chance
    sheet.write_text(re.sub(rf"(?m)^({GONE}\t.+?\t\d\.\d+)", r"\g<1>0137", sheet.read_text()))
    snakemake(folder)
    snakemake(folder, "release")
    return folder


@pytest.fixture(scope="module")
def after(before, tmp_path_factory):
    """The same when one has withdrawn and it has run again; and what that run said."""
    folder = tmp_path_factory.mktemp("withdrawn") / "gait"
    shutil.copytree(before, folder, symlinks=True)
    refuse(folder)
    _, text = snakemake(folder)
    return folder, text


def pseudonym(folder):
    line = next(line for line in (folder / "config/subjects.tsv").open() if line.startswith(GONE))
    return line.split("\t")[1]


def height(folder):
    line = next(line for line in (folder / "config/subjects.tsv").open() if line.startswith(GONE))
    return line.split("\t")[2]


def made(folder, words):
    """(word, where) of what the workflow and Snakemake have made."""
    entries = [entry for entry in sorted(folder.iterdir()) if entry.name not in THEIRS]
    return [(word, f"{entry.name}/{where}") for entry in entries for word, where in holding(entry, words)]


def refuse(folder):
    """Write into the sheet that the person may not be processed."""
    sheet = folder / "config/subjects.tsv"
    lines = sheet.read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith(GONE))
    lines[at] = lines[at].replace("\tyes\tyes", "\tno\tyes")
    sheet.write_text("\n".join(lines) + "\n")


def release(folder):
    (found,) = [path for path in (folder / RELEASED).glob("dior-*") if (path / "sequences.parquet").is_file()]
    return found


def test_the_search_finds_who_is_there(before):
    """Else it would prove nothing: in tables, packed and not, in pages, and in tables of figures."""
    who = pseudonym(before)
    found = Counter(word for word, _ in holding(before / RELEASED, [who, *WALKS]))
    assert set(found) == {who, *WALKS} and min(found.values()) > 8
    places = {where for _, where in holding(before / RELEASED, [who])}
    assert {"subjects.parquet", "sequences.parquet", "metrics.csv"} <= {Path(place).name for place in places}
    assert [place for place in places if ".tar: " in place and place.endswith(".parquet")]
    assert {"index.html", f"{WALKS[1]}.html"} <= {Path(p).name for _, p in holding(before / "results/report", WALKS)}
    assert {word for word, _ in holding(before / lab.DATA, lab.MACHINE)} == {word.lower() for word in lab.MACHINE}


def test_names_and_heights_stay_in_the_sheet(before):
    """Names in nothing that is made; heights, with the pseudonym, in what is published of them and nowhere else."""
    assert made(before, lab.PEOPLE.values()) == []
    told = {where for _, where in made(before, [height(before)])}
    assert told and all(where.startswith("results/release/") for where in told)
    assert made(before, [pseudonym(before)])


def test_what_is_not_in_the_parameters_is_noticed_when_it_changes(before, tmp_path):
    """A height re-runs the adjustment and the release, a pseudonym what is made of that person; a lost key the same as
    another height, and what counts the rows.
    """
    folder = tmp_path / "gait"
    shutil.copytree(before, folder, symlinks=True)
    assert planned(folder, "release") == {}
    sheet = folder / "config/subjects.tsv"
    text = sheet.read_text()
    sheet.write_text(text.replace(height(folder), "1.72"))
    jobs = planned(folder, "release")
    assert {"adjust", "package"} <= jobs.keys() and not {"mocap", "frames", "detections", "locate"} & jobs.keys()
    sheet.write_text(text.replace(pseudonym(folder), "violet-0007"))
    jobs = planned(folder, "release")
    # outdoors all walks share the cameras, which are adjusted with that person's walk, too
    assert (jobs["mocap"], jobs["triangulate"]) == (1, 3) and {"reproject", "package", "tarballs"} <= jobs.keys()
    sheet.write_text(text)
    (folder / secret.FILE).unlink()
    jobs = planned(folder, "release")
    assert {"adjust", "package"} <= jobs.keys() and not {"mocap", "frames", "detections", "locate"} & jobs.keys()
    assert not (folder / secret.FILE).exists(), "a dry run writes nothing"


def test_no_name_of_a_person_machine_or_folder_is_in_the_release(before):
    words = [*lab.PEOPLE.values(), *lab.MACHINE, "recordings/", str(before), before.parent.name]
    assert holding(before / RELEASED, words) == []


def test_nothing_is_left_of_who_withdrew(after):
    folder, _ = after
    for shown in SHOWN:
        assert holding(folder / shown, [GONE, pseudonym(folder), *WALKS, "quartz"]) == []


def test_the_run_says_what_is_left_elsewhere(after):
    folder, text = after
    assert "files and folders of sequences or people that the project no longer has: `dior forget`" in text
    page = (folder / "results/report/index.html").read_text()
    assert "1 window of the adjustment is not used: no consent" in page
    assert "1 sequence of align.sequences is not used: no consent" in page


def test_everything_of_the_others_is_still_there(before, after):
    folder, _ = after
    gone = {pseudonym(folder), *WALKS}
    files = {str(path.relative_to(before / RELEASED)) for path in (before / RELEASED).rglob("*") if path.is_file()}
    kept = {name for name in files - ALONE_IN if not any(word in name for word in gone)}
    assert len(files) > len(kept) > 30 and files > ALONE_IN
    assert {str(p.relative_to(folder / RELEASED)) for p in (folder / RELEASED).rglob("*") if p.is_file()} == kept
    for name in sorted(kept):
        if "labels_2d/" in name and name.endswith(".parquet"):
            old, new = (tables.read(root / RELEASED / name, "labels_2d") for root in (before, folder))
            assert (old["frame"] == new["frame"]).all() and (old["joint"] == new["joint"]).all()
            assert np.isfinite(new["u"]).mean() > 0.8


def test_the_cameras_that_were_moved_by_the_walk_are_made_anew(before, after):
    """The lawn's cameras were adjusted with it; the hall's were not, so that their labels are the same bytes."""
    folder, _ = after
    for path in sorted(release(before).glob("labels_2d/*/*.parquet")):
        new = release(folder) / path.relative_to(release(before))
        if path.name.startswith(WALKS):
            continue
        assert (new.read_bytes() == path.read_bytes()) == path.name.startswith("hall"), path.name
    assert list(project.load(folder).window("field")) == ["lawn_basalt", "lawn_marble"]


def test_it_is_as_if_that_one_had_never_come(after, tmp_path):
    """A project without the rows, run from nothing, gives the same files but for what hashes the config."""
    folder, _ = after
    fresh = tmp_path / "gait"
    shutil.copytree(folder / "config", fresh / "config")
    (fresh / lab.DATA).parent.mkdir()
    (fresh / lab.DATA).symlink_to(folder / lab.DATA)
    for path in sorted((fresh / "config").rglob("*")):
        if any(word in path.name for word in WALKS):
            path.unlink()
        elif path.is_file():
            text = path.read_text().replace("sequences: [lawn_basalt, lawn_quartz]", "sequences: [lawn_basalt]")
            lines = text.splitlines(keepends=True)
            path.write_text("".join(line for line in lines if GONE not in line and "quartz" not in line))
    snakemake(fresh, "release")
    for path in sorted((fresh / RELEASED).rglob("*")):
        if path.is_file() and not path.name.endswith(TELLS_THE_CONFIG):
            same = folder / RELEASED / path.relative_to(fresh / RELEASED)
            assert same.read_bytes() == path.read_bytes(), path.relative_to(fresh)


def test_who_never_agreed_is_nowhere(before, tmp_path):
    """A project with the rows and all hand-made files of somebody who may not be processed, from the first run on."""
    folder = tmp_path / "gait"
    shutil.copytree(before / "config", folder / "config")
    (folder / lab.DATA).parent.mkdir()
    (folder / lab.DATA).symlink_to(before / lab.DATA)
    refuse(folder)
    snakemake(folder, "release")
    assert made(folder, [GONE, pseudonym(folder), height(folder), *WALKS, "quartz"]) == []


def test_what_else_is_left_is_deleted_on_demand(after, tmp_path, capsys):
    """And nothing is made again that was not about the person."""
    folder = tmp_path / "gait"
    shutil.copytree(after[0], folder, symlinks=True)
    words = [GONE, pseudonym(folder), height(folder), *WALKS, "quartz"]
    left = {where.split("/")[1] for word, where in made(folder, words) if where.startswith("results/")}
    assert {"frames", "reproject", "evaluate"} <= left
    assert {where.split("/")[0] for _, where in made(folder, words)} == {"results", "logs", ".snakemake"}
    assert main.main(["forget", "--project", str(folder), "--yes"]) == 0
    assert "config/boxes/lawn_quartz.cam04.csv" in capsys.readouterr().out
    assert made(folder, words) == []
    assert planned(folder) == planned(folder, "release") == {}
