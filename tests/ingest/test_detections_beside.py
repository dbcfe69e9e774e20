"""Files of detections as other systems save and copy them: byte order marks, capitals, and what lies beside."""

import numpy as np
import pytest

from dior.errors import DiorError
from dior.ingest.readers import READERS
from dior.ingest.readers.recognise import recognise
from tests.ingest import formats
from tests.ingest.formats import WRITERS, scene
from tests.ingest.test_detections_formats import run

MARK = b"\xef\xbb\xbf"
FOLDERS = [formats.openpose, formats.pose2sim, formats.yolo, formats.yolo_json, formats.mmpose, formats.mediapipe_text]
each_writer = pytest.mark.parametrize("writer", WRITERS, ids=lambda writer: writer.__name__)
each_folder = pytest.mark.parametrize("writer", FOLDERS, ids=lambda writer: writer.__name__)


def written(folder, writer):
    """(path, its format, what is read of it)."""
    name, joints, *_ = WRITERS[writer]
    path = writer(folder, scene(len(joints)))
    return path, name, READERS[name].read(path)


def is_read_as(path, name, before):
    assert recognise(path) == name
    now = READERS[name].read(path)
    np.testing.assert_array_equal(now.uv, before.uv)
    np.testing.assert_array_equal(now.ran, before.ran)


@each_writer
def test_a_byte_order_mark(tmp_path, writer):
    path, name, before = written(tmp_path, writer)
    for file in sorted(path.iterdir()) if path.is_dir() else [path]:
        file.write_bytes(MARK + file.read_bytes())
    is_read_as(path, name, before)


@each_writer
def test_utf_16_is_refused(tmp_path, writer):
    path, _, _ = written(tmp_path, writer)
    for file in sorted(path.iterdir()) if path.is_dir() else [path]:
        file.write_bytes(file.read_text().encode("utf-16"))
    with pytest.raises(DiorError, match="is UTF-16, as Excel's 'Unicode text' is; save it again as UTF-8"):
        run(tmp_path, path)


@each_folder
def test_what_systems_and_tools_put_beside(tmp_path, writer):
    path, name, before = written(tmp_path, writer)
    for file in sorted(path.iterdir()):
        (path / f"._{file.name}").write_bytes(b"\0\5\x16\7\0")
    for other in (".DS_Store", "Thumbs.db", "desktop.ini"):
        (path / other).write_bytes(b"\0\0\0\1Bud1")
    if name == "yolo":
        (path / "classes.txt").write_text("person\n")
    is_read_as(path, name, before)


@each_folder
def test_endings_in_capitals(tmp_path, writer):
    path, name, before = written(tmp_path, writer)
    for file in sorted(path.iterdir()):
        file.rename(file.with_suffix(file.suffix.upper()))
    is_read_as(path, name, before)


def test_a_folder_of_other_files_is_not_empty(tmp_path):
    (tmp_path / "op").mkdir()
    (tmp_path / "op" / "walk.mp4").write_bytes(b"x")
    with pytest.raises(DiorError, match=r"op holds walk\.mp4 and no file that ends in \.json, .*; name the folder of"):
        run(tmp_path, tmp_path / "op")


@each_folder
@pytest.mark.parametrize("name", ["config.json", "a_meta.json", "zz.txt"])
def test_a_file_without_a_number_beside_the_pictures(tmp_path, writer, name):
    path, kind, before = written(tmp_path, writer)
    (path / name).write_text('{"model": "rtmpose"}')
    is_read_as(path, kind, before)
