"""Single pictures of a recording as a browser takes them: the recorded JPEG as it is, or a small one of it."""

from collections import OrderedDict
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dior.errors import DiorError
from dior.ingest import bags, jpeg, messages
from dior.studio.workspace import Workspace
from dior.tables import tables

PNG = b"\x89PNG"
# how the content of the segment begins (CIPA DC-008, 4.5.4)
EXIF = b"Exif\0\0"
# bytes of pictures that are kept; chosen: some hundred, for who goes back and forth
MOST_KEPT = 64 << 20
# chosen: raw pictures are compressed so that a marker of 2 px stays where it is, small ones so that a slow line has
# some each second
QUALITY, SMALL_QUALITY = 95, 60
SMALL_PX = 480  # chosen: width of the pictures that are shown while one moves through the recording


class Pictures:
    """Reads pictures of a `Workspace`, and keeps the last ones."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace, self._size, self._lock = workspace, 0, Lock()
        # each with the table that it was found by: a recording that is another by now has another
        self._kept = OrderedDict[tuple[object, ...], tuple[tables.Table, bytes]]()

    def read(self, walk: str, camera: str, frame: int, small: bool = False) -> bytes:
        """A JPEG, or a PNG where that is what was recorded; `small`: SMALL_PX wide at most.

        Raises DiorError for a frame that is not there and a picture that cannot be read.
        """
        table = self.workspace.frames_with(walk, camera, frame)
        key = walk, camera, frame, small
        with self._lock:
            if key in self._kept and self._kept[key][0] is table:
                self._kept.move_to_end(key)
                return self._kept[key][1]
        rows = tables.rows(table, np.array([frame]))
        _, message, path = next(bags.read_messages(rows, self.workspace.project().data_root))
        try:
            found = _small(message, rows) if small else _whole(message, rows)
        except bags.BROKEN as error:
            raise DiorError(f"{path}: frame {frame} of {camera} cannot be decoded ({error})") from None
        with self._lock:
            # another request may have read the same meanwhile
            self._size += len(found) - len(self._kept.get(key, (table, b""))[1])
            self._kept[key] = table, found
            while self._size > MOST_KEPT:
                self._size -= len(self._kept.popitem(last=False)[1][1])
        return found


def kind_of(picture: bytes) -> str:
    """The media type of what `Pictures.read` gives."""
    return "image/png" if picture.startswith(PNG) else "image/jpeg"


def _whole(message: bags.Message, rows: tables.Table) -> bytes:
    recorded = messages.compressed(message.kind, message.raw, message.wire)
    if recorded is not None and (recorded.startswith(PNG) or recorded.startswith(jpeg.SOI)):
        return _as_decoded(recorded)
    return _encoded(messages.decode(message.kind, message.raw, message.wire, _size(rows)), QUALITY)


def _as_decoded(recorded: bytes) -> bytes:
    """A picture's file without its Exif data: a browser turns it by these, and pixels are as decoded."""
    try:
        head = [bytes(segment) for _, segment in jpeg.before_data(recorded)]
    except ValueError:
        return recorded  # a PNG, or damaged before its first pixel
    # fill bytes may come before a segment's marker; its length has two bytes
    kept = [segment for segment in head if not segment.lstrip(b"\xff")[3:].startswith(EXIF)]
    return b"".join([jpeg.SOI, *kept, recorded[len(jpeg.SOI) + sum(map(len, head)) :]])


def _small(message: bags.Message, rows: tables.Table) -> bytes:
    import cv2

    height, width = _size(rows)
    factor = next((one for one in (8, 4, 2) if width >= one * SMALL_PX), 1)
    picture: NDArray[Any] | None = None
    if factor > 1:
        picture = messages.small_jpeg(message.kind, message.raw, message.wire, (height, width), factor)
    if picture is None:
        picture = messages.decode(message.kind, message.raw, message.wire, (height, width))
    if picture.shape[1] > SMALL_PX:
        size = SMALL_PX, max(1, round(picture.shape[0] * SMALL_PX / picture.shape[1]))
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return _encoded(picture, SMALL_QUALITY)


def _size(rows: tables.Table) -> tuple[int, int]:
    return int(rows["height"][0]), int(rows["width"][0])


def _encoded(picture: NDArray[Any], quality: int) -> bytes:
    import cv2

    done, found = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise DiorError("a picture could not be written as JPEG")
    return found.tobytes()
