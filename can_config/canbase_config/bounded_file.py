"""Reads a file of the user: also a pipe (`<(…)` of a shell), for a bounded time and up to a bounded size."""

from __future__ import annotations

import os
import select
import time
from pathlib import Path
from typing import Final

WAIT_S: Final = 10.0
"""For what writes into a pipe [s]."""


def read_bounded(path: Path, most_bytes: int) -> bytes:
    """The content; of a larger file its first `most_bytes` + 1. Raises OSError, for a pipe without an end too."""
    ends_s, content = time.monotonic() + WAIT_S, b""
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        ready = select.poll()
        ready.register(handle, select.POLLIN)
        while len(content) <= most_bytes:
            if not ready.poll(1e3 * max(0.0, ends_s - time.monotonic())):
                raise TimeoutError(f"a pipe or device without an end, read for {WAIT_S:g} s")
            chunk = os.read(handle, most_bytes + 1 - len(content))
            if not chunk:
                break
            content += chunk
    finally:
        os.close(handle)
    return content
