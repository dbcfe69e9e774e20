"""Which pixels a picture has."""

import numpy as np

from dior.arrays import Bools, Floats


def in_picture(uv: Floats, width: int, height: int) -> Bools:
    """Whether pixels (..., 2) lie in a picture; its edge is half a pixel outside the outermost centres."""
    with np.errstate(invalid="ignore"):
        u, v = uv[..., 0], uv[..., 1]
        return (u >= -0.5) & (u < width - 0.5) & (v >= -0.5) & (v < height - 0.5)
