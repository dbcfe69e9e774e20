"""The instants of a sequence and what each camera has to say at them.

INPUTS   frames (stamps), the cameras' clocks, the mocap table indoors
OUTPUTS  `timeline`: per instant and camera the frames before and after and the weight of the later one
Outdoors the instants are a regular grid at the nominal frame rate, indoors the C3D's own ticks.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dior.arrays import Ints, Table
from dior.clocks import clock as on_axis
from dior.clocks.axis import bracket, camera_seconds, instants, rates, start_ns
from dior.errors import DiorError, nearest
from dior.tables import tables


def instants_within(seconds: float, fps: float) -> int:
    """The most steps from one instant to another that take at most so many `seconds`.

    A rate that is read from stamps in whole nanoseconds may be a hundred-millionth low.
    """
    return int(seconds * fps + 1e-4)


def run(
    *,
    sequence: str,
    frames: Path,
    cameras: list[str],
    clocks: list[Path],
    mocap: Path | None,
    max_gap: float,
    out: Path,
) -> None:
    """Write the timeline of a sequence.

    `cameras`: those that take part; `clocks`: their tables `offsets`; `mocap`: the instants indoors, else None.
    """
    table, known = tables.read(frames, "frames"), on_axis.read(clocks)
    for camera in cameras:
        if camera not in known:
            where = ", ".join(map(str, clocks))
            raise DiorError(
                f"{sequence}: {where} has no clock of {camera}{nearest(camera, known)}; run the step clocks"
            )
    markers = tables.read(mocap, "skeletons_3d", ["joint", "instant", "stamp_ns"]) if mocap else None
    t0 = start_ns(table, markers)
    seconds = {
        camera: camera_seconds(table, camera, t0, (known[camera].offset_s, known[camera].drift_ppm))
        for camera in cameras
    }
    own, fps = rates(table, cameras)
    if markers:
        stamps = markers["stamp_ns"][markers["joint"] == markers["joint"][0]]
        grid = (stamps - t0) / 1e9
    else:
        grid = instants(fps, max(seconds[camera][-1] for camera in cameras))
        stamps = t0 + np.round(grid * 1e9).astype(np.int64)
    parts = [bracket(seconds[camera], grid, max_gap / own[camera]) for camera in cameras]
    each = len(cameras)
    tables.write(
        out,
        "timeline",
        {
            "instant": np.repeat(np.arange(len(grid)), each),
            "camera": tables.Repeated(cameras, np.tile(np.arange(each), len(grid))),
            "stamp_ns": np.repeat(stamps, each),
            "frame_before": np.stack([p[0] for p in parts], axis=1).ravel(),
            "frame_after": np.stack([p[1] for p in parts], axis=1).ravel(),
            "weight": np.stack([p[2] for p in parts], axis=1).ravel(),
        },
        {"fps": f"{fps:g}"},
    )


def stamps_of(timeline: Table) -> Ints:
    """The stamps (T,) ns of the instants of a `timeline`."""
    return timeline["stamp_ns"][:: len(tables.ordered_unique(timeline["camera"]))]


def rate(stamps_ns: Ints) -> float:
    """Instants per second."""
    return 1e9 / float(np.median(np.diff(stamps_ns))) if len(stamps_ns) > 1 else 1.0


def nearest_frames(timeline: Table, names: Sequence[str]) -> Ints:
    """The picture nearest to each instant by camera, (V, T); -1 where there is none."""
    lines = [tables.of_camera(timeline, name) for name in names]
    return np.stack([np.where(at["weight"] < 0.5, at["frame_before"], at["frame_after"]) for at in lines])
