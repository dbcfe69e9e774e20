import shutil

import pytest

from dior import provenance


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A copy of the package that a test may edit."""
    shutil.copytree(provenance.PACKAGE, tmp_path / "dior", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(provenance.PACKAGE.parent / "workflow", tmp_path / "workflow")
    monkeypatch.setattr(provenance, "PACKAGE", tmp_path / "dior")
    yield tmp_path / "dior"
    clear()


STEPS = ("ingest.frames", "calibrate.align", "label.reproject", "report.page", "report.overlays", "release.package")


def clear():
    for function in (
        provenance.code_hash,
        provenance._path_of,
        provenance._imports,
        provenance._meaning,
        provenance._data_files,
    ):
        function.cache_clear()


def hashes():
    clear()
    return {name: provenance.code_hash(name) for name in STEPS}


def changed(before, after):
    return {name for name in before if before[name] != after[name]}


def edit(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def test_code_of_one_step_changes_that_step_only(package):
    before = hashes()
    edit(package / "label/reproject.py", '"missing_3d"', '"missing"')
    assert changed(before, hashes()) == {"label.reproject"}


def test_shared_code_changes_its_users_through_other_modules(package):
    before = hashes()
    edit(package / "geometry.py", "np.pi / 2", "np.pi / 3")
    assert changed(before, hashes()) == {"calibrate.align"}


@pytest.mark.slow
def test_comments_and_docstrings_change_nothing(package):
    before = hashes()
    path = package / "label/reproject.py"
    path.write_text(path.read_text().replace('"""2D labels', '"""Some labels') + "\n# a comment\n")
    assert changed(before, hashes()) == set()


@pytest.mark.slow
def test_a_template_changes_the_steps_that_name_it(package):
    before = hashes()
    edit(package / "report/templates/style.css", "{", "{ ")
    assert changed(before, hashes()) == {"report.page"}
    before = hashes()
    edit(package / "release/card.md.j2", "#", "##")
    assert changed(before, hashes()) == {"release.package"}


@pytest.mark.slow
def test_a_schemas_default_changes_the_steps_that_fill_it_in(package):
    before = hashes()
    edit(package.parent / "workflow/schemas/camera.schema.yaml", "default: 0.05", "default: 0.5")
    assert "calibrate.align" in changed(before, hashes())
    assert "label.reproject" not in changed(before, hashes())


def test_a_file_written_again_in_a_folder_is_noticed(tmp_path):
    assert provenance.folder_state(tmp_path / "none") == ""
    (tmp_path / "a.json").write_text("1")
    before = provenance.folder_state(tmp_path)
    assert provenance.folder_state(tmp_path) == before
    (tmp_path / "a.json").write_text("22")
    assert provenance.folder_state(tmp_path) != before


def test_a_module_that_is_not_there_is_an_error():
    with pytest.raises(ValueError, match="dior.label.reprojekt"):
        provenance.code_hash("label.reprojekt")


def test_file_hash(tmp_path):
    (tmp_path / "a").write_bytes(b"abc")
    assert provenance.file_sha256(tmp_path / "a").startswith("ba7816bf8f01cfea")
