"""Between a browser's connection and the socket of the pages: both directions, and the end of either side."""

from __future__ import annotations

import asyncio
import socket
from pathlib import Path

import pytest

from canbase_web.relay import relay

LARGE = bytes(range(256)) * 4096


async def page(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Answers a line with much, and ends; the line "wait" with what it gets at last."""
    if (await reader.readline()) != b"wait\n":
        writer.write(LARGE)
        await writer.drain()
    else:
        assert await reader.read() == b""
        writer.write(b"gone")
    writer.close()


@pytest.mark.parametrize(("asked", "answer"), [(b"page\n", LARGE), (b"wa", None)])
def test_what_is_sent_arrives_and_each_side_learns_that_the_other_has_gone(
    tmp_path: Path, asked: bytes, answer: bytes | None
) -> None:
    async def story() -> bytes | None:
        server = await asyncio.start_unix_server(page, tmp_path / "pages")
        browser, connection = socket.socketpair()
        connection.setblocking(False)
        relaying = asyncio.create_task(relay(connection, asked, str(tmp_path / "pages")))
        reader, writer = await asyncio.open_connection(sock=browser)
        received = None
        if answer is None:
            writer.write(b"it\n")
            await writer.drain()
        else:
            received = await reader.read()
        writer.close()
        await asyncio.wait_for(relaying, 10.0)
        server.close()
        return received

    assert asyncio.run(story()) == answer


def test_pages_that_are_not_there_end_the_connection(tmp_path: Path) -> None:
    async def story() -> bytes:
        browser, connection = socket.socketpair()
        connection.setblocking(False)
        await relay(connection, b"", str(tmp_path / "none"))
        reader, writer = await asyncio.open_connection(sock=browser)
        writer.close()
        return await asyncio.wait_for(reader.read(), 10.0)

    assert asyncio.run(story()) == b""
