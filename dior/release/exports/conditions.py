"""What a walk is to the lists of who is compared with whom: nm, bg or cl, as CASIA-B and SUSTech1K call it.

INPUT    the walks of a release in order, with the outfit as the lab's sheet has it (free text)
OUTPUT   the condition of each: nm (as at first), bg (with a bag) or cl (other clothes)
"""

import re
from collections.abc import Iterable

from dior.release.exports.recordings import ReleasedWalk

NORMAL, BAG, CLOTHING = CONDITIONS = ("nm", "bg", "cl")
# how a sheet in English names a bag; what names none of these is clothes
_BAG = re.compile(r"(?<!\bno )(?<!\bwithout )(?<!\bwithout a )\b(?:(?:hand|shoulder)?bags?|backpacks?|rucksacks?)\b")


def names_bag(outfit: str) -> bool:
    """Whether an outfit has a bag.

    >>> names_bag("coat, Backpack"), names_bag("coat, no bag"), names_bag("baggy trousers")
    (True, False, False)
    """
    return bool(_BAG.search(outfit.lower()))


def of_walks(walks: Iterable[ReleasedWalk]) -> dict[str, str]:
    """nm, bg or cl by sequence, of `walks` in order.

    nm is the outfit of the subject's first walk without a bag (of the first walk where all have one), bg any other with
    a bag, cl any other.
    """
    walks = tuple(walks)
    usual: dict[str, str] = {}
    for walk in (*(walk for walk in walks if not names_bag(walk.outfit)), *walks):
        usual.setdefault(walk.subject, walk.outfit)
    return {walk.sequence: _condition(walk.outfit, usual[walk.subject]) for walk in walks}


def _condition(outfit: str, usual: str) -> str:
    if outfit == usual:
        return NORMAL
    return BAG if names_bag(outfit) else CLOTHING
