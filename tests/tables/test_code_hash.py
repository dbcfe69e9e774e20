import json
import shutil
from functools import _lru_cache_wrapper, cache

import pytest

from benchmarks import reruns
from dior.project.steps import MODULES
from dior.tables import code_hash as by_content
from tests.cases import slow


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A copy of the package that a test may edit."""
    shutil.copytree(by_content.PACKAGE, tmp_path / "dior", ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(by_content, "PACKAGE", tmp_path / "dior")
    yield tmp_path / "dior"
    clear()


def clear():
    """Forget what was read of the package, but not what a text means."""
    for cached in vars(by_content).values():
        if isinstance(cached, _lru_cache_wrapper) and cached is not by_content._kept:
            cached.cache_clear()


@cache
def unedited():
    """The hashes of all steps before anything is edited; where the package lies does not change them."""
    return each()


def each(steps=tuple(MODULES)):
    clear()
    return {step: by_content.code_hash(MODULES[step]) for step in steps}


def changed(before, after):
    return {name for name in before if before[name] != after[name]}


def edit(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def test_code_of_one_step_changes_that_step_only(package):
    before = unedited()
    edit(package / "calibrate/align.py", "import numpy as np", "import numpy as np\n\nNEW = 1")
    assert changed(before, each()) == {"align"}


def test_shared_code_changes_its_users_through_other_modules(package):
    before = unedited()
    edit(package / "geometry/tape.py", "import numpy as np", "import numpy as np\n\nNEW = 1")
    assert changed(before, each()) == {"locate", "place", "reference", "adjust", "align"}


def test_comments_and_docstrings_change_nothing(package):
    before = unedited()
    path = package / "label/reproject.py"
    path.write_text(path.read_text().replace('"""2D labels', '"""Some labels') + "\n# a comment\n")
    assert path.read_text() != (reruns.DOCS.parents[1] / "dior/label/reproject.py").read_text()
    assert changed(before, each()) == set()


def test_a_comma_in_the_description_of_a_column_changes_only_what_shows_it(package):
    """The report tells what metrics are, the card and Croissant of the release what columns are."""
    before = unedited()
    for stage, old in (("ingest", "file, relative to data_root"), ("evaluate", "marked by hand")):
        edit(package / f"tables/schemas/{stage}.py", old, f"{old},")
    assert changed(before, each()) == {"report", "package"}


def test_the_columns_of_a_table_change_those_who_write_and_read_it(package):
    users = {"moved", "report", "package"}
    before = unedited()
    for old, new in (
        ('("turn_x", "float64"', '("turn_x", "float32"'),
        ('"turn_y", ', '"turn_v", '),
        ('"deg"', '"rad"'),
    ):
        edit(package / "tables/schemas/calibrate.py", old, new)
        after = each()
        assert changed(before, after) == users, new
        before = after


def test_the_words_of_a_column_change_those_who_write_and_read_it(package):
    before = unedited()
    edit(package / "tables/schemas/ingest.py", '("reason", DROP_REASON', '("reason", (*DROP_REASON, "lens_cap")')
    assert changed(before, each()) == {"audit", "statistics", "page", "report", "package"}


def test_that_a_table_is_released_changes_who_writes_it(package):
    """Its files then tell the types of the columns to other libraries."""
    before = unedited()
    edit(package / "tables/schemas/release.py", '    "labels_2d",\n', "")
    assert "reproject" in changed(before, each())


def test_another_version_of_a_numeric_package_changes_every_step(monkeypatch):
    before = each()
    monkeypatch.setattr(by_content.metadata, "version", lambda package: "99" if package == "scipy" else "1")
    after = each()
    monkeypatch.setattr(by_content.metadata, "version", lambda package: "1")
    assert changed(before, after) == changed(after, each()) == set(MODULES)
    clear()


def test_a_package_that_is_not_everywhere_changes_the_steps_that_need_it(monkeypatch):
    before, version = each(), by_content.metadata.version

    def without(package):
        if package == "turbojpeg":
            raise by_content.metadata.PackageNotFoundError(package)
        return version(package)

    monkeypatch.setattr(by_content.metadata, "version", without)
    assert changed(before, each()) == {"pixels", "package"}
    clear()


def test_how_types_are_made_changes_every_step_with_a_table(package):
    before = unedited()
    edit(package / "tables/schemas/__init__.py", "pa.binary()", "pa.large_binary()")
    assert len(changed(before, each())) == 42


def test_the_steps_that_read_a_table_spell_its_name(package):
    """A step whose table is not found would not run again when its columns change."""
    clear()
    for step, table in (
        ("frames", "frames"), ("audit", "stamp_audit"), ("gallery", "gallery"), ("detections", "detections"),
        ("locate", "camera_covariance"), ("adjust", "cameras"), ("clocks", "offsets"), ("follow", "clock_gains"),
        ("timeline", "timeline"), ("refine", "skeletons_3d"), ("triangulate", "swaps"), ("reproject", "labels_2d"),
        ("moved", "camera_turns"), ("gait", "gait_events"), ("evaluate", "frame_metrics"),
        ("statistics", "dropped_frames"), ("metrics", "metrics"), ("heads", "heads"), ("pixels", "released_frames"),
        ("package", "released_cameras"),
        ("package", "released_marks"), ("exports", "splits"), ("simulate", "simulated_detections"),
    ):  # fmt: skip
        assert f"table {table}" in dict(by_content.covered(MODULES[step])), (step, table)


def test_a_template_changes_the_steps_that_name_it(package):
    before = unedited()
    edit(package / "report/templates/style.css", "{", "{ ")
    assert changed(before, each()) == {"page", "report", "reid"}
    before = each()
    edit(package / "release/card.md.j2", "#", "##")
    assert changed(before, each()) == {"package"}


def test_a_schemas_default_changes_the_steps_that_fill_it_in_and_a_description_none(package):
    before = unedited()
    edit(package / "project/schemas/camera.schema.yaml", "description: ", "description: Whatever ")
    after = each()
    assert changed(before, after) == set()
    edit(package / "project/schemas/camera.schema.yaml", "default: 0.05", "default: 0.5")
    assert "align" in changed(after, each())
    assert "reproject" not in changed(after, each())


def test_a_property_called_description_counts(tmp_path):
    schema = {"properties": {"description": {"type": "string", "description": "of the data"}}, "description": "all"}
    assert by_content._undescribed(schema) == {"properties": {"description": {"type": "string"}}}


def test_the_docs_say_what_a_change_re_runs():
    clear()
    written = reruns.DOCS.read_text(encoding="utf-8").partition(reruns.BEGIN)[2].partition(reruns.END)[0]
    said = "docs/architecture.md: run python -m benchmarks.reruns --write"
    assert written == reruns.table(reruns.steps_by_name()), said


def test_a_module_that_is_not_there_is_an_error():
    with pytest.raises(ValueError, match="dior.label.reprojekt"):
        by_content.code_hash("label.reprojekt")


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """The file that modules are kept in, in a folder of its own; nothing is known yet."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    by_content._kept.cache_clear()
    by_content._new.cache_clear()
    yield tmp_path / "dior/code.json"
    by_content._kept.cache_clear()
    by_content._new.cache_clear()


