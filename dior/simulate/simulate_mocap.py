"""Write the C3D of one simulated indoor walk, as Vicon does.

INPUTS   the `simulate:` section and the sequence's name
OUTPUTS  below `out` (data_root): <sequence>/mocap.c3d
"""

from pathlib import Path
from typing import Any

import numpy as np

from dior.arrays import Bools
from dior.simulate import truth
from dior.simulate.motion import Motion, motion_of
from dior.simulate.runs import runs
from dior.simulate.settings import Sequence, Settings, from_dict, generator, sequence_named
from dior.tables.files import check_written, written_whole

# chosen: not 1, so that a reader that takes frame numbers for indices fails
FIRST_MOCAP_FRAME = 101


def run(*, settings: dict[str, Any], sequence: str, out: Path) -> None:
    """Write the C3D of one sequence below `out`. `settings` is the section as a dict."""
    capture = from_dict(settings)
    record(capture, sequence_named(capture, sequence), out)


def record(settings: Settings, walk: Sequence, out: Path) -> None:
    """The same of a walk."""
    write_c3d(out / walk.name / "mocap.c3d", settings, walk, motion_of(settings, walk))


def write_c3d(path: Path, settings: Settings, sequence: Sequence, motion: Motion) -> None:
    """Write the markers as Vicon does: mm, `<subject>:<label>`, the first frame not the first of the trial."""
    import ezc3d

    seconds = truth.mocap_seconds(settings)
    markers = motion.at(seconds)[1]
    noise = generator(settings, "mocap", sequence.name).standard_normal(markers.shape) * settings.mocap_noise_mm
    seen = motion.seen(seconds) & ~_gaps(settings, sequence, len(seconds), markers.shape[1])
    millimetres = np.where(seen[..., None], markers * 1000 + noise, np.nan)
    file = ezc3d.c3d()
    file["header"]["points"]["first_frame"] = FIRST_MOCAP_FRAME
    file["parameters"]["POINT"]["RATE"]["value"] = [settings.mocap_hz]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["POINT"]["LABELS"]["value"] = [f"{sequence.subject}:{name}" for name in motion.names]
    points = np.ones((4, *millimetres.shape[1::-1]))
    points[:3] = np.moveaxis(millimetres, -1, 0).swapaxes(1, 2)
    file["data"]["points"] = points
    least = 16 * millimetres[..., 0].size
    with written_whole(path, least) as part:
        file.write(str(part))
        check_written(part, least)


def _gaps(settings: Settings, sequence: Sequence, ticks: int, markers: int) -> Bools:
    """Where a marker is not seen by the motion capture, in runs: (ticks, markers) bool."""
    random = generator(settings, "gaps", sequence.name)
    lost = [runs(random, ticks, settings.mocap_gaps, settings.mocap_gap_ticks) >= 0 for _ in range(markers)]
    return np.stack(lost, axis=1)
