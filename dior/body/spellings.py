"""The joint that another tool means by a name: `LAnkle`, `left-ankle` and `ankle_l` are left_ankle.

INPUTS   a name as a person or a tool wrote it. OUTPUTS: a name of `dior.body.names`, or the same word tidied up.
"""

import re

from dior.body.names import BODY_25, BODY_25B, COCO_18, HALPE_26, MLKIT_33

_SIDES = {"l": "left", "left": "left", "r": "right", "right": "right"}
_KNOWN = {
    name.replace("_", ""): name for names in (MLKIT_33, BODY_25, BODY_25B, COCO_18, HALPE_26) for name in names
}  # fmt: skip
# as MMPose and Pose2Sim call the middle of the hips (MMPose 1.3.2, configs/_base_/datasets/halpe26.py; Pose2Sim,
# skeletons.py)
_ALSO = {"hip": "mid_hip", "pelvis": "mid_hip"}
_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")


def joint_of(name: str) -> str | None:
    """The joint that `name` spells, None where it is no known one."""
    return _joint(words_of(name))


def tidy(name: str) -> str:
    """`joint_of` a name, or else the name in small letters, its side first, with `_` between its words."""
    words = words_of(name)
    return _joint(words) or "_".join(words)


def words_of(name: str) -> list[str]:
    """The words of a name in small letters, its side, where it has one, first and spelled out."""
    words = [word.lower() for word in _WORDS.findall(name)]
    for at in (0, -1):
        if len(words) > 1 and words[at] in _SIDES:
            side = _SIDES[words.pop(at)]
            return [side, *words]
    return words


def _joint(words: list[str]) -> str | None:
    whole = "".join(words)
    if whole in _KNOWN or whole in _ALSO:
        return _KNOWN.get(whole) or _ALSO[whole]
    # lankle: no letter tells where the side ends
    return _KNOWN.get(_SIDES[whole[0]] + whole[1:]) if whole[:1] in _SIDES else None
