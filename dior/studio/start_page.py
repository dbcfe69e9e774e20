"""Start: what is left to do, and the line to run next."""

from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from dior.studio.pages import page, workspace_of


def start(request: Request) -> Response:
    """The page."""
    read = workspace_of(request).read()
    return page(request, "start.html.j2", faults=[str(one) for one in read.faults], unfinished=read.unfinished)


ROUTES = [Route("/", start)]
