"""A path as the functions take it. Apart from `dior.arrays`, because this imports no numpy."""

import os
from typing import TypeAlias

AnyPath: TypeAlias = str | os.PathLike[str]
