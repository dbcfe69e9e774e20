"""The one error that a user sees as a sentence instead of a traceback."""

import difflib
import re
from collections.abc import Iterable

# chosen: what a terminal shows on some lines; the fix stands at the end
MOST_LETTERS = 1500


class DiorError(Exception):
    """Bad input. The text names the file, sequence, camera, frame or key and the likely fix."""

    def __str__(self) -> str:
        return one_line(super().__str__())


def one_line(text: str) -> str:
    """`text` on one line, whatever a damaged file or a library has put into it, and not endless."""
    text = re.sub(r"\s*[\n\r\v\f\x1c-\x1e\x85\u2028\u2029]\s*", " ", text.strip())
    if len(text) > MOST_LETTERS:
        text = f"{text[: MOST_LETTERS - 400]} [...] {text[-400:]}"
    return "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in text)


def nearest(word: object, known: Iterable[object]) -> str:
    """` (did you mean 'x'?)` for the nearest of `known`, or an empty string."""
    # chosen: half of the letters alike; a suggestion costs nothing where it is wrong
    match = difflib.get_close_matches(str(word), [str(k) for k in known], n=1, cutoff=0.5)
    return f" (did you mean '{match[0]}'?)" if match else ""
