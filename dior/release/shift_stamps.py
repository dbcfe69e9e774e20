"""Stamps of a release that do not tell the day: counted from a person's first picture, where the config asks for it.

INPUTS   the `frames` tables of all walks of a person
OUTPUTS  how many nanoseconds are taken off every stamp of the person; tables with these stamps

It is one number for a person: the times between the person's own pictures stay what they were, also from one session to
the next, and two people's stamps have nothing to do with each other any more. The first picture of the walks gets
FIRST_NS, not 0: the gallery and motion capture may be older, and a negative stamp is none (see tables.py).
"""

from collections.abc import Sequence

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from dior.arrays import AnyPath, Ints
from dior.errors import DiorError
from dior.tables import tables

FIRST_NS = 315_532_800 * 10**9  # 1980-01-01 00:00 UTC


def shift_ns(frames: Sequence[AnyPath]) -> int:
    """How many ns to take off the stamps of a person, so that the first picture has the stamp FIRST_NS.

    `frames`: the files of all the person's walks. Raises DiorError where there is no picture.
    """
    stamps = [tables.read(path, "frames", ["stamp_ns"])["stamp_ns"] for path in frames]
    together = np.concatenate(stamps) if stamps else np.empty(0, np.int64)
    if not len(together):
        raise DiorError(f"the stamps cannot be shifted: no picture in {', '.join(map(str, frames)) or 'no table'}")
    return int(together.min()) - FIRST_NS


def shifted(table: pa.Table, ns: int) -> pa.Table:
    """A pyarrow table with `ns` taken off its column stamp_ns; null stays null.

    Raises DiorError for a stamp from more than ten years before the person's first walk.
    """
    at = table.schema.get_field_index("stamp_ns")
    stamps = pc.subtract(table["stamp_ns"], pa.scalar(ns, pa.int64()))
    _check(pc.min(stamps).as_py())
    return table.set_column(at, table.schema.field(at), stamps)


def shifted_stamps(stamps: Ints, ns: int | Ints) -> Ints:
    """Stamps (N,) with `ns`, a number or (N,), taken off; negative ones are null and stay so. Raises like `shifted`."""
    there = stamps >= 0
    out = np.where(there, stamps - ns, stamps)
    _check(out[there].min() if there.any() else None)
    return out


def _check(first: int | None) -> None:
    if first is not None and first < 0:
        raise DiorError(
            f"a stamp is {(FIRST_NS - first) / 3.156e16:.1f} years before the person's first walk: a clock of the "
            "recording or of the gallery is wrong, and release.shift_stamps cannot hide when it was"
        )
