"""C3D, as `dior.ingest.c3d_check` asks about it and `dior.ingest.c3d_points` reads it.

INPUTS   a path. OUTPUTS: its `Capture`; POINT:Y_SCREEN says which axis points up on the screen (user guide of c3d.org),
         +Z in Vicon's files and +Y in those with Y up.
"""

from collections.abc import Sequence

from dior.arrays import AnyPath, Floats
from dior.formats import MocapFormat
from dior.ingest.c3d_check import layout
from dior.ingest.c3d_points import read_points
from dior.ingest.mocap_files.capture import Capture

DESCRIPTIONS = (
    MocapFormat(
        key="c3d",
        tool="C3D of Vicon, Qualisys, OptiTrack, ...",
        first_frame="of the header",
        unit="`POINT:UNITS`",
        up="`POINT:Y_SCREEN`, else Z",
        checked="header, parameters and the file's size agree on the frames and on what one holds; files of "
        "MIPS (SGI) computers are refused",
        sample="real: three of Vicon, `mocap/`; the others written here, from the user guide of c3d.org",
    ),
)


def read(path: AnyPath) -> Capture:
    """The content of a C3D. Raises ValueError where it is damaged."""
    about = layout(path)

    def points(index: Sequence[int]) -> Floats:
        xyz = read_points(path, index)
        if len(xyz) < about.frames:
            raise ValueError(
                f"ezc3d finds {len(xyz)} of its {about.frames} frames; POINT:FRAMES is wrong, so export it again"
            )
        return xyz[: about.frames]

    return Capture(about.labels, about.units, about.up, about.rate, about.first, about.frames, points)
