"""Who may use the page: the token of its address, the cookie that it becomes, and requests of other sites. Pure.

A page of any other site can make a browser send requests to 127.0.0.1. It has neither the token nor the cookie
(SameSite=Strict), its Origin is its own, and after DNS rebinding its Host is its own.
"""

from __future__ import annotations

import hmac
import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final
from urllib.parse import parse_qs, urlencode

COOKIE: Final = "canbase_web_{port}"
"""A browser gives a cookie to every port of a host: by one name the pages of two robots would replace each other's."""
MOST_BODY_BYTES: Final = 65_536
"""No request of the page is longer."""
MOST_HEADERS: Final = 100
MOST_FIELDS: Final = 10
"""Of the query. A refusal costs little, whatever is sent: STOP waits for each one before it."""
_NAME: Final = re.compile(r"[A-Za-z0-9!#$%&'*+.^_`|~-]+")
"""Of a header (RFC 9110, 5.6.2)."""


class Verdict(Enum):
    """What becomes of a request: its status and the sentence of the answer."""

    PASSES = (200, "")
    LOGS_IN = (303, "the token is right: it becomes a cookie, and leaves the address")
    NO_TOKEN = (401, "open the address that canbase web has printed: it has the token")
    OTHER_HOST = (403, "this host name is not that of the page")
    OTHER_SITE = (403, "a page of another site has sent this")
    TOO_LONG = (413, "the request is too long")
    MALFORMED = (400, "no browser sends such a request")

    @property
    def status(self) -> int:
        """The HTTP status."""
        return self.value[0]

    @property
    def sentence(self) -> str:
        """For the person."""
        return self.value[1]


@dataclass(frozen=True, slots=True)
class Request:
    """The head of one. `headers`: by lower-case name."""

    method: str
    path: str
    query: str
    headers: Mapping[str, str]

    def alone(self) -> bytes:
        """As it came, but the last of its connection: each request is judged. A websocket goes on."""
        headers = dict(self.headers)
        if headers.get("upgrade", "").lower() != "websocket":
            headers["connection"] = "close"
        lines = "".join(f"{name}: {value}\r\n" for name, value in headers.items())
        target = f"{self.path}?{self.query}" if self.query else self.path
        return f"{self.method} {target} HTTP/1.1\r\n{lines}\r\n".encode("latin-1")


def parsed(head: bytes) -> Request | None:
    """The head of a request, without its end; None: it is none, or one that could be read in two ways."""
    text = head.decode("latin-1")
    if text.count("\r\n") > MOST_HEADERS:
        return None
    line, *rest = text.split("\r\n")
    joined = text.replace("\r\n", "")
    words, pairs = line.split(" "), [each.partition(":") for each in rest]
    headers = {name.lower(): value.strip(" \t") for name, _, value in pairs}
    is_plain = (
        len(words) == 3
        and words[1].startswith("/")
        and words[2] == "HTTP/1.1"
        and all(colon and _NAME.fullmatch(name) for name, colon, _ in pairs)
        and len(headers) == len(pairs)
        and "transfer-encoding" not in headers
        and not any(control in joined for control in "\r\n\0")
    )
    if not is_plain:
        return None
    path, _, query = words[1].partition("?")
    return Request(words[0], path, query, headers)


@dataclass(frozen=True, slots=True)
class Access:
    """`token`: of the address; `cookie`, `session`: the cookie's name and value; `hosts`: what a Host header may name,
    with its port; `proxy`: of a proxy with TLS, https://NAME or https://NAME:PORT; empty: there is none."""

    token: str
    cookie: str
    session: str
    hosts: frozenset[str]
    proxy: str = ""

    @property
    def _proxy_host(self) -> str:
        return self.proxy.removeprefix("https://")

    def judge(self, request: Request) -> Verdict:
        """Of one request, HTTP or websocket."""
        headers = request.headers
        host, origin = headers.get("host", "").lower(), headers.get("origin")
        if not host or host not in {*self.hosts, self._proxy_host}:
            return Verdict.OTHER_HOST
        if origin is not None and origin.lower() not in {
            self.proxy or None,
            *(f"http://{each}" for each in self.hosts),
        }:
            return Verdict.OTHER_SITE
        if not _short(headers.get("content-length", "0")):
            return Verdict.TOO_LONG
        if _same(_value(self.cookie, headers.get("cookie", "")), self.session):
            return Verdict.PASSES
        if request.method != "GET" or request.query.count("&") >= MOST_FIELDS:
            return Verdict.NO_TOKEN
        given = parse_qs(request.query).get("token", [""])[0]
        return Verdict.LOGS_IN if _same(given, self.token) else Verdict.NO_TOKEN

    def login(self, request: Request) -> tuple[tuple[str, str], ...]:
        """Headers of the answer to one that logs in: the same address without the token, and the cookie."""
        query = parse_qs(request.query)
        query.pop("token")
        rest = urlencode(query, doseq=True)
        place = "/" + request.path.lstrip("/") + (f"?{rest}" if rest else "")
        is_local = request.headers.get("host", "").lower() in {*self.hosts, ""}
        secure = "" if is_local else "; Secure"
        cookie = f"{self.cookie}={self.session}; Path=/; HttpOnly; SameSite=Strict{secure}"
        return ("location", place), ("set-cookie", cookie)


def _same(given: str, expected: str) -> bool:
    """In a time that does not depend on how much of it is right."""
    return hmac.compare_digest(given.encode(), expected.encode())


def _value(name: str, header: str) -> str:
    return f"; {header}".partition(f"; {name}=")[2].partition(";")[0]


def _short(length: str) -> bool:
    return length.isdecimal() and len(length) < 10 and int(length) <= MOST_BODY_BYTES
