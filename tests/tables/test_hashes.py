import shutil

import pytest

from dior.tables import hashes as by_content


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A copy of the package that a test may edit."""
    shutil.copytree(by_content.PACKAGE, tmp_path / "dior", ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(by_content, "PACKAGE", tmp_path / "dior")
    yield tmp_path / "dior"
    clear()


STEPS = ("ingest.frames", "calibrate.align", "label.reproject", "report.report", "report.overlays", "release.package")


def clear():
    for function in (
        by_content.code_hash,
        by_content._path_of,
        by_content._imports,
        by_content._meaning,
        by_content._data_files,
    ):
        function.cache_clear()


def each():
    clear()
    return {name: by_content.code_hash(name) for name in STEPS}


def changed(before, after):
    return {name for name in before if before[name] != after[name]}


def edit(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def test_code_of_one_step_changes_that_step_only(package):
    before = each()
    edit(package / "label/reproject.py", '"missing_3d"', '"missing"')
    assert changed(before, each()) == {"label.reproject"}


def test_shared_code_changes_its_users_through_other_modules(package):
    before = each()
    edit(package / "geometry/multiview.py", "np.pi / 2", "np.pi / 3")
    assert changed(before, each()) == {"calibrate.align"}


@pytest.mark.slow
def test_comments_and_docstrings_change_nothing(package):
    before = each()
    path = package / "label/reproject.py"
    path.write_text(path.read_text().replace('"""2D labels', '"""Some labels') + "\n# a comment\n")
    assert changed(before, each()) == set()


@pytest.mark.slow
def test_a_template_changes_the_steps_that_name_it(package):
    before = each()
    edit(package / "report/templates/style.css", "{", "{ ")
    assert changed(before, each()) == {"report.report"}
    before = each()
    edit(package / "release/card.md.j2", "#", "##")
    assert changed(before, each()) == {"release.package"}


@pytest.mark.slow
def test_a_schemas_default_changes_the_steps_that_fill_it_in(package):
    before = each()
    edit(package / "project/schemas/camera.schema.yaml", "default: 0.05", "default: 0.5")
    assert "calibrate.align" in changed(before, each())
    assert "label.reproject" not in changed(before, each())


def test_a_file_written_again_in_a_folder_is_noticed(tmp_path):
    assert by_content.folder_state(tmp_path / "none") == ""
    (tmp_path / "a.json").write_text("1")
    before = by_content.folder_state(tmp_path)
    assert by_content.folder_state(tmp_path) == before
    (tmp_path / "a.json").write_text("22")
    assert by_content.folder_state(tmp_path) != before


def test_a_module_that_is_not_there_is_an_error():
    with pytest.raises(ValueError, match="dior.label.reprojekt"):
        by_content.code_hash("label.reprojekt")


def test_file_hash(tmp_path):
    (tmp_path / "a").write_bytes(b"abc")
    assert by_content.file_sha256(tmp_path / "a").startswith("ba7816bf8f01cfea")
