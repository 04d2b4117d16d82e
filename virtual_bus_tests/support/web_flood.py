"""Floods of the port of `canbase web` by somebody without its token: `python -m support.web_flood NAME PORT`.

It prints "began" in the middle of the first rush, and goes on until it is terminated, LASTS_S at most.
"""

from __future__ import annotations

import contextlib
import resource
import socket
import sys
import time
from collections import deque
from typing import Final

LASTS_S: Final = 30.0
HOST: Final = "Host: 127.0.0.1:{port}\r\n"
HANDSHAKE: Final = (
    f"GET /hold HTTP/1.1\r\n{HOST}Upgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)
FLOODS: Final = {
    "silent connections": ("", 3000),
    "silent heads": (f"GET / HTTP/1.1\r\n{HOST}X-", 3000),
    "refused posts without their body": (f"POST /stop HTTP/1.1\r\n{HOST}Content-Length: 1000\r\n\r\n", 300),
    "long cookies": (f"POST /stop HTTP/1.1\r\n{HOST}Cookie: {'a=b; ' * 3200}\r\n\r\n", 300),
    "websocket handshakes": (HANDSHAKE, 300),
    "1500 handshakes at once": (HANDSHAKE, 1500),
}
"""What each connection sends, and how many come at once; then the oldest makes room for a new one."""
RENEWED_PER_S: Final = 5000
"""More than a loop that serves pages can refuse."""


def flood(text: str, most: int, port: int) -> None:
    """Connects and sends, and reads nothing."""
    _, limit = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (limit, limit))
    sent, opened = text.format(port=port).encode(), deque[socket.socket]()
    end_s = time.monotonic() + LASTS_S
    count = 0
    while time.monotonic() < end_s:
        if count >= most:
            time.sleep(1.0 / RENEWED_PER_S)
        connection = socket.socket()
        connection.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            connection.connect(("127.0.0.1", port))
        with contextlib.suppress(OSError):
            connection.send(sent)
        opened.append(connection)
        if len(opened) > most:
            opened.popleft().close()
        count += 1
        if count == most // 2:
            print("began", flush=True)


if __name__ == "__main__":
    flood(*FLOODS[sys.argv[1]], int(sys.argv[2]))
