"""Who may ask the pages for anything: the browser that was given the printed address, and no other page in it.

A token in the address becomes a cookie. Other pages in the same browser are told by Origin and refused, other names
for this computer (DNS rebinding) by Host (Starlette's TrustedHost, in front of this). There is no WebSocket.
"""

import hmac
from collections.abc import MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qsl, urlencode

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from dior.studio import report_page

HOSTS = ["127.0.0.1", "localhost"]
MOST_BYTES = 1 << 20  # chosen: of what a page sends; a file of marks has a tenth
READING = ("GET", "HEAD")
HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; connect-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
}


class Guard:
    """ASGI middleware around `app`."""

    def __init__(self, app: ASGIApp, token: str) -> None:
        self.app, self.token = app, token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})
            return

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    # the report's files have a policy of their own
                    headers.setdefault(name, value)
                # scripts are kept and asked for again by their hash: over a slow line they take longer than a picture
                static = scope["path"].startswith("/static/")
                headers.setdefault("cache-control", "no-cache" if static else "no-store")
            await send(message)

        refusal, headers = self._refusal(scope), Headers(scope=scope)
        if not refusal and self._given(scope):
            answer: ASGIApp = self._with_cookie(scope)
        elif not refusal and not self._known(headers, scope) and not self._of_report(scope):
            answer = PlainTextResponse("Open the address that `dior studio` has printed, with its token.\n", 403)
        elif refusal:
            answer = PlainTextResponse(refusal + "\n", 403)
        else:
            content = await _body(receive) if scope["method"] not in READING else b""
            if content is None:
                answer = PlainTextResponse(f"A page sends at most {MOST_BYTES} bytes.\n", 413)
            else:
                answer, receive = self.app, _again(content, receive)
        await answer(scope, receive, guarded)

    def _refusal(self, scope: Scope) -> str:
        """Why a request is another page's, or ""."""
        headers = Headers(scope=scope)
        origin, own = headers.get("origin"), f"http://{headers.get('host', '')}"
        if origin is not None and origin != own:
            return "This comes from another page."
        if origin is None and scope["method"] not in READING:
            return "This does not say from which page it comes."
        return ""

    def _given(self, scope: Scope) -> bool:
        given = dict(parse_qsl(scope["query_string"].decode("latin-1"))).get("token")
        return scope["method"] in READING and given is not None and self._is_token(given)

    def _known(self, headers: Headers, scope: Scope) -> bool:
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(_cookie(scope))
        except CookieError:
            return False
        return cookie is not None and self._is_token(cookie.value)

    def _of_report(self, scope: Scope) -> bool:
        return scope["method"] in READING and report_page.opens(scope["path"], self.token)

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given.encode("utf-8", "replace"), self.token.encode())

    def _with_cookie(self, scope: Scope) -> RedirectResponse:
        """To the same page, without the token in the address."""
        query = [pair for pair in parse_qsl(scope["query_string"].decode("latin-1")) if pair[0] != "token"]
        # one slash: two would be another computer
        path = "/" + scope["path"].lstrip("/")
        answer = RedirectResponse(path + ("?" + urlencode(query) if query else ""), 303)
        answer.set_cookie(_cookie(scope), self.token, httponly=True, samesite="strict")
        return answer


def _cookie(scope: Scope) -> str:
    """Cookies know no ports, and there may be a studio on each."""
    server: tuple[str, int] = scope.get("server") or ("", 0)
    return f"dior_studio_{server[1]}"


async def _body(receive: Receive) -> bytes | None:
    """What was sent, None where it is too much."""
    content = b""
    while True:
        message: MutableMapping[str, Any] = await receive()
        content += message.get("body", b"")
        if len(content) > MOST_BYTES:
            return None
        if not message.get("more_body"):
            return content


def _again(content: bytes, receive: Receive) -> Receive:
    """A `receive` that gives `content` first."""
    left = [content]

    async def given() -> Message:
        return {"type": "http.request", "body": left.pop(), "more_body": False} if left else await receive()

    return given
