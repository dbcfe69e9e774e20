"""Fixed lists of what to train, tune and test on, so that two papers compare the same thing.

INPUT    the released walks and the roles of their cameras
OUTPUT   columns of `splits`: a row for each recording of a camera and each split that it is in

| split | parts | what it asks |
|---|---|---|
| subject | train, val, test | people never seen before; no person is in two parts |
| range | gallery (close cameras), probe (long range) | the same people from far away |
| outfit | gallery (the outfit of the person's first walk), probe (any other) | the same people in other clothes |
"""

import hashlib
from collections.abc import Iterable

from dior.release.people_tables import Walks

# shares of the people; chosen: those of 58 people are 40, 6 and 12
VAL, TEST = 0.1, 0.2


def columns(walks: Walks, roles: dict[tuple[str, str], str]) -> dict[str, list[str]]:
    """Columns of `splits`. `walks`: released rows by sequence; `roles`: (session, camera) -> close or long_range."""
    part_of, outfit_of = by_subject({walk["subject"] for walk in walks.values()}), _first_outfits(walks)
    rows = []
    for name, walk in walks.items():
        for camera in walk["cameras"]:
            recording = (walk["subject"], name, camera)
            rows.append(("subject", part_of[walk["subject"]], *recording))
            close = roles[walk["session"], camera] == "close"
            rows.append(("range", "gallery" if close else "probe", *recording))
            if walk["outfit"]:
                same = walk["outfit"] == outfit_of[walk["subject"]]
                rows.append(("outfit", "gallery" if same else "probe", *recording))
    keys = ("split", "part", "subject", "sequence", "camera")
    return {key: [row[i] for row in sorted(rows)] for i, key in enumerate(keys)}


def by_subject(names: Iterable[str]) -> dict[str, str]:
    """Part by pseudonym: a fifth test, a tenth val, the rest train; of two or three people one each at least.

    People stand in the order of a hash of their pseudonym, test first. So it does not matter who was recorded when,
    one more or less moves at most one person over each border, and nobody moves from train to test or back while
    there are people in between.
    """
    order = sorted(names, key=lambda name: hashlib.sha256(name.encode()).hexdigest())
    test = max(round(TEST * len(order)), len(order) > 1)
    val = max(round(VAL * len(order)), len(order) > 2)
    return {name: "test" if i < test else "val" if i < test + val else "train" for i, name in enumerate(order)}


def _first_outfits(walks: Walks) -> dict[str, str]:
    """The outfit of each subject's first walk that has one, by session, order and name."""
    order = sorted(
        walks.values(), key=lambda walk: (walk["released_session"], int(walk["session_order"]), walk["sequence"])
    )
    found: dict[str, str] = {}
    for walk in order:
        if walk["outfit"]:
            found.setdefault(walk["subject"], walk["outfit"])
    return found