def started(monkeypatch):
    """The hashes of two steps as another process finds them, and how many modules it reads."""
    texts, read = [], by_content._read
    by_content._kept.cache_clear()
    with monkeypatch.context() as patched:
        patched.setattr(by_content, "_read", lambda text: texts.append(text) or read(text))
        found = each(("align", "frames"))
    by_content.keep()
    return found, len(texts)


def test_what_is_kept_is_not_read_again_but_what_changed(kept, package, monkeypatch):
    before, read = started(monkeypatch)
    assert read > 30 and started(monkeypatch) == (before, 0)
    edit(package / "calibrate/align.py", "import numpy as np", "import numpy as np\n\nNEW = 1")
    after, read = started(monkeypatch)
    assert read == 1 and changed(before, after) == {"align"}
    assert started(monkeypatch) == (after, 0)
    # another dior, or another Python, understands them anew
    monkeypatch.setattr(by_content, "_own_text", lambda: "# other")
    assert started(monkeypatch)[1] > 30


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: text[:-9],
        slow(lambda text: text.replace("a", "b", 1)),
        slow(lambda text: ""),
    ],
)
def test_what_is_kept_and_damaged_is_read_again(kept, monkeypatch, damage):
    before, read = started(monkeypatch)
    kept.write_text(damage(kept.read_text()))
    assert started(monkeypatch) == (before, read)
    assert started(monkeypatch) == (before, 0)


def test_where_nothing_can_be_kept_all_is_read(kept, tmp_path, monkeypatch):
    (tmp_path / "dior").write_text("no folder")
    before, read = started(monkeypatch)
    assert started(monkeypatch) == (before, read)


@pytest.mark.slow
def test_few_versions_are_kept(kept, monkeypatch):
    _, read = started(monkeypatch)
    monkeypatch.setattr(by_content, "_own_text", lambda: "# other")
    started(monkeypatch)
    assert len(json.loads(kept.read_text().partition("\n")[2])) == 2 * read
    monkeypatch.setattr(by_content, "KEPT", 2 * read)
    monkeypatch.setattr(by_content, "_own_text", lambda: "# a third")
    assert started(monkeypatch)[1] == read and started(monkeypatch)[1] == 0
    assert len(json.loads(kept.read_text().partition("\n")[2])) == read
