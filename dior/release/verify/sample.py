"""A few pictures of a recording, chosen while all of them pass by.

INPUTS   JPEG bytes by row, in order. OUTPUTS: those of SPREAD rows, and of OUTLIERS whose length in bytes is least like
         that of the pictures before and after: a picture that does not belong there has a length that does not, either
"""

import heapq

# chosen: decoding them takes less time than hashing all pictures
SPREAD, OUTLIERS = 8, 10


class Sample:
    """The pictures kept so far of a recording with `count` rows."""

    def __init__(self, count: int) -> None:
        step = max((count - 1) / max(SPREAD - 1, 1), 1)
        self._wanted = {round(i * step) for i in range(SPREAD)}
        self._spread: dict[int, bytes] = {}
        # (how unlike its neighbours, row, picture), the least unlike first
        self._unlike: list[tuple[float, int, bytes]] = []
        self._last: list[tuple[int, bytes]] = []

    def add(self, row: int, data: bytes) -> None:
        if row in self._wanted:
            self._spread[row] = data
        self._last = [*self._last[-2:], (row, data)]
        if len(self._last) == 3:
            before, (middle, picture), after = self._last
            off = abs(len(picture) - (len(before[1]) + len(after[1])) / 2)
            push = heapq.heappush if len(self._unlike) < OUTLIERS else heapq.heappushpop
            push(self._unlike, (off, -middle, picture))

    def pictures(self) -> list[tuple[int, bytes]]:
        """(row, bytes) in order."""
        return sorted((self._spread | {-row: picture for _, row, picture in self._unlike}).items())
