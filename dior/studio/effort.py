"""How long people were at each manual step, noted in config/effort.tsv for the report's page of costs.

A page tells how many seconds somebody was at it (static/studio.js: who has not moved for half a minute is not).
"""

import threading
from pathlib import Path

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from dior.errors import DiorError
from dior.project.schema_check import read_sheet
from dior.report.cost import EFFORT
from dior.studio.hand_files import Change, change_rows
from dior.studio.pages import WORK, one_of, sent

# chosen: a page tells every half minute
MOST_S = 60.0
# chosen: minutes are noted with one decimal, and the sheet is not written for less
LEAST_S = 60.0


class Effort:
    """Seconds by work that are not noted yet."""

    def __init__(self) -> None:
        self._seconds: dict[str, float] = {}
        self._lock = threading.Lock()

    def add(self, what: str, seconds: float) -> None:
        """Add seconds of some work, and note it where it has become enough."""
        with self._lock:
            self._seconds[what] = self._seconds.get(what, 0.0) + seconds
        self.note(LEAST_S)

    def note(self, least_s: float = 6.0) -> None:
        """Note in the sheet what is `least_s` at least."""
        with self._lock:
            for what, seconds in self._seconds.items():
                if seconds >= least_s and (minutes := round(seconds / 60, 1)):
                    _note(what, minutes)
                    self._seconds[what] = seconds - 60 * minutes


def _note(what: str, minutes: float) -> None:
    before = None
    if Path(EFFORT).is_file():
        rows, _ = read_sheet(EFFORT, "effort", "what", EFFORT)
        before = rows[what]["minutes"] if what in rows else None
    after = f"{float(before or 0) + minutes:.1f}"
    change = Change((what,), None if before is None else (before,), (after,))
    change_rows(EFFORT, ("what",), ("minutes",), [change], lambda draft: read_sheet(draft, "effort", "what", EFFORT))


async def add(request: Request) -> Response:
    """Of a page {"page": its address, "seconds": somebody was at it}."""
    told = await sent(request)
    page, seconds = one_of("page", told.get("page"), WORK), told.get("seconds")
    if isinstance(seconds, bool) or not isinstance(seconds, (int, float)) or not 0 <= seconds <= MOST_S:
        raise DiorError(f"seconds is no number from 0 to {MOST_S:.0f}")
    await run_in_threadpool(request.app.state.effort.add, WORK[page], float(seconds))
    return JSONResponse({})


ROUTES = [Route("/api/effort", add, methods=["POST"])]
