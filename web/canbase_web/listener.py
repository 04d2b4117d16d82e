"""The port of the page: a thread reads the head of each request, refuses it, answers STOP, or passes it on.

The pages are behind it, on a Unix socket: a stranger costs the head of a request, and STOP waits for no page.
"""

from __future__ import annotations

import contextlib
import math
import selectors
import socket
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from http import HTTPStatus
from typing import Final

from canbase_web.access import Access, Verdict, parsed

MOST_WAITING: Final = 1000
"""Connections whose head is not complete."""
MOST_NEW_PER_S: Final = 200
"""Connections of one address; more are closed unread."""
LATE_S: Final = 5.0
"""A connection whose head is not complete by then is closed [s]."""
MOST_HEAD_BYTES: Final = 16_384
MOST_STOPS: Final = 8
"""Answered at a time; the others wait."""
_ACCEPTED_AT_ONCE: Final = 200
_BACKLOG: Final = 4096
"""A connection that the kernel drops is tried again after a second."""
_LOOK_S: Final = 0.25
_SECOND_S: Final = 1.0
STOP_BROKEN: Final = "<p>STOP FAILED: a defect of canbase web. Press the emergency stop at the robot.</p>"
_THIS_COMPUTER: Final = ("127.0.0.1", "::1")
"""Its programs and its tunnels are one peer: none of them is refused for what others do."""
HEADERS: Final = (
    ("content-security-policy", "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
     "style-src 'self' 'unsafe-inline'; img-src 'self' data:; font-src 'self' data:; connect-src 'self'; "
     "frame-ancestors 'none'; base-uri 'self'; form-action 'self'"),
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "same-origin"),
)  # fmt: skip
"""Of every answer. Nothing is loaded from elsewhere, and no other page shows this one in a frame. NiceGUI compiles its
templates in the browser, which is what 'unsafe-eval' is for."""


@dataclass(slots=True)
class _Waiting:
    """A connection until its head is complete."""

    connection: socket.socket
    peer: str
    since_s: float
    head: bytes = b""
    has_ended: bool = False

    def read(self) -> None:
        """What has come."""
        try:
            data = self.connection.recv(MOST_HEAD_BYTES)
            self.head += data
            self.has_ended = not data
        except BlockingIOError:
            pass
        except OSError:
            self.has_ended = True

    @property
    def is_complete(self) -> bool:
        """Nothing more is waited for."""
        return self.has_ended or b"\r\n\r\n" in self.head or len(self.head) > MOST_HEAD_BYTES


