"""Who may use the page in the browser: the token, the cookie, and what a page of another site can send."""

from __future__ import annotations

import sys

import pytest

from canbase_runtime.web_names import hosts
from canbase_web.access import COOKIE, MOST_BODY_BYTES, Access, Request, Verdict, parsed

TOKEN, SESSION = "token-of-the-address", "session-of-the-cookie"
NAME = COOKIE.format(port=8080)
ACCESS = Access(TOKEN, NAME, SESSION, hosts("127.0.0.1", 8080))


def judged(headers: dict[str, str], query: str = "", method: str = "GET", access: Access = ACCESS) -> Verdict:
    return access.judge(Request(method, "/", query, headers))


MINE = {"host": "127.0.0.1:8080", "cookie": f"{NAME}={SESSION}"}


def test_the_token_logs_in_and_the_cookie_passes_from_then_on() -> None:
    assert judged({"host": "127.0.0.1:8080"}, f"token={TOKEN}") is Verdict.LOGS_IN
    assert judged(MINE) is Verdict.PASSES


def test_a_token_alone_changes_nothing() -> None:
    assert judged({"host": "127.0.0.1:8080"}, f"token={TOKEN}", "POST") is Verdict.NO_TOKEN


@pytest.mark.parametrize("query", ["", "token=", f"token={TOKEN[:-1]}", f"token={TOKEN}x", "token=é", f"tok={TOKEN}"])
def test_nobody_gets_in_without_the_token(query: str) -> None:
    assert judged({"host": "127.0.0.1:8080"}, query) is Verdict.NO_TOKEN


@pytest.mark.parametrize("cookie", ["", f"{NAME}=", f"{NAME}={TOKEN}", f"{NAME}x={SESSION}", "\x00;=;", f"a={SESSION}"])
def test_another_cookie_is_none(cookie: str) -> None:
    assert judged(MINE | {"cookie": cookie}) is Verdict.NO_TOKEN


def test_the_cookie_is_found_among_others() -> None:
    assert judged(MINE | {"cookie": f"a=b; {NAME}={SESSION}; c=d"}) is Verdict.PASSES


@pytest.mark.parametrize("host", ["evil.example:8080", "127.0.0.1", "127.0.0.1:81", "", "127.0.0.1:8080.evil.example"])
def test_a_name_that_was_bound_to_this_address_by_someone_else_is_refused_with_a_cookie_too(host: str) -> None:
    assert judged(MINE | {"host": host}, f"token={TOKEN}") is Verdict.OTHER_HOST


PROXIED = Access(TOKEN, NAME, SESSION, hosts("127.0.0.1", 8080), "https://robot.example")


@pytest.mark.parametrize("host", ["robot.example", "127.0.0.1:8080"])
def test_behind_a_proxy_with_tls_its_name_and_its_pages_pass_and_no_other(host: str) -> None:
    """Some proxies pass on the name that the browser has asked for, some give that of the server behind them."""
    theirs = MINE | {"host": host, "origin": "https://robot.example"}
    assert judged(theirs, access=PROXIED) is Verdict.PASSES
    assert judged(MINE | {"origin": "http://127.0.0.1:8080"}, access=PROXIED) is Verdict.PASSES
    assert judged(theirs) in (Verdict.OTHER_HOST, Verdict.OTHER_SITE), "without --proxy"
    for origin in ("http://robot.example", "https://robot.example:8443", "https://evil.example", "null", ""):
        assert judged(theirs | {"origin": origin}, access=PROXIED) is Verdict.OTHER_SITE


def test_no_host_and_no_origin_are_those_of_a_proxy_that_is_not_there() -> None:
    assert judged(MINE | {"host": ""}) is Verdict.OTHER_HOST
    assert judged(MINE | {"origin": ""}) is Verdict.OTHER_SITE


@pytest.mark.parametrize(("host", "secure"), [("robot.example", True), ("127.0.0.1:8080", False)])
def test_the_cookie_of_a_proxy_with_tls_goes_over_tls_alone(host: str, secure: bool) -> None:
    _, (_, cookie) = PROXIED.login(Request("GET", "/", f"token={TOKEN}", {"host": host}))
    assert cookie.endswith("; Secure") is secure


def test_the_pages_of_two_robots_in_one_browser_have_cookies_of_their_own() -> None:
    """127.0.0.1:8080 and 127.0.0.1:8081 are one host to a browser: a login at one must not end that at the other."""
    other = Access(TOKEN, COOKIE.format(port=8081), "session-of-another", hosts("127.0.0.1", 8081))
    cookies = f"{NAME}={SESSION}; {other.cookie}={other.session}"
    assert judged(MINE | {"cookie": cookies}) is Verdict.PASSES
    assert judged({"host": "127.0.0.1:8081", "cookie": cookies}, access=other) is Verdict.PASSES


