"""Names for the types of arrays in signatures; shapes stand in the docstrings. And what numpy lacks."""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dior.paths import AnyPath as AnyPath

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Bools: TypeAlias = NDArray[np.bool_]
# object arrays of str; "" is null in a table
Texts: TypeAlias = NDArray[np.object_]
# a table as dior.tables.tables reads it: columns of equal length by name
Table: TypeAlias = dict[str, NDArray[Any]]


def runs_of(mask: Bools) -> Ints:
    """Where each run of true values of a mask (N,) begins and ends, (R, 2): its rows are those from the first on to
    that before the second."""
    return np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int))).reshape(-1, 2)
