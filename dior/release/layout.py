"""The tables of a release and their places in its folder.

The card, Croissant and whoever reads a release go by this list; nothing else of the release knows a path twice.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import pyarrow as pa
import pyarrow.parquet as pq

from dior.arrays import Table
from dior.tables.schemas import VERSION


@dataclass(frozen=True)
class Part:
    """A table of the release: what it is called, its name in `dior.tables.schemas`, its file or files, what a row
    is."""

    name: str
    table: str
    path: str
    row: str

    @property
    def pattern(self) -> str:
        """The files as a glob relative to the release folder."""
        return f"{self.name}/*/*.parquet" if "/" in self.path else self.path


# the statuses of labels that lie in the picture, seen or hidden by the body
IN_PICTURE = ("ok", "occluded")
_RECORDING = "<subject>/<sequence>.<camera>.parquet"
_WALK = "<subject>/<sequence>.parquet"
PARTS = (
    Part("labels_2d", "labels_2d", f"labels_2d/{_RECORDING}", "frame and joint of a camera"),
    Part("skeletons_3d", "skeletons_3d", f"skeletons_3d/{_WALK}", "instant and joint"),
    Part("frames", "released_frames", f"frames/{_RECORDING}", "picture of a camera"),
    Part("detections", "released_detections", f"detections/{_RECORDING}", "frame and joint that a detector found"),
    Part("boxes", "released_boxes", f"boxes/{_RECORDING}", "box that a person drew around the subject"),
    Part("marks", "released_marks", f"marks/{_WALK}", "point that a person marked in a picture"),
    Part("gait", "gait_parameters", f"gait/{_WALK}", "parameter of the gait of a walk, and side"),
    Part("gait_events", "gait_events", f"gait_events/{_WALK}", "heel strike or toe off"),
    Part("gait_steps", "gait_steps", f"gait_steps/{_WALK}", "parameter of a step or stride"),
    Part("covers", "released_covers", f"covers/{_RECORDING}", "head, or something else, that is covered in a picture"),
    Part("cameras", "released_cameras", "cameras.parquet", "session and camera"),
    Part("camera_covariance", "camera_covariance", "camera_covariance.parquet", "pair of cameras of a session"),
    Part("clocks", "released_clocks", "clocks.parquet", "recording of a camera"),
    Part("lights", "released_lights", "lights.parquet", "red light that is about the labels of a camera or a walk"),
    Part("sequences", "sequences", "sequences.parquet", "walk"),
    Part("subjects", "subjects", "subjects.parquet", "person"),
    Part("splits", "splits", "splits.parquet", "recording of a camera and part of a split that it is in"),
    Part("gallery", "released_gallery", "gallery.parquet", "picture of a person from all around"),
)


def parts_of(folder: Path) -> list[Part]:
    """The parts that a release folder has files of."""
    return [part for part in PARTS if next(folder.glob(part.pattern), None)]


def rows_of(table: Table) -> list[dict[str, Any]]:
    """The rows of a table by its columns' names: plain numbers and words, arrays where a cell is one."""
    columns = [column.tolist() if column.ndim == 1 else column for column in table.values()]
    return [dict(zip(table, cells, strict=True)) for cells in zip(*columns, strict=True)]


def of_other_version(table: Path | BinaryIO) -> str:
    """What is wrong with the version of a release that `table` is of, as a sentence.

    "" where this dior knows it, and where the file does not say.
    """
    try:
        with pq.ParquetFile(table) as file:
            metadata = file.schema_arrow.metadata or {}
    except (pa.ArrowException, OSError, ValueError):
        return ""
    version = metadata.get(b"dior_table_version", VERSION.encode()).decode()
    if version == VERSION:
        return ""
    return f"its tables are of version '{version}', this dior knows {VERSION}; take the dior that made it"
