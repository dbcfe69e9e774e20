"""`dior assess`: how far 2D and 3D of somebody else's dataset are apart in time and space, camera by camera.

INPUTS   a folder with calibration, 2D keypoints and, if there is, 3D in any format that is read; or a release of dior
OUTPUT   text, or JSON; a CSV file where asked for. For each camera: offset and drift of its pictures, how far the 2D
         lies beside the 3D, focal length and k1, with 95 % intervals with the cameras as given; for each recording a
         verdict in one sentence. Exit code 0 where it could be assessed, whatever it says; 1 where nothing could be.
"""

import json
from pathlib import Path

from dior.assess import dataset, judge, told
from dior.errors import DiorError
from dior.tables.files import write_text


def run(
    folder: Path, *, calibration: Path | None = None, fps: float = 0.0, as_json: bool = False, csv: Path | None = None
) -> int:
    """Print how far 2D and 3D of a dataset are apart, and what is wrong; returns the exit code.

    `folder`: the dataset, a release of dior or a folder with files of other tools; `calibration`: the file to take
    where there are several; `fps`: pictures per second, where no file says it; `as_json`: print JSON instead of text;
    `csv`: file to write, a row for each camera of each recording.

    Raises DiorError where nothing can be assessed.
    """
    found = [judge.judged(recording) for recording in dataset.read(folder, calibration, fps)]
    print(
        json.dumps([told.as_dict(one) for one in found], indent=1, ensure_ascii=False)
        if as_json
        else told.as_text(found)
    )
    if csv is not None:
        write_text(csv, told.as_csv(found))
    if not any(one.told for one in found):
        raise DiorError(f"{folder}: nothing can be told of any recording; the text says why")
    return 0