@pytest.mark.parametrize(
    ("line", "headers"),
    [
        ("POST /stop", "Cookie: " + "a=b; " * 3200),
        ("POST /stop", 'Cookie: a="' + "\\101" * 4000),
        ("GET /?" + "a=1&" * 4000, ""),
        ("GET /", "".join(f"h{number}:\r\n" for number in range(2000))),
    ],
)
def test_a_long_head_is_refused_as_fast_as_a_short_one(line: str, headers: str) -> None:
    """One thread refuses all: 200 a second would hold up STOP. In calls, which no load of this computer changes."""

    def calls(head: str) -> int:
        count = 0

        def counted(*_: object) -> None:
            nonlocal count
            count += 1

        sys.setprofile(counted)
        try:
            request = parsed(head.encode())
            verdict = Verdict.MALFORMED if request is None else ACCESS.judge(request)
        finally:
            sys.setprofile(None)
        assert verdict in (Verdict.MALFORMED, Verdict.NO_TOKEN)
        return count

    assert calls(f"{line} HTTP/1.1\r\nHost: 127.0.0.1:8080\r\n{headers}") < 1000


def test_without_a_host_there_is_no_access() -> None:
    assert judged({"cookie": MINE["cookie"]}) is Verdict.OTHER_HOST


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "https://127.0.0.1:8080", "http://127.0.0.1:81", ""])
def test_a_page_of_another_site_is_refused_with_a_cookie_too(origin: str) -> None:
    assert judged(MINE | {"origin": origin}) is Verdict.OTHER_SITE


def test_the_pages_own_origin_passes() -> None:
    assert judged(MINE | {"origin": "http://localhost:8080"}) is Verdict.PASSES


@pytest.mark.parametrize(
    ("length", "verdict"),
    [
        (str(MOST_BODY_BYTES), Verdict.PASSES),
        (str(MOST_BODY_BYTES + 1), Verdict.TOO_LONG),
        ("-1", Verdict.TOO_LONG),
        ("1e3", Verdict.TOO_LONG),
        ("9" * 5000, Verdict.TOO_LONG),
    ],
)
def test_a_request_has_a_length(length: str, verdict: Verdict) -> None:
    assert judged(MINE | {"content-length": length}) is verdict


@pytest.mark.parametrize(
    ("host", "names"),
    [
        ("127.0.0.1", {"127.0.0.1:80", "localhost:80", "[::1]:80"}),
        ("192.168.1.5", {"192.168.1.5:80"}),
        ("Robot.local", {"robot.local:80"}),
        ("::1", {"127.0.0.1:80", "localhost:80", "[::1]:80"}),
        ("fd00::5", {"[fd00::5]:80"}),
    ],
)
def test_the_page_is_opened_under_the_names_of_its_address_alone(host: str, names: set[str]) -> None:
    assert hosts(host, 80) == names


def test_a_login_leaves_the_token_out_of_the_address_and_goes_to_no_other_host() -> None:
    request = Request("GET", "//evil.example/drive", f"token={TOKEN}&a=1", {})
    cookie = f"{NAME}={SESSION}; Path=/; HttpOnly; SameSite=Strict"
    assert ACCESS.login(request) == (("location", "/evil.example/drive?a=1"), ("set-cookie", cookie))
    assert ACCESS.login(Request("GET", "/", f"token={TOKEN}", {}))[0] == ("location", "/")


def test_a_request_goes_on_as_the_last_of_its_connection_and_a_websocket_as_it_came() -> None:
    request = parsed(b"GET /drive?a=1 HTTP/1.1\r\nHost: a\r\nConnection:\tkeep-alive ")
    assert request is not None
    assert request == Request("GET", "/drive", "a=1", {"host": "a", "connection": "keep-alive"})
    assert request.alone() == b"GET /drive?a=1 HTTP/1.1\r\nhost: a\r\nconnection: close\r\n\r\n"
    websocket = parsed(b"GET / HTTP/1.1\r\nUpgrade: WebSocket\r\nConnection: Upgrade")
    assert websocket is not None
    assert websocket.alone() == b"GET / HTTP/1.1\r\nupgrade: WebSocket\r\nconnection: Upgrade\r\n\r\n"


@pytest.mark.parametrize(
    "head",
    [
        b"",
        b"GET /",
        b"GET / HTTP/1.0",
        b"GET  / HTTP/1.1",
        b"GET http://evil.example/ HTTP/1.1",
        b"GET / HTTP/1.1\r\nHost",
        b"GET / HTTP/1.1\r\nHost : a",
        b"GET / HTTP/1.1\r\nHost: a\r\n folded: b",
        b"GET / HTTP/1.1\r\nHost: a\r\nhost: b",
        b"GET / HTTP/1.1\r\nHost: a\nCookie: b",
        b"GET / HTTP/1.1\r\nHost: a\rCookie: b",
        b"POST / HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked",
    ],
)
def test_a_head_that_could_be_read_in_two_ways_is_none(head: bytes) -> None:
    assert parsed(head) is None
