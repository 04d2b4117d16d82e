"""The port of the page: what it answers itself, what it passes on, and whom it cuts off."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from canbase_runtime.web_names import hosts
from canbase_web import listener as listener_module
from canbase_web.access import COOKIE, MOST_BODY_BYTES, Access
from canbase_web.listener import MOST_HEAD_BYTES, Listener
from support.browser import free_tcp_port

TOKEN = "the-token-of-the-page"
PATIENCE_S = 10.0


class Port:
    """A listener in a thread; `passed`: what it has passed on, each answered "page"."""

    def __init__(self) -> None:
        self.port = free_tcp_port()
        name = COOKIE.format(port=self.port)
        access = Access(TOKEN, name, "the-session", hosts("127.0.0.1", self.port))
        self.host, self.mine = f"Host: 127.0.0.1:{self.port}\r\n", f"Cookie: {name}=the-session\r\n"
        self.listener = Listener(("127.0.0.1", self.port), access)
        self.passed: list[bytes] = []
        self.stops = 0

    def serve(self) -> None:
        self.listener.serve(self._stop, self._pass_on)

    def _stop(self) -> tuple[int, str]:
        self.stops += 1
        return 200, "<p>Stop: stopping</p>"

    def _pass_on(self, connection: socket.socket, begun: bytes) -> None:
        self.passed.append(begun)
        with connection:
            connection.sendall(b"page")

    def connect(self) -> socket.socket:
        return socket.create_connection(("127.0.0.1", self.port), PATIENCE_S)

    def ask(self, line: str, *headers: str, body: str = "") -> str:
        """The whole answer."""
        with self.connect() as connection:
            connection.sendall(f"{line} HTTP/1.1\r\n{''.join(headers)}\r\n{body}".encode())
            return answer_of(connection)


def answer_of(connection: socket.socket) -> str:
    """Until the other side closes."""
    received = b""
    try:
        while data := connection.recv(4096):
            received += data
    except ConnectionResetError:
        pass
    return received.decode()


@contextmanager
def served() -> Iterator[Port]:
    port = Port()
    thread = threading.Thread(target=port.serve)
    thread.start()
    try:
        yield port
    finally:
        port.listener.close()
        thread.join(PATIENCE_S)
        assert not thread.is_alive()


def test_who_has_the_cookie_sees_the_pages_and_presses_stop_without_them() -> None:
    with served() as port:
        assert port.ask("GET /drive", port.host, port.mine) == "page"
        (begun,) = port.passed
        assert begun.startswith(b"GET /drive HTTP/1.1\r\n")
        assert b"connection: close" in begun
        stop = port.ask("POST /stop", port.host, port.mine, "Content-Length: 3\r\n", body="a=b")
        assert stop.startswith("HTTP/1.1 200 OK\r\n")
        assert stop.endswith("<p>Stop: stopping</p>")
        assert (port.stops, len(port.passed)) == (1, 1)


@pytest.mark.parametrize(
    ("line", "extra", "status"),
    [
        ("GET /", "", 401),
        ("POST /stop", "", 401),
        ("POST /stop", "Content-Length: 1000\r\n", 401),
        ("POST /stop", f"{{mine}}Content-Length: {MOST_BODY_BYTES + 1}\r\n", 413),
        ("POST /stop", "{mine}Origin: http://evil.example\r\n", 403),
        (f"POST /stop?token={TOKEN}", "", 401),
        ("POST /stop", "{mine}Transfer-Encoding: chunked\r\n", 400),
        ("GET /hold", "Upgrade: websocket\r\nConnection: Upgrade\r\n", 401),
        ("GET /hold", "{mine}Upgrade: websocket\r\nOrigin: http://evil.example\r\n", 403),
        (f"GET /?token={TOKEN}", "", 303),
        ("GET /", "X-Long: " + MOST_HEAD_BYTES * "x" + "\r\n", 400),
    ],
)
def test_who_is_refused_reaches_neither_page_nor_stop(line: str, extra: str, status: int) -> None:
    with served() as port:
        answer = port.ask(line, port.host, extra.replace("{mine}", port.mine))
        assert answer.startswith(f"HTTP/1.1 {status} ")
        assert "\r\nconnection: close\r\n" in answer
        assert "frame-ancestors 'none'" in answer
        assert (port.passed, port.stops) == ([], 0)


def test_a_head_in_pieces_is_one_and_a_connection_that_ends_before_is_none() -> None:
    with served() as port:
        with port.connect() as gone:
            gone.sendall(b"GET / HT")
        with port.connect() as slow:
            for piece in ("GET / HTTP/1.1\r\n", port.host, port.mine, "\r", "\n"):
                slow.sendall(piece.encode())
            assert answer_of(slow) == "page"
        assert len(port.passed) == 1


def test_of_too_many_silent_connections_the_oldest_are_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(listener_module, "MOST_WAITING", 3)
    with served() as port:
        silent = [port.connect() for _ in range(5)]
        assert [answer_of(each) for each in silent[:2]] == ["", ""]
        silent[2].sendall(f"GET / HTTP/1.1\r\n{port.host}{port.mine}\r\n".encode())
        assert answer_of(silent[2]) == "page"
        for each in silent:
            each.close()


def test_a_head_that_is_late_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(listener_module, "LATE_S", 0.0)
    with served() as port, port.connect() as silent:
        silent.sendall(b"GET / HT")
        assert answer_of(silent) in ("", port.ask("GET /", port.host, "X"))


@pytest.mark.parametrize(("neighbours", "answers"), [((), 2), (("127.0.0.1",), 5)])
def test_an_address_gets_few_new_connections_a_second_and_this_computer_all(
    monkeypatch: pytest.MonkeyPatch, neighbours: tuple[str, ...], answers: int
) -> None:
    monkeypatch.setattr(listener_module, "MOST_NEW_PER_S", 2)
    monkeypatch.setattr(listener_module, "_SECOND_S", 1e9)
    monkeypatch.setattr(listener_module, "_THIS_COMPUTER", neighbours)
    with served() as port:
        found = []
        for _ in range(5):
            try:
                found.append(port.ask("GET /", port.host, port.mine))
            except ConnectionError:
                found.append("")
        assert found.count("page") == answers


def test_whoever_presses_stop_is_told_when_it_raises_and_the_next_press_works(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with served() as port:
        assert "Stop: stopping" in port.ask("POST /stop", port.host, port.mine)
        works = port.listener._stop
        monkeypatch.setattr(port.listener, "_stop", lambda: 1 / 0)
        answered = port.ask("POST /stop", port.host, port.mine)
        monkeypatch.setattr(port.listener, "_stop", works)
        again = port.ask("POST /stop", port.host, port.mine)
    assert answered.startswith("HTTP/1.1 503")
    assert "STOP FAILED" in answered
    assert again.startswith("HTTP/1.1 200")
    assert "ZeroDivisionError" in caplog.text
