"""The released pictures of one camera of a walk, the subject's head and what else moves covered.

INPUTS   the `frames` index, the bags below data_root, `heads` (where the head is, on a coarse grid), `other_covers`
OUTPUTS  `released_frames` table with the pictures as JPEG; `released_covers`: what is covered in them; findings
Nothing here looks at labels: as long as the boxes of `heads` stay, so do the pictures, byte by byte. A picture without
anything to cover is passed on as recorded; of one with covers only the blocks that these touch change (jpeg_covers.py).
What that cannot be done with is decoded, covered and encoded again by the recorder's own tables, at quality 95 what was
no JPEG. Only the picture's own segments are written: no EXIF, no comment, nothing after its end. A picture that cannot
be released is null and says why.
"""

import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow.parquet as pq

from dior.arrays import Bools, Floats, Ints, Table, Texts
from dior.errors import DiorError
from dior.ingest import bags, messages
from dior.ingest.containers import BROKEN
from dior.progress import reporting
from dior.release import head_blur, jpeg, jpeg_covers, shift_stamps
from dior.release.heads import EDGES
from dior.release.jpeg_covers import Cover
from dior.shortage import sentence
from dior.tables import tables
from dior.tables.files import written_whole

# Pictures that are in memory at once and make a row group. Chosen: more take memory, fewer make a
# longer footer.
GROUP = 200
IMAGE = ("image.bytes", "image.path")
# of the words of HEAD_STATUS, those of pictures that are released
RELEASED = ("ok", "out_of_frame")


