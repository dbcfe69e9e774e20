"""What all pages of the studio have in common: their templates, their links, and reading what a request names."""

import json
import math
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from starlette.requests import Request
from starlette.responses import HTMLResponse

from dior.errors import DiorError, nearest
from dior.project.contents import Project
from dior.report import pages as report_pages
from dior.studio.workspace import Workspace

if TYPE_CHECKING:
    import jinja2
    import markupsafe

DEEPEST = 20  # chosen: what pages send is four deep
TEMPLATES = Path(__file__).parent / "templates"
# address and name, as the links on top have them
PAGES = {
    "/": "Start",
    "/frames": "Frames",
    "/marks": "Marks",
    "/boxes": "Boxes",
    "/long-range": "Long range",
    "/time": "Time",
    "/who": "Who",
    "/checks": "Hand checks",
}
# what config/effort.tsv calls the work on a page
WORK = {
    "/marks": "marks",
    "/boxes": "boxes",
    "/long-range": "nudging the long-range camera",
    "/time": "clocks",
    "/who": "who is the subject",
    "/checks": "hand checks",
}


class Unknown(DiorError):
    """A word that the project does not have, such as a walk."""


@cache
def _environment() -> "jinja2.Environment":
    found = report_pages.environment(TEMPLATES)
    found.filters["prose"] = prose
    return found


def prose(text: str) -> "markupsafe.Markup":
    """A text for a page; what is between backticks is code, as `prose` of studio.js has it."""
    from markupsafe import Markup, escape

    parts = enumerate(text.split("`"))
    return Markup("").join(Markup("<code>{}</code>").format(part) if i % 2 else escape(part) for i, part in parts)


def page(request: Request, template: str, status: int = 200, **told: Any) -> HTMLResponse:
    """A page from its template, which may use what is `told`, and `pages` and `here` for the links on top."""
    name = workspace_of(request).name
    common = {"pages": PAGES, "here": request.url.path, "timed": WORK, "project_name": name}
    return HTMLResponse(_environment().get_template(template).render(common | told), status)


def workspace_of(request: Request) -> Workspace:
    """What the project has, for the one who asks."""
    found: Workspace = request.app.state.workspace
    return found


def walk_of(request: Request) -> str:
    """The walk that a request names. Raises DiorError for one that the project does not have."""
    project = workspace_of(request).project()
    return one_of("walk", request.query_params.get("walk", ""), project.sequences)


def recording_of(request: Request) -> tuple[str, str]:
    """The walk and the camera that a request names. Raises DiorError as `recording_in`."""
    return recording_in(workspace_of(request).project(), request.query_params)


def recording_in(project: Project, words: Mapping[str, Any]) -> tuple[str, str]:
    """The walk and the camera that `words` name. Raises DiorError for what the project does not have."""
    walk = one_of("walk", words.get("walk", ""), project.sequences)
    return walk, one_of("camera", words.get("camera", ""), project.cameras_of(walk))


def one_of(what: str, word: object, known: Any) -> str:
    """`word`, where it is one of `known`. Raises Unknown."""
    if not isinstance(word, str) or word not in known:
        shown = f"'{word:.40}'" if isinstance(word, str) and word else "none"
        listed = ", ".join(sorted(known)) or "none"
        raise Unknown(f"{what} is {shown}, which the project does not have{nearest(word, known)}: there is {listed}")
    return word


def number_of(request: Request, name: str, default: int | None = None) -> int:
    """A whole number from 0 that a request names. Raises DiorError."""
    word = request.query_params.get(name, "" if default is None else str(default))
    # 9 digits are more pictures than any recording has
    if not (word.isascii() and word.isdecimal() and len(word) < 10):
        raise DiorError(f"{name} is '{word:.40}', not a whole number from 0")
    return int(word)


def within(name: str, word: object, most: float) -> float:
    """The number `word`, where it is from -most to most. Raises DiorError, which says the `name`."""
    try:
        value = float(word)  # type: ignore[arg-type]  # what is no number is refused just here
    except (TypeError, ValueError):
        value = math.nan
    if not abs(value) <= most:
        raise DiorError(f"{name} is '{word!s:.40}', not a number from {-most:g} to {most:g}")
    return value


def pixel_of(given: Any) -> tuple[float, ...] | None:
    """A place (u, v) that a page has sent, () for one that cannot be seen, None for none. Raises DiorError."""
    if given is None:
        return None
    try:
        found = tuple(float(one) for one in given)
    except (TypeError, ValueError):
        found = (math.nan,)
    if len(found) not in (0, 2):
        raise DiorError("the page has sent a place that is no two pixels")
    return found


def in_memory(request: Request, name: str, make: Callable[[], Any] = dict) -> Any:
    """What a page keeps as long as the studio runs, made when it is first asked for; by default a dict."""
    kept: dict[str, Any] = request.app.state.in_memory
    return kept[name] if name in kept else kept.setdefault(name, make())


async def sent(request: Request) -> dict[str, Any]:
    """The JSON object that a page has sent. Raises DiorError for anything else, also for what can be read but not be
    written again: NaN, numbers that no float has, halves of letters, and lists in lists without end."""
    try:
        content = json.loads(await request.body(), parse_int=_whole)
        json.dumps(content, allow_nan=False, ensure_ascii=False).encode()
    except (ValueError, RecursionError):
        raise DiorError("what the page sent is no JSON") from None
    if not isinstance(content, dict) or _deep(content, DEEPEST):
        raise DiorError("what the page sent is no JSON object")
    return content


def _whole(digits: str) -> int | float:
    """A whole number, or where it has more digits than any has that is meant, the float nearest to it."""
    return int(digits) if len(digits) < 16 else float(digits)


def _deep(content: Any, left: int) -> bool:
    """Whether lists and objects are in each other more than `left` times."""
    inside = content.values() if isinstance(content, dict) else content if isinstance(content, list) else ()
    return left < 0 or any(_deep(one, left - 1) for one in inside)
