"""The one error that a user sees as a sentence instead of a traceback."""

import difflib
from collections.abc import Iterable


class DiorError(Exception):
    """Bad input. The text names the file, sequence, camera, frame or key and the likely fix."""


def nearest(word: object, known: Iterable[object]) -> str:
    """` (did you mean 'x'?)` for the nearest of `known`, or an empty string."""
    # chosen: half of the letters alike; a suggestion costs nothing where it is wrong
    match = difflib.get_close_matches(str(word), [str(k) for k in known], n=1, cutoff=0.5)
    return f" (did you mean '{match[0]}'?)" if match else ""
