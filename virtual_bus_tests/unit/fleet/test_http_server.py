"""The HTTP server of canbase metrics: bounded in connections, time and work, whatever clients do."""

from __future__ import annotations

import http.client
import socket
import threading
import time
from collections.abc import Iterator

import pytest

from canbase_fleet import http_server
from canbase_fleet.http_server import MOST_OPEN, PageServer

PATIENCE_S = 20.0


class Site:
    """A server with one page that counts how often it was made."""

    def __init__(self) -> None:
        self.made: list[bool] = []
        self.server = PageServer(("127.0.0.1", 0), {"/metrics": self.page}, ["Robot1"])
        self.port = self.server.server_port
        threading.Thread(target=self.server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()

    def page(self, plain: bool) -> tuple[bytes, str]:
        self.made.append(plain)
        return b"hello\n", "text/plain"

    def get(self, path: str = "/metrics", method: str = "GET", **headers: str) -> tuple[int, bytes]:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE_S)
        connection.request(method, path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.read()

    def connect(self) -> socket.socket:
        return socket.create_connection(("127.0.0.1", self.port), timeout=PATIENCE_S)

    def close(self) -> None:
        self.server.shutdown()
        self.server.server_close()


@pytest.fixture
def site() -> Iterator[Site]:
    opened = Site()
    yield opened
    opened.close()


def is_cut(client: socket.socket, sends: bytes = b"") -> bool:
    """Whether the connection ends within PATIENCE_S, while this goes on to send."""
    client.settimeout(0.02)
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        try:
            client.sendall(sends)
            return client.recv(1) == b""
        except TimeoutError:
            continue
        except ConnectionError:
            return True
    return False


def test_the_page_and_nothing_else(site: Site) -> None:
    assert site.get() == (200, b"hello\n")
    assert site.get("/metrics?name=canbase_estop") == (200, b"hello\n")
    assert site.get("/etc/passwd") == (404, b"/metrics\n")
    assert site.get(method="POST")[0] == 501


@pytest.mark.parametrize(
    ("host", "status"),
    [("127.0.0.1", 200), ("LOCALHOST:9", 200), ("[::1]:9464", 200), ("robot1:9464", 200), ("robot1.evil.example", 403),
     ("evil.example:9464", 403), ("127.0.0.1.evil.example", 403), ("", 403)],
)  # fmt: skip
def test_a_page_under_a_name_of_a_stranger_is_not_shown(site: Site, host: str, status: int) -> None:
    """DNS rebinding: the browser of somebody in the network opens this address under another name."""
    assert site.get(Host=host)[0] == status
    assert bool(site.made) is (status == 200)


def test_a_storm_of_requests_is_answered_with_one_page(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http_server, "PAGE_S", 1e9)
    assert {site.get() for _ in range(50)} == {(200, b"hello\n")}
    assert site.made == [False]
    site.get(Accept="text/plain")
    site.get(Accept="application/openmetrics-text;version=1.0.0,text/plain;q=0.5")
    assert site.made == [False, True]


def test_a_page_that_is_old_is_made_anew(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http_server, "PAGE_S", 0.0)
    site.get()
    site.get()
    assert len(site.made) == 2


def test_silent_clients_make_room_for_who_asks(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    """More of them than connections: the oldest is closed for each that comes. No time is up here."""
    monkeypatch.setattr(http_server, "DEADLINE_S", 1e9)
    monkeypatch.setattr(http_server._Handler, "timeout", 1e6)
    silent = [site.connect() for _ in range(MOST_OPEN)]
    assert site.get() == (200, b"hello\n")
    assert is_cut(silent[0])
    for client in silent:
        client.close()


def test_a_client_that_sends_byte_by_byte_is_cut_at_the_deadline(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http_server, "DEADLINE_S", 0.05)
    client = site.connect()
    client.sendall(b"GET /metrics HTTP/1.1\r\nX-Slow: ")
    assert is_cut(client, b"x")
    client.close()


@pytest.mark.parametrize(
    "request_text",
    [
        b"GET /" + b"x" * 100_000 + b" HTTP/1.1\r\n\r\n",
        b"GET /metrics HTTP/1.1\r\nX: " + b"x" * 100_000 + b"\r\n\r\n",
        b"GET /metrics HTTP/1.1\r\n" + b"X: y\r\n" * 200 + b"\r\n",
        b"\x00\xff\xfe\r\n\r\n",
    ],
)
def test_a_request_without_bounds_is_refused(site: Site, request_text: bytes) -> None:
    client = site.connect()
    try:
        client.sendall(request_text)
        answer = client.recv(1000)
    except ConnectionError:  # refused before all of it was sent
        answer = b""
    assert b"200 OK" not in answer
    client.close()
    assert site.get() == (200, b"hello\n")
    assert site.made == [False]


def test_a_page_that_cannot_be_made_is_the_failure_of_the_server_and_a_client_that_goes_is_none(site: Site) -> None:
    silent = site.connect()
    silent.sendall(b"GET /metrics")
    silent.close()
    assert (site.get(), site.server.failure) == ((200, b"hello\n"), "")

    def fails(plain: bool) -> tuple[bytes, str]:
        raise RuntimeError("no page")

    site.server._pages["/metrics"] = http_server._Kept(fails)
    with pytest.raises((http.client.HTTPException, ConnectionError)):
        site.get()
    while not site.server.failure:  # the thread of that connection notes it at its end
        site.get("/other")
    assert site.server.failure == "RuntimeError('no page')"
