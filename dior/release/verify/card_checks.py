"""The picture on the card must be the one that the tables and pictures of the release give.

INPUTS   an `Evidence` (evidence.py). OUTPUTS: problems as (path, sentence)
It shows somebody, so that what is in no other file of the release must not be in it either. A release of an earlier
dior has none; so has one of which nothing may be shown.
"""

import numpy as np

from dior.arrays import Table
from dior.release import card_picture
from dior.release.verify import walk_checks
from dior.release.verify.evidence import Evidence
from dior.release.verify.walk_checks import PARTS, Problem

# grey levels in the mean; chosen: another OpenCV draws and packs the same picture with less
DIFFERENT = 4.0


def check(release: Evidence) -> list[Problem]:
    """Draw the picture anew and compare."""
    import cv2

    path = card_picture.FILE
    linked = f"]({path})".encode() in release.files["README.md"].read()
    if path not in release.files:
        return [("README.md", f"shows {path}, which is not in the release")] if linked else []
    data = release.files[path].read()
    try:
        walk_checks.jpeg_size(data)
    except ValueError as error:
        return [(path, str(error))]
    source = _source(release)
    chosen = card_picture.panels(source, release.tables["sequences"], release.tables["cameras"])
    if not chosen or release.rig.settings.get("release.faces") == "shown":
        return [(path, "shows somebody, and nothing in the release may be shown: no head is covered in a picture")]
    found = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    expected = card_picture.drawn(source, chosen)
    if found is None or found.shape != expected.shape or np.abs(found.astype(float) - expected).mean() > DIFFERENT:
        return [(path, "is not the picture that the pictures and labels of the release give")]
    return [] if linked else [("README.md", f"does not show {path}")]


def _source(release: Evidence) -> card_picture.Source:
    def table(path: str, part: str, columns: list[str]) -> Table:
        return walk_checks.read(release.files[path], PARTS[part], columns)[0]

    def picture(path: str, row: int) -> bytes:
        return next(data for number, data in walk_checks.pictures_in(release.files[path]) if number == row)

    return card_picture.Source(release.files, table, picture)
