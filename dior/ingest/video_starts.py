"""What the metadata of the table `frames` say of cameras on videos: how well is known when they began.

INPUTS   files of the table `frames`, which video_frames.py writes
OUTPUTS  by camera what its stamps are by; how far off each other the clocks of a sequence may be
"""

import json
from typing import Any

import numpy as np

from dior.arrays import AnyPath
from dior.clocks import lag
from dior.tables import tables

METADATA = "videos"
# standard errors within which a start is looked for
MOST_SIGMAS = 3.0


def told(frames: AnyPath) -> dict[str, dict[str, Any]]:
    """By camera: source, start_sigma_s, apart_sigma_s, note (`video_stamps.VideoStamps`), tick_s, the step of times
    that are irregular, else 0, by_rate (`video_frames.Film`), and what is lost: (frame before, stamp_ns, reason)."""
    found: dict[str, dict[str, Any]] = json.loads(tables.metadata(frames).get(METADATA, "{}"))
    return found


def loose_s(frames: AnyPath, absolute: bool = False) -> float:
    """How far (s, either way) the clocks of a sequence may be off each other by the starts of its videos, or, where
    `absolute`, off the stamps of what is recorded besides; 0 where these are no worse than a bag's."""
    key = "start_sigma_s" if absolute else "apart_sigma_s"
    # of two cameras both may err
    sigmas = sorted((float(one[key]) for one in told(frames).values()), reverse=True)[: 1 if absolute else 2]
    return MOST_SIGMAS * float(np.sqrt(np.square(sigmas).sum()))


def search_s(frames: AnyPath, absolute: bool = False) -> float:
    """How far (s, either way) clocks are searched; `absolute` as of `loose_s`."""
    return max(lag.WINDOW_S, loose_s(frames, absolute))
