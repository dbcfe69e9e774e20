"""How far a long step is: a line now and then on standard error, which goes to the terminal and to the job's log.

Whole lines, no bar that is drawn over: a log is read afterwards. A step that is done within seconds says nothing.
"""

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

Item = TypeVar("Item")
# chosen: soon enough that nobody wonders, seldom enough that the log of an hour stays readable
FIRST_S, EVERY_S = 3.0, 10.0


def reporting(
    items: Iterable[Item],
    total: int | Callable[[], int],
    what: str,
    where: str,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[Item]:
    """Yield `items`, telling now and then how many of `total` have been worked on.

    `what`: the items' name in the plural, `where`: what the step works on. `total` may be a function, which is asked
    when there is something to tell.

    >>> list(reporting("abc", 3, "pictures", "walk, cam01"))
    ['a', 'b', 'c']
    """
    began = clock()
    due = began + FIRST_S
    for done, item in enumerate(items):
        now = clock()
        if now >= due:
            total = total() if callable(total) else total
            print(line(done, total, what, where, now - began), file=sys.stderr, flush=True)
            due = now + EVERY_S
        yield item


def line(done: int, total: int, what: str, where: str, seconds: float) -> str:
    """`walk, cam01: 1200 of 3600 pictures (33 %), about 40 s left`."""
    left = f", about {seconds * (total - done) / done:.0f} s left" if 0 < done <= total else ""
    return f"{where}: {done} of {total} {what} ({100 * done / max(total, 1):.0f} %){left}"
