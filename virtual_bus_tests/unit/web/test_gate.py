"""The gate before the pages: what other sites, wrong tokens, long bodies and many connections come to."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from canbase_web.access import COOKIE, MOST_BODY_BYTES, Access, hosts
from canbase_web.gate import MOST_SOCKETS, Gate

NAME = COOKIE.format(port=8080)
ACCESS = Access("the-token-of-the-page", NAME, "the-session", hosts("127.0.0.1", 8080))
HOST, MINE = ("host", "127.0.0.1:8080"), ("cookie", f"{NAME}=the-session")


class Inside:
    """The application behind the gate."""

    def __init__(self) -> None:
        self.seen: list[str] = []
        self.body = b""
        self.hold = asyncio.Event()

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        self.seen.append(scope["path"])
        if scope["type"] == "websocket":
            await self.hold.wait()
            return
        while True:
            message = await receive()
            self.body += message.get("body", b"")
            if not message.get("more_body"):
                break
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"page"})


def ask(
    inside: Inside,
    *headers: tuple[str, str],
    query: str = "",
    method: str = "GET",
    path: str = "/",
    body: tuple[bytes, ...] = (),
) -> tuple[int, dict[str, str]]:
    """Status and headers of the answer."""
    sent: list[Any] = []
    chunks = iter([*body, b""])

    async def receive() -> Any:
        chunk = next(chunks)
        return {"type": "http.request", "body": chunk, "more_body": bool(chunk)}

    async def send(message: Any) -> None:
        sent.append(message)

    scope = {
        "type": "http", "method": method, "path": path, "query_string": query.encode(),
        "headers": [(name.encode(), value.encode()) for name, value in headers],
    }  # fmt: skip
    asyncio.run(Gate(inside, ACCESS)(scope, receive, send))
    return sent[0]["status"], {name.decode(): value.decode() for name, value in sent[0]["headers"]}


def test_the_token_becomes_a_cookie_that_scripts_and_other_sites_do_not_get_and_leaves_the_address() -> None:
    inside = Inside()
    status, headers = ask(inside, HOST, query="token=the-token-of-the-page&a=1", path="/drive")
    assert (status, headers["location"], inside.seen) == (303, "/drive?a=1", [])
    assert headers["set-cookie"] == f"{NAME}=the-session; Path=/; HttpOnly; SameSite=Strict"


def test_the_address_after_the_token_is_never_one_of_another_host() -> None:
    _, headers = ask(Inside(), HOST, query="token=the-token-of-the-page", path="//evil.example/")
    assert headers["location"] == "/evil.example/"


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ((HOST,), 401),
        ((HOST, ("cookie", f"{NAME}=wrong")), 401),
        ((("host", "evil.example:8080"), MINE), 403),
        ((HOST, MINE, ("origin", "http://evil.example")), 403),
        ((HOST, MINE, ("content-length", str(MOST_BODY_BYTES + 1))), 413),
    ],
)
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_nothing_of_what_is_refused_reaches_the_application(headers: Any, status: int, method: str) -> None:
    inside = Inside()
    assert ask(inside, *headers, method=method)[0] == status
    assert inside.seen == []


def test_who_is_refused_loses_the_connection_and_keeps_no_place() -> None:
    assert ask(Inside(), HOST)[1]["connection"] == "close"
    assert "connection" not in ask(Inside(), HOST, MINE)[1]


def test_a_token_does_not_post() -> None:
    inside = Inside()
    assert ask(inside, HOST, query="token=the-token-of-the-page", method="POST", path="/stop")[0] == 401
    assert inside.seen == []


def test_every_answer_forbids_other_addresses_and_frames() -> None:
    for headers in ((HOST, MINE), (HOST,)):
        found = ask(Inside(), *headers)[1]
        assert found["content-security-policy"].startswith("default-src 'self'; ")
        assert "frame-ancestors 'none'" in found["content-security-policy"]


@pytest.mark.parametrize(("chunks", "arrives"), [(1, True), (64, True), (65, False)])
def test_a_body_without_a_length_is_cut_off(chunks: int, arrives: bool) -> None:
    inside = Inside()
    ask(inside, HOST, MINE, method="POST", body=(bytes(1024),) * chunks)
    assert (len(inside.body) == chunks * 1024) is arrives
    assert len(inside.body) <= MOST_BODY_BYTES


def websocket(*headers: tuple[str, str]) -> Any:
    return {
        "type": "websocket", "path": "/hold", "query_string": b"",
        "headers": [(name.encode(), value.encode()) for name, value in headers],
    }  # fmt: skip


@pytest.mark.parametrize(
    "headers", [(HOST,), (HOST, MINE, ("origin", "http://evil.example")), (("host", "evil.example"), MINE)]
)
def test_a_websocket_of_another_site_is_closed_before_it_opens(headers: Any) -> None:
    inside, sent = Inside(), []

    async def send(message: Any) -> None:
        sent.append(message)

    asyncio.run(Gate(inside, ACCESS)(websocket(*headers), None, send))  # type: ignore[arg-type]
    assert (sent, inside.seen) == ([{"type": "websocket.close", "code": 1008}], [])


def test_more_websockets_than_pages_need_are_refused_until_one_closes() -> None:
    async def story() -> tuple[int, int, int]:
        inside, sent = Inside(), []

        async def send(message: Any) -> None:
            sent.append(message)

        gate = Gate(inside, ACCESS)
        scope = websocket(HOST, MINE, ("origin", "http://127.0.0.1:8080"))
        tasks = [asyncio.create_task(gate(scope, None, send)) for _ in range(MOST_SOCKETS + 5)]  # type: ignore[arg-type]
        await asyncio.sleep(0)
        opened, refused = len(inside.seen), len(sent)
        inside.hold.set()
        await asyncio.gather(*tasks)
        await gate(scope, None, send)  # type: ignore[arg-type]
        return opened, refused, len(inside.seen)

    assert asyncio.run(story()) == (MOST_SOCKETS, 5, MOST_SOCKETS + 1)
