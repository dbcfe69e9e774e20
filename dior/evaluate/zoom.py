"""The centre of the long-range pictures, for a detector to try what it cannot on the whole ones (paper, section 4.2).

INPUTS   the sequence's `frames` table and its bags below data_root
OUTPUTS  <out>/frame_<frame>.png: the middle of every picture of one camera, a quarter of its width and height (320x180
         of 1280x720), pixel by pixel as recorded; nothing is enlarged or compressed again
         index CSV: `file,frame,stamp_ns,u_min,v_min,width,height`, where the piece lies in the recorded picture; beside
         the folder, in which a detector shall find nothing but pictures

A row of config/detectors.tsv with `zoom` 4 names a detector's output on these files; the frame is in the file name, as
every reader wants it. Pixel (0, 0) of the piece is the centre of its first pixel, as in the recorded picture, so that a
shift by whole pixels brings it back.
"""

from pathlib import Path

import numpy as np

from dior.errors import DiorError
from dior.ingest import bags as rosbag
from dior.tables import tables
from dior.tables.files import write_text, written_whole

ZOOM = 4  # a quarter of width and height (paper, section 4.2)
INDEX = ("file", "frame", "stamp_ns", "u_min", "v_min", "width", "height")


def run(*, sequence: str, camera: str, frames: Path, data_root: Path, out: Path, out_index: Path) -> None:
    """Write the centre of every picture of one camera. Raises DiorError for a camera without pictures."""
    import cv2

    pictures = tables.of_camera(tables.read(frames, "frames"), camera)
    if not len(pictures["frame"]):
        raise DiorError(f"{sequence}, {camera}: {frames} has no frame of this camera; is its name right?")
    lines = {}
    for row, picture in rosbag.read_pictures(pictures, data_root):
        u, v, width, height = window(picture.shape[1], picture.shape[0], ZOOM)
        frame = int(pictures["frame"][row])
        name = f"frame_{frame:06d}.png"
        piece = np.ascontiguousarray(picture[v : v + height, u : u + width])
        with written_whole(Path(out) / name) as part:
            part.write_bytes(cv2.imencode(".png", piece)[1].tobytes())
        lines[frame] = f"{name},{frame},{pictures['stamp_ns'][row]},{u},{v},{width},{height}"
    write_text(out_index, "\n".join([",".join(INDEX), *(lines[f] for f in sorted(lines))]) + "\n")


def window(width: int, height: int, zoom: int) -> tuple[int, int, int, int]:
    """(u, v, width, height) px of the central piece of a picture: its first pixel and its size; zoom 1 is all of it."""
    w, h = max(width // zoom, 1), max(height // zoom, 1)
    return (width - w) // 2, (height - h) // 2, w, h
