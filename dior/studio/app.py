"""The pages of the studio as a Starlette application."""

from contextlib import suppress
from pathlib import Path

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Mount
from starlette.staticfiles import StaticFiles

from dior.errors import DiorError
from dior.shortage import sentence
from dior.studio import (
    boxes_page,
    checks_page,
    effort,
    frames_page,
    long_range_page,
    marks_page,
    report_page,
    start_page,
    time_page,
    who_page,
)
from dior.studio.guard import HOSTS, Guard
from dior.studio.hand_files import Conflict
from dior.studio.pages import Unknown, page, workspace_of
from dior.studio.runs import Runs
from dior.studio.workspace import Workspace

STATIC = Path(__file__).parent / "static"
# what each page answers; the order is that of the links on top (`pages.PAGES`)
PARTS = (
    start_page, frames_page, marks_page, boxes_page, long_range_page, time_page, who_page, checks_page, effort,
    report_page,
)  # fmt: skip
ROUTES = [route for part in PARTS for route in part.ROUTES]


def made(workspace: Workspace, token: str) -> Starlette:
    """The application for a project; `token` is the one of the address that was printed."""
    static = Mount("/static", StaticFiles(directory=STATIC), name="static")
    app = Starlette(
        routes=[*ROUTES, static],
        middleware=[Middleware(TrustedHostMiddleware, allowed_hosts=HOSTS), Middleware(Guard, token=token)],
        exception_handlers={
            Conflict: _conflict,
            DiorError: _refused,
            OSError: _refused,
            HTTPException: _no_page,
            Exception: _fault,
        },
    )
    app.state.workspace, app.state.effort, app.state.in_memory = workspace, effort.Effort(), {}
    app.state.token = token
    return app


def close(app: Starlette) -> None:
    """End what the pages have begun, and note how long people were at them."""
    runs: Runs | None = app.state.in_memory.get("runs")
    if runs is not None and runs.close():
        # the terminal may be gone
        with suppress(OSError):
            print("The run that was begun on the page is ended, too: `dior run` goes on where it was.", flush=True)
    app.state.effort.note()


def _conflict(request: Request, error: Exception) -> Response:
    assert isinstance(error, Conflict)
    return JSONResponse({"error": str(error), "conflicts": error.rows}, 409)


def _refused(request: Request, error: Exception) -> Response:
    text = str(error)
    if isinstance(error, OSError):
        text = sentence(error) or f"{error.filename or 'a file'}: {error.strerror or error}"
    if isinstance(error, Unknown):
        # a session whose files are wrong is left out
        wrong = start_page.faults_of(workspace_of(request).read())
        text += "".join(f"; or is it left out because of this? {one}" for one in wrong[:1])
    return _answer(request, text, 422)


def _no_page(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    text = "There is no such page." if error.status_code == 404 else error.detail
    return _answer(request, text, error.status_code)


def _fault(request: Request, error: Exception) -> Response:
    # uvicorn prints its trace
    text = "This is a fault of dior's own; where `dior studio` was typed there is more of it."
    return JSONResponse({"error": text}, 500)


def _answer(request: Request, text: str, status: int) -> Response:
    """A sentence, for a page's script or as a page."""
    if "text/html" in request.headers.get("accept", ""):
        return page(request, "said.html.j2", status, said=text)
    return JSONResponse({"error": text}, status)
