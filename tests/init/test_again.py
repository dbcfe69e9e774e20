"""`dior init` called again: what of the project, and of the recordings that its sheets name, is gone meanwhile."""

import shutil

import pytest

from dior.init import init
from tests.ingest.test_trigger_log import write as write_log
from tests.init import small
from tests.init.test_init import contents, made, rows_of_people, rows_of_text, yaml_of


def line(said, words):
    """The one line of what was printed in which some words are."""
    (found,) = [one for one in said.split("\n") if words in one]
    return found


def test_session_folders_and_cameras_that_are_gone_are_written_again(lab, capsys):
    folder, _ = made(lab)
    before = contents(folder)
    shutil.rmtree(folder / "config/sessions/outdoor")
    (folder / "config/sessions/indoor/cam01.yaml").unlink()
    _, said = made(lab, capsys, dry_run=True)
    assert not (folder / "config/sessions/outdoor").exists() and "sessions/indoor/cam01.yaml" in said
    _, said = made(lab, capsys)
    assert contents(folder) == before and "Nothing is new" not in said
    gone = line(said, "made anew")
    assert "config/sessions/outdoor/session.yaml" in gone and "config/sessions/indoor/cam01.yaml" in gone
    assert "indoor/cam02.yaml" not in gone
    assert "Nothing is new" in made(lab, capsys)[1]


def test_a_camera_alone_is_counted(lab, capsys):
    folder, _ = made(lab)
    (folder / "config/sessions/indoor/cam01.yaml").unlink()
    assert "Wrote 1 camera in" in made(lab, capsys)[1]


def test_what_a_person_changed_in_a_session_stays_and_no_camera_comes_back(lab, capsys):
    folder, _ = made(lab)
    session = folder / "config/sessions/outdoor/session.yaml"
    session.write_text(session.read_text().replace("cameras: [cam01, cam02, cam03]", "cameras: [left, cam02]"))
    for camera in ("cam01", "cam03"):
        (session.parent / f"{camera}.yaml").unlink()
    before = contents(folder)
    _, said = made(lab, capsys)
    assert contents(folder) == before and "Nothing is new" in said
    assert "take it from a backup, or take left out of config/sessions/outdoor/session.yaml" in line(said, "left.yaml")


def test_cameras_that_a_person_called_otherwise_keep_their_names(lab):
    folder, _ = made(lab)
    session = folder / "config/sessions/outdoor"
    (session / "cam01.yaml").rename(session / "left.yaml")
    (session / "session.yaml").unlink()
    made(lab)
    assert yaml_of(folder, "sessions/outdoor/session")["cameras"] == ["cam02", "cam03", "left"]
    assert not (session / "cam01.yaml").exists()


def test_walks_that_a_person_put_apart_have_each_its_session_back(lab):
    folder, _ = made(lab)
    sheet = folder / "config/sequences.tsv"
    sheet.write_text(sheet.read_text().replace("out_2\t2\tTODO\toutdoor\t", "out_2\t2\tTODO\tlawn\t"))
    (folder / "config/sessions/outdoor").rename(folder / "config/sessions/lawn")
    made(lab)
    assert list(yaml_of(folder, "sessions/outdoor/session")["adjust"]) == ["out_1"]
    shutil.rmtree(folder / "config/sessions/lawn")
    made(lab)
    assert list(yaml_of(folder, "sessions/lawn/session")["adjust"]) == ["out_2"]


def test_a_session_of_excluded_walks_stays_away(lab, capsys):
    folder, _ = made(lab)
    sheet = folder / "config/sequences.tsv"
    row = line(sheet.read_text(), "in_1/pc1.bag").split("\t")
    row[11] = "nobody wore the suit"
    sheet.write_text(sheet.read_text().replace(line(sheet.read_text(), "in_1/pc1.bag"), "\t".join(row)))
    shutil.rmtree(folder / "config/sessions/indoor")
    assert "Nothing is new" in made(lab, capsys)[1] and not (folder / "config/sessions/indoor").exists()


