"""The one error that a user sees as a sentence instead of a traceback, several of them together, and how what is said
is worded."""

import difflib
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

# chosen: what a terminal shows on some lines; the fix stands at the end
MOST_LETTERS = 1500
# chosen: what a screen shows; a slip in a column is in every row
MOST_FAULTS = 20


class DiorError(Exception):
    """Bad input. The text names the file, sequence, camera, frame or key and the likely fix."""

    def __str__(self) -> str:
        return one_line(super().__str__())


class DiorErrors(DiorError):
    """Several of them, a line each."""

    def __init__(self, found: Iterable[DiorError]) -> None:
        self.found = list(found)

    def __str__(self) -> str:
        lines = list(dict.fromkeys(map(str, self.found)))
        more = [f"and {len(lines) - MOST_FAULTS} more"] if len(lines) > MOST_FAULTS else []
        return "\n".join([*lines[:MOST_FAULTS], *more])


class Faults:
    """Collects the errors of parts that can be looked at one by one, so that all are told at once.

    >>> faults = Faults()
    >>> for name in ("a", "b"):
    ...     with faults.kept():
    ...         raise DiorError(f"{name}.yaml: there is no such file")
    >>> len(faults.found)
    2
    """

    def __init__(self, found: Iterable[DiorError] = ()) -> None:
        self.found: list[DiorError] = list(found)

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Keep the error of what is done within."""
        try:
            yield
        except DiorErrors as several:
            self.found += several.found
        except DiorError as error:
            self.found.append(error)

    def tell(self) -> None:
        """Raise what was kept, if anything was."""
        if self.found:
            raise self.found[0] if len(self.found) == 1 else DiorErrors(self.found)


def one_line(text: str) -> str:
    """`text` on one line, whatever a damaged file or a library has put into it, and not endless."""
    text = re.sub(r"\s*[\n\r\v\f\x1c-\x1e\x85\u2028\u2029]\s*", " ", text.strip())
    if len(text) > MOST_LETTERS:
        text = f"{text[: MOST_LETTERS - 400]} [...] {text[-400:]}"
    return "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in text)


def many(number: int, what: str) -> str:
    """`1 walk`, `2 walks`."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def nearest(word: object, known: Iterable[object]) -> str:
    """` (did you mean 'x'?)` for the nearest of `known`, or an empty string."""
    words = [str(k) for k in known]
    # chosen: half of the letters alike; a suggestion costs nothing where it is wrong
    match = [one for one in words if one.lower() == str(word).lower()]
    match = match or difflib.get_close_matches(str(word), words, n=1, cutoff=0.5)
    return f" (did you mean '{match[0]}'?)" if match else ""
