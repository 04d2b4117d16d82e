"""The process of `canbase web`: what ends it."""

from __future__ import annotations

import asyncio

import uvicorn

from canbase_web.server import _end_with, _Server


def test_a_loop_that_fails_ends_the_process_with_its_error_and_one_that_is_canceled_does_not() -> None:
    async def fails() -> None:
        raise RuntimeError("the publisher is gone")

    async def story() -> tuple[tuple[bool, str], tuple[bool, str]]:
        found = []
        for cancels in (True, False):
            server = _Server(uvicorn.Config("unused"))
            loop = asyncio.create_task(fails())
            if cancels:
                loop.cancel()
            await asyncio.wait([loop])
            _end_with(server, loop)
            found.append((server.should_exit, server.failure))
        return found[0], found[1]

    assert asyncio.run(story()) == ((False, ""), (True, "RuntimeError('the publisher is gone')"))
