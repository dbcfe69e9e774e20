"""Detections of DeepLabCut, CSV.

INPUTS   three header rows (scorer, bodyparts, coords), or four for several people (scorer, individuals, bodyparts,
         coords), then a row per picture: its number, from 0, and x, y, likelihood of every part; pixels; an empty cell
         is missing (deeplabcut 3.0.2, pose_estimation_pytorch/apis/videos.py, create_df_from_prediction; the
         `_filtered.csv` of its filter are the same). The individual `single` holds the parts that nobody owns, which
         are not read.
OUTPUTS  `People`, of joints named as the parts are: what spells a joint of `dior.body.names` is that one
         (`dior.body.spellings`), another part is a joint of its own.
"""

import math
import re

import numpy as np

from dior.arrays import AnyPath, Floats
from dior.body.spellings import joint_of, tidy
from dior.errors import DiorError
from dior.formats import DetectionFormat, Sample
from dior.ingest.people import People, gathered
from dior.ingest.readers.common import INTERRUPTED
from dior.project.plain_text import check_delimiter, each_row

LEVELS = (["scorer", "bodyparts", "coords"], ["scorer", "individuals", "bodyparts", "coords"])
COORDS = ["x", "y", "likelihood"]
NOBODYS = "single"
# chosen: with fewer joints that have a known name nobody can be made of them
FEWEST = 4
# chosen: half an hour of pictures of several people
MOST_BYTES = 1 << 28
# chosen: seven people of 133 parts
MOST_CELLS = 3000
DESCRIPTIONS = (
    DetectionFormat(
        key="deeplabcut",
        tool="DeepLabCut, CSV of a video, `_filtered` too",
        file="the file",
        joints="any, by the names of the parts: formats.md, names of parts",
        frame="first column",
        score="`likelihood`",
        nobody="empty cells; a missing row: not run",
        refused="two parts of one joint; fewer than four parts that are joints of a person; individuals with different "
        "parts; tables of labelled pictures",
        samples=(
            Sample(
                "DeepLabCut CSV of 3 and 4 header rows",
                "one and two people, spellings of parts; real_outdoor (BODY_25B, ML Kit) written again: the same table",
                "written here; what `create_df_from_prediction` of deeplabcut 3.0.2 itself wrote was read as well",
            ),
        ),
    ),
)


def read(path: AnyPath) -> People:
    """All people of the file. Raises DiorError for rows that are not DeepLabCut's and for parts of no person."""
    rows = each_row(path, path, most_bytes=MOST_BYTES, most_cells=MOST_CELLS)
    header = []
    for _, cells in rows:
        check_delimiter(cells, f"{path} (a spreadsheet has saved it; give the file of DeepLabCut itself)")
        header.append(cells)
        if cells[0] == "coords":
            break
    levels = [cells[0] for cells in header]
    if levels not in LEVELS:
        raise DiorError(f"{path}: its header is {', '.join(levels)[:80]}, not {', '.join(LEVELS[0])}; {INTERRUPTED}")
    people, joints, place = _columns(header, path)
    frame: list[int] = []
    points: list[Floats] = []
    for line, cells in rows:
        where = f"{path}: line {line}"
        if len(cells) != len(header[0]):
            raise DiorError(f"{where} has {len(cells)} columns, not {len(header[0])}; {INTERRUPTED}")
        if not re.fullmatch(r"\d{1,18}", cells[0]):
            raise DiorError(f"{where} begins with '{cells[0]:.40}', which is no picture's number; is it of a video?")
        frame.append(int(cells[0]))
        try:
            points.append(np.array([float(cell) if cell else math.nan for cell in cells[1:]]))
        except ValueError as error:
            raise DiorError(f"{where} holds something that is no number ({error!s:.60}); {INTERRUPTED}") from None
    if not frame:
        raise DiorError(f"{path} is empty; run the detector")
    # x, y, likelihood stand side by side, so that the place of x is that of all
    whole = np.array(points)[:, place[..., None] + np.arange(3)].reshape(-1, len(joints), 3)
    return gathered(path, joints, np.repeat(frame, people), whole, frame)


def _columns(header: list[list[str]], path: AnyPath) -> tuple[int, tuple[str, ...], np.ndarray]:
    """(number of people, joints, where among the numbers of a row the x of each is (people, joints))."""
    if len({len(cells) for cells in header}) > 1 or header[-1][1:] != COORDS * (len(header[-1]) // 3):
        raise DiorError(f"{path}: the columns are not x, y, likelihood of every part; {INTERRUPTED}")
    parts = header[-2][1::3]
    owners = header[1][1::3] if len(header) == 4 else [""] * len(parts)
    of_people: dict[str, dict[str, int]] = {}
    for at, (owner, part) in enumerate(zip(owners, parts, strict=True)):
        if owner != NOBODYS:
            mine = of_people.setdefault(owner, {})
            joint = tidy(part)
            if not joint or joint in mine:
                raise DiorError(
                    f"{path}: two parts, one of them '{part:.40}', are both {joint or 'nameless'}; rename one"
                )
            mine[joint] = 3 * at
    columns = list(of_people.values())
    joints = tuple(columns[0]) if columns else ()
    if len({tuple(one) for one in columns}) > 1:
        raise DiorError(f"{path}: its individuals have different parts; give the file of one kind of individual")
    if sum(joint_of(joint) is not None for joint in joints) < FEWEST:
        raise DiorError(
            f"{path}: of its parts ({', '.join(parts)[:200]}) fewer than {FEWEST} are joints of a person as "
            "docs/formats.md names them; rename them in the header"
        )
    return len(columns), joints, np.array([list(one.values()) for one in columns])