def test_a_session_of_which_nothing_is_left_is_named_and_its_name_not_given_away(lab, capsys):
    folder, _ = made(lab)
    for walk in ("out_1", "out_2"):
        shutil.rmtree(lab / "recordings" / walk)
    shutil.rmtree(folder / "config/sessions/outdoor")
    small.outdoor(lab / "recordings", "out_9", 10 * 86400)
    _, said = made(lab, capsys)
    gone = line(said, "outdoor/session.yaml is gone")
    assert "no recording of out_1 and out_2 tells its cameras" in gone
    assert rows_of_text(folder)["out_9"]["session"] == "outdoor_2"


def test_people_come_back_from_the_walks(lab):
    folder, _ = made(lab)
    sheet = folder / "config/sequences.tsv"
    sheet.write_text(sheet.read_text().replace("out_1\t1\tTODO", "out_1\t1\tP7"))
    (folder / "config/subjects.tsv").unlink()
    made(lab)
    assert list(rows_of_people(folder)) == ["Anna", "P7"]


def test_an_indoor_walk_without_its_motion_capture_stays_indoors(lab):
    folder, _ = made(lab)
    (lab / "recordings/in_1/trial.c3d").unlink()
    (folder / "config/sessions/indoor/cam01.yaml").unlink()
    made(lab)
    assert yaml_of(folder, "sessions/indoor/cam01")["locate"] == "marks"


def test_all_that_a_row_names_is_looked_for(lab, capsys):
    small.pictures(lab / "recordings/v", ("cam1", "cam2"))
    write_log(lab / "recordings/trigger.jsonl", ("start", "trial", 86400.5), ("stop", "trial", 86403.0))
    folder, _ = made(lab)
    assert rows_of_text(folder)["in_1"]["trigger_log"] == "trigger.jsonl"
    _, said = made(lab, capsys)
    assert "are gone" not in said
    for path in ("in_1/trial.c3d", "trigger.jsonl", "out_1/mlkit/cam02.jsonl", "out_1/mlkit/cam03.jsonl"):
        (lab / "recordings" / path).unlink()
    (lab / "recordings/out_1/pc2.bag").unlink()
    (lab / "recordings/out_1/pc2.bag").symlink_to("elsewhere.bag")
    shutil.rmtree(lab / "recordings/out_2/mlkit")
    shutil.rmtree(lab / "recordings/v/cam2")
    _, said = made(lab, capsys)
    assert line(said, "of in_1 are gone").endswith(": mocap in_1/trial.c3d, trigger_log trigger.jsonl")
    # nobody needs those of the far one
    assert line(said, "of out_1 are gone").endswith(
        ": bags out_1/pc2.bag (a link to nothing), detections out_1/mlkit/cam02.jsonl"
    )
    assert line(said, "of out_2 are gone").endswith(": detections out_2/mlkit/{camera}.jsonl")
    assert line(said, "of v are gone").endswith(": videos v/cam2")


def test_a_bag_that_came_later_is_told_and_its_cameras_are_written_where_they_are_listed(lab, capsys):
    for walk in ("out_1", "out_2"):
        shutil.move(lab / f"recordings/{walk}/pc2.bag", lab / f"{walk}.bag")
    folder, _ = made(lab)
    for walk in ("out_1", "out_2"):
        shutil.move(lab / f"{walk}.bag", lab / f"recordings/{walk}/pc2.bag")
    _, said = made(lab, capsys)
    assert "out_1/pc2.bag may be of out_1, too; put it into that row" in said and "Nothing is new" in said
    session, sheet = folder / "config/sessions/outdoor/session.yaml", folder / "config/sequences.tsv"
    session.write_text(session.read_text().replace("[cam01, cam02]", "[cam01, cam02, cam03]"))
    text = sheet.read_text()
    sheet.write_text(text.replace("\tout_1/pc1.bag", "\tout_1/pc1.bag;out_1/pc2.bag"))
    _, said = made(lab, capsys)
    assert "may be of out_1" not in said and "may be of out_2" in said
    assert yaml_of(folder, "sessions/outdoor/cam03")["topic"] == "/cam03/image_raw/compressed"


