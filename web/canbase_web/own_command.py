"""Runs a `canbase` command as a process of its own, for what the command line does already."""

from __future__ import annotations

import asyncio

from canbase_runtime.own_modules import module_command


async def run(*words: str, patience_s: float) -> tuple[int | None, str, str]:
    """Exit code, stdout and stderr of `canbase WORDS`. The code is None when it took longer, and was killed."""
    process = await asyncio.create_subprocess_exec(
        *module_command("canbase_cli", *words),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    try:
        out, error = await asyncio.wait_for(process.communicate(), patience_s)
    except asyncio.TimeoutError:
        process.kill()
        await process.wait()
        return None, "", ""
    return process.returncode, out.decode(errors="replace"), error.decode(errors="replace")
