"""The last run's report, as its files are, under an address of its own: /report/<key>/index.html.

INPUTS   results/report/
OUTPUTS  none
The report's pages have scripts, which the studio's policy forbids, and are made of what is in recordings and sheets.
They are shown in a sandbox: an origin of their own, without a cookie, that loads nothing but files of the report and
sends nothing. Their requests carry no cookie: the key in the address, which opens the report alone, tells them.
"""

import base64
import hashlib
import hmac
import re
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

FOLDER = Path("results/report")
# an element without `src`: HTML ends it at the first end tag, whatever is in it
_INLINE = re.compile(rb"<script>(.*?)</script>", re.DOTALL)


def key_of(token: str) -> str:
    """The key of the report's addresses; it does not tell the token."""
    return hmac.new(token.encode(), b"report", hashlib.sha256).hexdigest()


def address(token: str) -> str:
    """The address of the report's first page, "" where there is none."""
    return f"/report/{key_of(token)}/index.html" if (FOLDER / "index.html").is_file() else ""


def opens(path: str, token: str) -> bool:
    """Whether an address has the key, and so needs no cookie."""
    given = path.removeprefix("/report/").partition("/")[0]
    return path.startswith("/report/") and hmac.compare_digest(given.encode("utf-8", "replace"), key_of(token).encode())


def file(request: Request) -> Response:
    """A file of the report, with the policy that it is shown under."""
    folder = FOLDER.resolve()
    try:
        path = (folder / request.path_params["path"]).resolve()
        found = path.is_relative_to(folder) and path.is_file()
    except (ValueError, OSError):  # a NUL, a name that is too long
        found = False
    if not found:
        raise HTTPException(404)
    base = f"{request.base_url}report/{request.path_params['key']}/"
    return FileResponse(path, headers=headers(base, path.read_bytes() if path.suffix == ".html" else b""))


def headers(base: str, page: bytes) -> dict[str, str]:
    """What goes before the guard's own headers. `base`: the address of the report's folder; `page`: the HTML."""
    digests = [base64.b64encode(hashlib.sha256(script).digest()).decode() for script in _INLINE.findall(page)]
    own = " ".join(f"'sha256-{one}'" for one in digests)
    policy = [
        "default-src 'none'", f"script-src {base} {own}", f"style-src {base} 'unsafe-inline'", f"img-src {base} data:",
        f"media-src {base}", "base-uri 'none'", "form-action 'none'", "frame-ancestors 'none'", "sandbox allow-scripts",
    ]  # fmt: skip
    # a sandbox is an origin of its own: to it these files are another's, and it cannot keep its opener away
    return {
        "content-security-policy": "; ".join(policy),
        "cross-origin-resource-policy": "cross-origin",
        "cross-origin-opener-policy": "unsafe-none",
    }


ROUTES = [Route("/report/{key}/{path:path}", file)]