def test_links_to_recordings_of_the_sheet_are_these(lab, capsys):
    (lab / "links").mkdir()
    (lab / "links/w").symlink_to(lab / "recordings/out_1")
    init.run(lab / "project", as_from=lab / "links")
    sheet = lab / "project/config/sequences.tsv"
    assert "w/pc1.bag;w/pc2.bag" in sheet.read_text()
    capsys.readouterr()
    init.run(lab / "project", as_from=lab / "links")
    assert "Nothing is new" in capsys.readouterr().out


@pytest.mark.parametrize("form", ["absolute", "relative"])
def test_paths_with_signs_and_whole_paths_are_found(lab, capsys, form):
    shutil.move(lab / "recordings/out_1", lab / "recordings/out [1] *")
    folder, _ = made(lab)
    if form == "absolute":
        sheet = folder / "config/sequences.tsv"
        text = sheet.read_text().replace("\tout [1]", f"\t{lab}/recordings/out [1]")
        sheet.write_text(text.replace(";out [1]", f";{lab}/recordings/out [1]"))
    _, said = made(lab, capsys)
    assert "Nothing is new" in said and "are gone" not in said


def test_a_new_walk_is_of_the_session_of_the_walk_before_it(tmp_path, capsys):
    for i in range(4):
        small.outdoor(tmp_path / "recordings", f"out_{i}", 100 * i)
    folder, _ = made(tmp_path)
    sheet, sessions = folder / "config/sequences.tsv", folder / "config/sessions"
    sheet.write_text(sheet.read_text().replace("out_3\t4\tTODO\toutdoor", "out_3\t4\tTODO\tpark"))
    shutil.copytree(sessions / "outdoor", sessions / "park")
    small.outdoor(tmp_path / "recordings", "out_4", 400)
    _, said = made(tmp_path, capsys)
    assert rows_of_text(folder)["out_4"]["session"] == "park"
    assert line(said, "Look: out_4").endswith(
        "of outdoor and park, which have these cameras, session park is that of the walk before it."
    )
    assert "Look" not in made(tmp_path, capsys)[1]


def test_a_video_of_another_camera_and_time_is_a_walk_of_its_own(tmp_path, capsys):
    videofiles = pytest.importorskip("tests.ingest.videofiles")

    def film(path, hour):
        path.parent.mkdir(parents=True)
        pictures = [videofiles.numbered(i + hour) for i in range(30)]
        videofiles.write(path, pictures, metadata={"creation_time": f"2024-05-01T{hour}:00:00.000000Z"})

    film(tmp_path / "recordings/cam1/0001.mp4", 10)
    folder, _ = made(tmp_path)
    film(tmp_path / "recordings/cam2/0001.mp4", 12)
    made(tmp_path, capsys)
    before, found = contents(folder), rows_of_text(folder)
    assert [(name, row["videos"]) for name, row in found.items()] == [
        ("0001", "{camera}/0001.mp4"), ("0001_2", "{camera}/0001.mp4"),
    ]  # fmt: skip
    _, said = made(tmp_path, capsys)
    assert contents(folder) == before and [one.split()[0] for one in said.split("\n")[1:3]] == ["0001", "0001_2"]


def test_a_video_of_a_further_camera_of_a_walk_is_told(tmp_path, capsys):
    small.pictures(tmp_path / "recordings/w", ["cam1", "cam2"])
    folder, _ = made(tmp_path)
    small.pictures(tmp_path / "recordings/w", ["cam3"])
    _, said = made(tmp_path, capsys)
    assert "session.yaml lists no cam3, of which there is w/cam3; add it if it is to be labelled" in said
    session = folder / "config/sessions/outdoor/session.yaml"
    session.write_text(session.read_text().replace("cam2]", "cam2, cam3]"))
    _, said = made(tmp_path, capsys)
    assert "lists no" not in said and (session.parent / "cam3.yaml").exists()
