"""What GaitGraph2 is given of a sequence besides its joints: how they move, and the bones between them.

INPUTS   a sequence (T, 17, 2) px. OUTPUTS  the network's input
"""

import numpy as np

from dior.arrays import Floats

# the joint that a bone comes from; the nose has none
PARENTS = (0, 0, 0, 1, 2, 0, 0, 5, 6, 7, 8, 5, 6, 11, 12, 13, 14)
NOSE = 0
# the same joints with left and right exchanged
EXCHANGED = (0, 2, 1, 4, 3, 6, 5, 8, 7, 10, 9, 12, 11, 14, 13, 16, 15)
# px, so that a bone of no length has a direction; the authors'
LEAST_PX = 1e-4


def gaitgraph2(uv: Floats, confidence: float | Floats) -> Floats:
    """Joints, velocities and bones (3, 5, T, 17) of a sequence (T, 17, 2) px; `confidence`: one, or (T, 17, 1).

    joints      x, y, confidence, x and y from the nose
    velocities  x and y to the next frame, 0, confidence, y to the frame after it
    bones       x, y, 0, confidence, angle to the y axis

    The authors' code leaves one channel empty and writes the confidence over another; it is done so here, since their
    figures were made with that.
    """
    sure = np.broadcast_to(confidence, (*uv.shape[:2], 1))
    empty, bone = np.zeros_like(sure), bones(uv)
    angle = np.arccos(bone[..., 1:] / (np.linalg.norm(bone, axis=-1, keepdims=True) + LEAST_PX))
    branches = (
        (uv, sure, uv - uv[:, [NOSE]]),
        (ahead(uv, 1), empty, sure, ahead(uv, 2)[..., 1:]),
        (bone, empty, sure, angle),
    )
    return np.moveaxis(np.stack([np.concatenate(branch, axis=-1) for branch in branches]), -1, 1)


def ahead(uv: Floats, frames: int) -> Floats:
    """How far each joint (T, 17, 2) moves in 1 or 2 `frames`; 0 in the last two, as the authors have it."""
    out = np.zeros_like(uv)
    stay = len(uv) - 2
    out[:stay] = uv[frames : stay + frames] - uv[:stay]
    return out


def bones(uv: Floats) -> Floats:
    """Each joint (T, 17, 2) from the one that it hangs on."""
    return uv - uv[:, PARENTS]
