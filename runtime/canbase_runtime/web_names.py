"""Under which names a page of this computer may be opened. After DNS rebinding a browser names another. Pure."""

from __future__ import annotations

from typing import Final

LOCAL: Final = ("127.0.0.1", "localhost", "::1")


def authority(host: str, port: int) -> str:
    """As it stands in an address (RFC 3986): an IPv6 address in brackets."""
    return (f"[{host}]:{port}" if ":" in host else f"{host}:{port}").lower()


def hosts(host: str, port: int) -> frozenset[str]:
    """The names under which a page that is bound to `host` may be opened."""
    return frozenset(authority(name, port) for name in names(host))


def names(host: str) -> tuple[str, ...]:
    """Of a page that is bound to `host`, without a port."""
    return LOCAL if host in LOCAL else (host.lower(),)


def named(header: str) -> str:
    """The name in a Host header, without its port and brackets."""
    name = header.strip().lower()
    return name[1:].partition("]")[0] if name.startswith("[") else name.partition(":")[0]