def run(
    *,
    sequence: str,
    subject: str,
    camera: str,
    frames: Path,
    data_root: Path,
    heads: Path | None,
    covers: Path | None,
    faces: Literal["blurred", "filled", "pixelated", "shown"],
    consent: Literal["yes", "no"],
    shift: dict[str, Any],
    masks: list[Any],
    out: Path,
    out_covers: Path,
    findings: Path,
) -> None:
    """Write the released pictures of one camera of one sequence.

    `subject`: the pseudonym. `heads`: its table, None where faces are `shown`; `covers`: table `other_covers` of what
    else is to be covered, None likewise; `out_covers`: table `released_covers` to write. `consent`: "yes", or "no" for
    a subject who did not agree to pictures, of which all are null then. `shift`: arguments of `shift_stamps.shift_ns`,
    empty to leave the stamps as they are. `masks`: rectangles (u_min, v_min, u_max, v_max) px that are covered in all
    pictures, whatever `faces` says. Raises DiorError where `heads` is of other pictures, and where a picture is
    not in its bag any more.
    """
    import cv2

    cv2.setNumThreads(1)
    where = f"{sequence}, camera {camera}"
    rows = tables.of_camera(tables.read(frames, "frames"), camera)
    count = len(rows["frame"])
    covered = faces != "shown" and consent == "yes"
    if covered and (heads is None or covers is None):
        raise DiorError(f"{where}: faces are to be {faces}, but no table of heads is given; run heads first")
    boxes: list[Floats | None] = [None] * count
    withheld = [""] * count
    if heads and covered:
        boxes, withheld = _boxes(heads, rows, where)
    others = _others(covers, rows) if covers and covered else [[]] * count
    if consent == "yes" and count:
        always = masked(masks, (rows["height"][0], rows["width"][0]), where)
        others = [[*always, *each] for each in others]
    shown = np.zeros(count, bool)
    later = shift_stamps.shift_ns(**shift) if shift else 0
    words = {"subject": subject, "sequence": sequence, "camera": camera}
    lost: Counter[str] = Counter()
    why: list[tuple[int, str]] = []
    with written_whole(out) as part, _writer(part) as writer:
        done = reporting(_groups(count), -(-count // GROUP), f"groups of {GROUP} pictures", where)
        for group in done:
            mine = tables.rows(rows, group)
            pictures, reasons = _pictures(
                mine, [boxes[i] for i in group], [others[i] for i in group], [withheld[i] for i in group], data_root,
                faces, consent, why,
            )  # fmt: skip
            shown[group] = [picture is not None for picture in pictures]
            lost.update(reasons)
            once = np.zeros(len(group), int)
            columns: dict[str, tables.Column] = {
                **{name: tables.Repeated([word], once) for name, word in words.items()},
                **{name: mine[name] for name in ("frame", "height", "width")},
                "stamp_ns": mine["stamp_ns"] - later,
                "image": pictures,
                "no_image": reasons,
            }
            writer.write_table(tables.to_arrow("released_frames", columns))
    tables.write(out_covers, "released_covers", _named(words, _released_covers(rows, later, boxes, others, shown)))
    found = _findings(f"{sequence}/{camera}", lost["not_readable"], count, why)
    for _, severity, _, text in found:
        print(f"{where}: {severity}: {text}", file=sys.stderr)
    tables.write_findings(findings, found)


def _groups(count: int) -> Iterator[Ints]:
    return (np.arange(start, min(start + GROUP, count)) for start in range(0, count, GROUP))


def _boxes(heads: Path, rows: Table, where: str) -> tuple[list[Floats | None], list[str]]:
    """Of each picture the edges (4,) of the box to cover, None for no head, and the word of NO_IMAGE why it is not
    released, "" where it is."""
    table = tables.read(heads, "heads")
    if not np.array_equal(table["frame"], rows["frame"]):
        raise DiorError(f"{where}: {heads} is of other pictures; run heads again")
    edges = np.stack([table[key] for key in EDGES], axis=1)
    boxes = [None if status == "out_of_frame" else edge for status, edge in zip(table["status"], edges, strict=True)]
    return boxes, ["" if word in RELEASED else f"head_{word}" for word in table["status"]]


def _others(covers: Path, rows: Table) -> list[list[Floats]]:
    """Of each picture the edges (4,) of what else is to be covered."""
    table = tables.read(covers, "other_covers")
    found: list[list[Floats]] = [[] for _ in rows["frame"]]
    edges = np.stack([table[key] for key in EDGES], axis=1)
    for row, box in zip(np.searchsorted(rows["frame"], table["frame"]), edges, strict=True):
        found[row].append(box)
    return found


def masked(masks: Sequence[Sequence[float]], size: tuple[int, int], where: str) -> list[Floats]:
    """Edges (4,) of whole pixels of rectangles px in pictures of `size` (height, width) px.

    Raises DiorError for one that lies outside of them.
    """
    high, wide = size
    found = []
    for mask in masks:
        edges = np.array(mask, float) + 0.5
        if edges[0] >= wide or edges[1] >= high:
            raise DiorError(
                f"{where}: `privacy_masks` of session.yaml: {list(mask)} lies outside of its pictures of {wide}x{high} "
                "px"
            )
        whole = np.concatenate([np.floor(edges[:2]), np.ceil(edges[2:])])
        found.append(whole.clip(0, [wide, high, wide, high]))
    return found


def _named(words: dict[str, str], columns: dict[str, tables.Column]) -> dict[str, tables.Column]:
    return {**{key: [word] * len(columns["frame"]) for key, word in words.items()}, **columns}


def _released_covers(
    rows: Table, later: int, boxes: list[Floats | None], others: list[list[Floats]], shown: Bools
) -> dict[str, tables.Column]:
    """Columns of `released_covers` of the pictures that are `shown` (F,), but for whose they are."""
    found: list[tuple[int, str, Floats]] = []
    for i in np.flatnonzero(shown).tolist():
        head = boxes[i]
        found += [(i, "head", head)] if head is not None else []
        found += [(i, "other", box) for box in others[i]]
    at = np.array([i for i, _, _ in found], int)
    edges = np.array([box for _, _, box in found]).reshape(-1, 4)
    return {
        "frame": rows["frame"][at],
        "stamp_ns": rows["stamp_ns"][at] - later,
        "what": [what for _, what, _ in found],
        **dict(zip(EDGES, edges.T, strict=True)),
    }


def _writer(path: Path) -> pq.ParquetWriter:
    """A Parquet writer of `released_frames`: everything small, but for the pictures, which are compressed already."""
    schema = tables.to_arrow("released_frames", {}).schema
    small = [name for name in schema.names if name != "image"]
    return pq.ParquetWriter(
        path,
        schema,
        compression={**dict.fromkeys(small, "zstd"), **dict.fromkeys(IMAGE, "none")},
        use_dictionary=[name for name in small if name not in ("frame", "stamp_ns", "height", "width")],
        # the smallest and the largest of a column of pictures would be two pictures
        write_statistics=small,
    )


def _pictures(
    rows: Table,
    boxes: list[Floats | None],
    others: list[list[Floats]],
    withheld: list[str],
    data_root: Path,
    faces: str,
    consent: str,
    why: list[tuple[int, str]],
) -> tuple[Texts, Texts]:
    """JPEG bytes (F,), None for none, and the reasons (F,) why there is none; (frame, error) of what is broken go
    to `why`."""
    found = np.full(len(boxes), None, object)
    if consent != "yes":
        return found, np.full(len(boxes), "no_consent", object)
    reasons = np.array(withheld, object)
    wanted = np.flatnonzero(reasons == "")
    for row, message, _ in bags.read_messages(tables.rows(rows, wanted), data_root):
        i = wanted[row]
        try:
            found[i] = released(message, (rows["height"][i], rows["width"][i]), boxes[i], others[i], faces)
        except BROKEN as error:
            # where memory is short, no picture is to blame
            if sentence(error):
                raise
            reasons[i] = "not_readable"
            why.append((int(rows["frame"][i]), str(error)))
    return found, reasons


def released(message: Any, size: tuple[int, int], box: Floats | None, others: list[Floats], faces: str) -> bytes | None:
    """JPEG bytes of a message's picture of `size` (height, width) px, with the head in `box`, None for none, and all of
    the boxes `others` covered.

    Raises one of BROKEN for a picture that cannot be read.
    """
    raw = message.raw
    _, *said = messages.picture_of(message.kind, raw, message.wire)
    if tuple(said) != tuple(size):
        raise ValueError(f"it is {said[1]}x{said[0]} px where its index says {size[1]}x{size[0]}")
    data = messages.compressed(message.kind, raw, message.wire)
    covers = [Cover(tuple(other.tolist()), True) for other in others]
    covers += [Cover(tuple(box.tolist()), False)] if box is not None else []
    how = faces if faces != "shown" else "blurred"
    quality, sampling = jpeg.QUALITY, jpeg.SAMPLING
    if data is not None and data.startswith(jpeg.SOI):
        found = jpeg_covers.covered(data, covers, how) if covers else None
        if found is not None:
            return found
        stripped, plain = jpeg.bare(data)
        if plain and not covers:
            return stripped
        quality, sampling = jpeg.settings(stripped)
    picture = messages.decode(message.kind, raw, message.wire, size)
    for cover in covers:
        head_blur.cover(picture, cover.box, how, cover.whole)
    return jpeg.encoded(picture, quality, sampling)


def _findings(scope: str, broken: int, count: int, why: list[tuple[int, str]]) -> list[tuple[str, str, str, str]]:
    if not broken:
        return []
    frame, reason = min(why)
    text = f"{broken} of {count} pictures cannot be read and are not released; the first is frame {frame}: {reason}"
    return [(scope, "warning", "picture_not_readable", text)]
