"""Runs a `canbase` command as a process of its own, for what the command line does already."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Final

from canbase_runtime.own_modules import module_command

LONGEST_LINE: Final = 1_000_000


async def run(*words: str, patience_s: float, on_line: Callable[[str], object] = len) -> tuple[int | None, str, str]:
    """Exit code, stdout and stderr of `canbase WORDS`. The code is None when it took longer, and was killed.

    `on_line` gets each line of stdout as soon as it is there.
    """
    process = await asyncio.create_subprocess_exec(
        *module_command("canbase_cli", *words),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        limit=LONGEST_LINE,
    )
    try:
        out, error = await asyncio.wait_for(
            asyncio.gather(_lines(process.stdout, on_line), _all(process.stderr)), patience_s
        )
        return await process.wait(), out, error
    except asyncio.TimeoutError:
        return None, "", ""
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()


async def _lines(stream: asyncio.StreamReader | None, on_line: Callable[[str], object]) -> str:
    assert stream is not None
    lines = []
    async for line in stream:
        lines.append(line.decode(errors="replace"))
        on_line(lines[-1])
    return "".join(lines)


async def _all(stream: asyncio.StreamReader | None) -> str:
    assert stream is not None
    return (await stream.read()).decode(errors="replace")
