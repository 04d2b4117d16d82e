"""Lets the requests through that access.py lets through: HTTP and websockets, before anything else sees them (ASGI)."""

from __future__ import annotations

from typing import Final
from urllib.parse import parse_qs, urlencode

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from canbase_web.access import MOST_BODY_BYTES, Access, Verdict

MOST_SOCKETS: Final = 32
"""Websockets that are open at a time: a page has two at most."""
HEADERS: Final = (
    (b"content-security-policy", b"default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
     b"style-src 'self' 'unsafe-inline'; img-src 'self' data:; font-src 'self' data:; connect-src 'self'; "
     b"frame-ancestors 'none'; base-uri 'self'; form-action 'self'"),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"same-origin"),
)  # fmt: skip
"""Nothing is loaded from elsewhere, and no other page shows this one in a frame. NiceGUI compiles its templates in the
browser, which is what 'unsafe-eval' is for."""
POLICY_VIOLATION: Final = 1008


class Gate:
    """Around the whole application."""

    def __init__(self, app: ASGIApp, access: Access) -> None:
        self._app, self._access = app, access
        self._sockets = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request, or the application's start and end."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        verdict = self._access.judge(headers, scope["query_string"].decode("latin-1"))
        if scope["type"] == "websocket":
            await self._websocket(verdict, scope, receive, send)
        elif verdict is Verdict.PASSES:
            await self._app(scope, _bounded(receive), _with_headers(send))
        elif verdict is Verdict.LOGS_IN and scope["method"] == "GET":
            await self._log_in(scope, send)
        else:
            verdict = Verdict.NO_TOKEN if verdict is Verdict.LOGS_IN else verdict
            await _answer(send, verdict.status, verdict.sentence, (b"connection", b"close"))

    async def _websocket(self, verdict: Verdict, scope: Scope, receive: Receive, send: Send) -> None:
        if verdict is not Verdict.PASSES or self._sockets >= MOST_SOCKETS:
            await send({"type": "websocket.close", "code": POLICY_VIOLATION})
            return
        self._sockets += 1
        try:
            await self._app(scope, receive, send)
        finally:
            self._sockets -= 1

    async def _log_in(self, scope: Scope, send: Send) -> None:
        """The same address without the token, and the cookie."""
        query = parse_qs(scope["query_string"].decode("latin-1"))
        query.pop("token")
        rest = urlencode(query, doseq=True)
        place = "/" + scope["path"].lstrip("/") + (f"?{rest}" if rest else "")
        cookie = f"{self._access.cookie}={self._access.session}; Path=/; HttpOnly; SameSite=Strict"
        await _answer(send, Verdict.LOGS_IN.status, "", (b"location", place.encode()), (b"set-cookie", cookie.encode()))


async def _answer(send: Send, status: int, text: str, *headers: tuple[bytes, bytes]) -> None:
    kind = (b"content-type", b"text/plain; charset=utf-8")
    await send({"type": "http.response.start", "status": status, "headers": [kind, *HEADERS, *headers]})
    await send({"type": "http.response.body", "body": text.encode()})


def _bounded(receive: Receive) -> Receive:
    """A body without a length is cut off: it ends as if its sender had gone."""
    left = MOST_BODY_BYTES

    async def bounded() -> Message:
        nonlocal left
        message = await receive()
        left -= len(message.get("body", b""))
        return message if left >= 0 else {"type": "http.disconnect"}

    return bounded


def _with_headers(send: Send) -> Send:
    async def with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            message = dict(message, headers=[*message["headers"], *HEADERS])
        await send(message)

    return with_headers
