"""Pages of text over HTTP, for programs that scrape: GET alone, one request a connection, everything bounded.

A slow or silent client holds one of MOST_OPEN connections for DEADLINE_S at most; where all are taken the oldest is
closed. A page is made at most every PAGE_S, whatever comes in: a storm of requests gets the same bytes.
"""

from __future__ import annotations

import contextlib
import socket
import sys
import threading
import time
from collections.abc import Callable, Collection, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Final

from canbase_runtime.web_names import named, names

Page = Callable[[bool], tuple[bytes, str]]
"""A text and its content type; true: for a client that accepts plain text and no OpenMetrics."""
MOST_OPEN: Final = 16
DEADLINE_S: Final = 5.0
"""From its start to its end, for a connection [s]."""
PAGE_S: Final = 0.25
_HEADERS: Final = {"Cache-Control": "no-store", "X-Content-Type-Options": "nosniff"}


class PageServer(ThreadingHTTPServer):
    """`serve_forever` in a thread of its own; `shutdown` and `server_close` at the end."""

    daemon_threads = True
    block_on_close = False
    request_queue_size = MOST_OPEN

    def __init__(self, address: tuple[str, int], pages: Mapping[str, Page], more_names: Collection[str] = ()) -> None:
        """`pages`: by path; `more_names`: host names under which they may be opened, beside the address.

        Raises OSError where the address cannot be had."""
        self.address_family = socket.AF_INET6 if ":" in address[0] else socket.AF_INET
        self._pages = {path: _Kept(page) for path, page in pages.items()}
        self.names = frozenset((*names(address[0]), *(name.lower() for name in more_names)))
        """Of a Host header: another one is that of a page that a stranger's DNS has moved here."""
        self._open: dict[Any, float] = {}
        self._lock = threading.Lock()
        self.failure = ""
        """Why a page could not be made; empty: each could."""
        super().__init__(address, _Handler)

    def page(self, path: str) -> _Kept | None:
        """The page at `path`; None: there is none."""
        return self._pages.get(path)

    @property
    def paths(self) -> tuple[str, ...]:
        """Of all pages."""
        return tuple(self._pages)

    def process_request(self, request: Any, client_address: Any) -> None:
        """A new connection; the oldest makes room for it."""
        with self._lock:
            crowd = len(self._open) >= MOST_OPEN
            oldest = min(self._open, key=lambda each: self._open[each]) if crowd else None
            self._open[request] = time.monotonic()
        if oldest is not None:
            self._cut(oldest)
        super().process_request(request, client_address)

    def shutdown_request(self, request: Any) -> None:
        """The end of a connection."""
        with self._lock:
            self._open.pop(request, None)
        super().shutdown_request(request)

    def service_actions(self) -> None:
        """Twice a second: what has been open for too long is cut."""
        too_old = time.monotonic() - DEADLINE_S
        with self._lock:
            late = [request for request, since_s in self._open.items() if since_s < too_old]
        for request in late:
            self._cut(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that goes away, or is cut, is no line in the log; a page that cannot be made ends the process."""
        error = sys.exc_info()[1]
        if error is not None and not isinstance(error, OSError):
            self.failure = repr(error)

    def _cut(self, request: Any) -> None:
        """Its thread wakes up and ends."""
        with self._lock:
            self._open.pop(request, None)
        with contextlib.suppress(OSError):
            request.shutdown(socket.SHUT_RDWR)


class _Kept:
    """A page, made anew when it is older than PAGE_S. One thread makes it, the others wait for that."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._lock = threading.Lock()
        self._made: dict[bool, tuple[float, tuple[bytes, str]]] = {}

    def text(self, plain: bool) -> tuple[bytes, str]:
        """The page, PAGE_S old at most."""
        with self._lock:
            now_s = time.monotonic()
            if plain not in self._made or now_s - self._made[plain][0] >= PAGE_S:
                self._made[plain] = now_s, self._page(plain)
            return self._made[plain][1]


class _Handler(BaseHTTPRequestHandler):
    """One request. Its line and its headers are bounded by http.server: 64 kB each, 100 of them."""

    server: PageServer
    server_version, sys_version = "canbase", ""
    timeout = DEADLINE_S

    def do_GET(self) -> None:
        """The page, or where the pages are."""
        if named(self.headers.get("Host", "")) not in self.server.names:
            self._answer(403, b"this host name is not that of the page\n", "text/plain; charset=utf-8")
            return
        page = self.server.page(self.path.partition("?")[0])
        if page is None:
            listed = "".join(f"{path}\n" for path in self.server.paths)
            self._answer(404, listed.encode(), "text/plain; charset=utf-8")
            return
        accept = self.headers.get("Accept", "")
        self._answer(200, *page.text("text/plain" in accept and "openmetrics" not in accept))

    def _answer(self, status: int, text: bytes, content_type: str) -> None:
        self.send_response(status)
        for name, value in {"Content-Type": content_type, "Content-Length": str(len(text)), **_HEADERS}.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(text)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002 - http.server's name
        """A scrape is no line in the log."""