class Listener:
    """`serve` in a thread of its own; `close` ends it."""

    def __init__(self, address: tuple[str, int], access: Access) -> None:
        """Raises OSError where the address cannot be had."""
        family = socket.AF_INET6 if ":" in address[0] else socket.AF_INET
        self._port = socket.create_server(address, family=family, backlog=_BACKLOG)
        self._port.setblocking(False)
        self._access = access
        self._waiting: dict[str, dict[socket.socket, _Waiting]] = {}
        """By peer, the oldest first."""
        self._new: Counter[str] = Counter()
        self._second_s = -math.inf
        self._ends = False

    def serve(self, stop: Callable[[], tuple[int, str]], pass_on: Callable[[socket.socket, bytes], None]) -> None:
        """Until `close`. `stop`: makes the large STOP, and gives the status and the page of its answer; it may take
        seconds. `pass_on`: gets a connection that may see the pages, and what it has sent."""
        self._stop, self._pass_on = stop, pass_on
        with self._port, selectors.DefaultSelector() as self._selector, ThreadPoolExecutor(MOST_STOPS) as self._stops:
            self._selector.register(self._port, selectors.EVENT_READ)
            while not self._ends:
                ready = [key.data for key, _ in self._selector.select(_LOOK_S)]
                now_s = time.monotonic()
                heads = [each for each in ready if each is not None]
                self._read([*heads, *self._accepted(now_s)] if None in ready else heads)
                self._cut_late(now_s)
            for each in [each for peer in self._waiting.values() for each in peer.values()]:
                self._released(each).close()

    def close(self) -> None:
        """From any thread."""
        self._ends = True

    def _accepted(self, now_s: float) -> Iterator[_Waiting]:
        if now_s - self._second_s >= _SECOND_S:
            self._second_s, self._new = now_s, Counter()
        with contextlib.suppress(OSError):  # none waits any more
            for _ in range(_ACCEPTED_AT_ONCE):
                connection, (peer, *_) = self._port.accept()
                self._new[peer] += 1
                if self._new[peer] > MOST_NEW_PER_S and peer not in _THIS_COMPUTER:
                    connection.close()
                else:
                    connection.setblocking(False)
                    yield _Waiting(connection, peer, now_s)

    def _read(self, heads: list[_Waiting]) -> None:
        """STOP before everything that came with it."""
        for each in heads:
            each.read()
        for each in sorted(heads, key=lambda each: not each.head.startswith(b"POST /stop ")):
            if each.is_complete:
                self._take(each.head, self._released(each))
            else:
                self._wait(each)

    def _take(self, received: bytes, connection: socket.socket) -> None:
        """Refuse it, stop, or pass it on."""
        head, end, body = received.partition(b"\r\n\r\n")
        request = parsed(head) if end and len(head) <= MOST_HEAD_BYTES else None
        verdict = Verdict.MALFORMED if request is None else self._access.judge(request)
        if request is None or verdict is not Verdict.PASSES:
            login = self._access.login(request) if request and verdict is Verdict.LOGS_IN else ()
            _send(connection, answer(verdict.status, verdict.sentence, login))
            connection.close()
        elif (request.method, request.path) == ("POST", "/stop"):
            stopping = self._stops.submit(self._answer_stop, connection)
            stopping.add_done_callback(Future.result)  # what it raises comes into the log (concurrent.futures)
        else:
            self._pass_on(connection, request.alone() + body)

    def _answer_stop(self, connection: socket.socket) -> None:
        status, page = 503, STOP_BROKEN
        try:
            status, page = self._stop()
        finally:  # whoever presses STOP has to know, also when it raises
            _send(connection, answer(status, page, kind="text/html"))
            connection.close()

    def _wait(self, waiting: _Waiting) -> None:
        """For the rest of its head; where too many do, the peer with the most of them loses its oldest."""
        of_peer = self._waiting.setdefault(waiting.peer, {})
        if waiting.connection not in of_peer:
            of_peer[waiting.connection] = waiting
            self._selector.register(waiting.connection, selectors.EVENT_READ, waiting)
        if sum(map(len, self._waiting.values())) > MOST_WAITING:
            self._released(next(iter(max(self._waiting.values(), key=len).values()))).close()

    def _cut_late(self, now_s: float) -> None:
        for of_peer in tuple(self._waiting.values()):
            while of_peer and now_s - (oldest := next(iter(of_peer.values()))).since_s > LATE_S:
                self._released(oldest).close()

    def _released(self, waiting: _Waiting) -> socket.socket:
        """It waits no longer."""
        of_peer = self._waiting.get(waiting.peer, {})
        if of_peer.pop(waiting.connection, None) is not None:
            self._selector.unregister(waiting.connection)
        if not of_peer:
            self._waiting.pop(waiting.peer, None)
        return waiting.connection


@lru_cache(64)
def answer(status: int, text: str, headers: tuple[tuple[str, str], ...] = (), kind: str = "text/plain") -> bytes:
    """A whole answer; the connection ends with it."""
    body = text.encode()
    own = (("content-type", f"{kind}; charset=utf-8"), ("content-length", str(len(body))), ("connection", "close"))
    lines = "".join(f"{name}: {value}\r\n" for name, value in (*own, *HEADERS, *headers))
    return f"HTTP/1.1 {status} {HTTPStatus(status).phrase}\r\n{lines}\r\n".encode("latin-1") + body


def _send(connection: socket.socket, data: bytes) -> None:
    """It fits into the buffer of a new connection; a peer that has gone gets none."""
    with contextlib.suppress(OSError):
        connection.send(data)
