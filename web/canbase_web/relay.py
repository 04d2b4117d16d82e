"""From a connection that may see the pages to the socket on which they are served, and back."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Coroutine
from typing import Any, Final

_CHUNK: Final = 65_536


async def relay(connection: socket.socket, begun: bytes, pages: str) -> None:
    """Until one side ends: then both do. `begun`: what the connection has sent already; `pages`: path of their
    socket."""
    with contextlib.suppress(OSError):  # one of them has gone
        outer = await asyncio.open_connection(sock=connection)
        try:
            inner = await asyncio.open_unix_connection(pages)
            try:
                inner[1].write(begun)
                await _first(_copy(outer[0], inner[1]), _copy(inner[0], outer[1]))
            finally:
                inner[1].close()
        finally:
            outer[1].close()


async def _first(*copies: Coroutine[Any, Any, None]) -> None:
    tasks = [asyncio.create_task(copy) for copy in copies]
    await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    while data := await reader.read(_CHUNK):
        writer.write(data)
        await writer.drain()
