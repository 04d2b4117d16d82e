"""Runs a program for a support bundle: bounded in time, and in what is kept of its output."""

from __future__ import annotations

import os
import selectors
import signal
import subprocess
import time
from collections.abc import Mapping, Sequence
from typing import IO, Final

CHUNK: Final = 1 << 16
COMPLAINT_BYTES: Final = 100_000
"""Of stderr."""


def run(
    argv: Sequence[str], environment: Mapping[str, str] | None, timeout_s: float, most: int
) -> tuple[int, str, str]:
    """Exit code, the last `most` bytes of its output, and the end of its complaints.

    Raises OSError, or subprocess.TimeoutExpired, when it and all that it has started are killed.
    """
    with subprocess.Popen(
        argv,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=environment,
        start_new_session=True,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        try:
            output, complaint = _ends(((process.stdout, most), (process.stderr, COMPLAINT_BYTES)), timeout_s)
            return process.wait(1.0), output.decode(errors="replace"), complaint.decode(errors="replace")
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            raise subprocess.TimeoutExpired(list(argv), timeout_s) from None


def _ends(streams: Sequence[tuple[IO[bytes], int]], timeout_s: float) -> list[bytearray]:
    """The last bytes of each stream, at most this many, once all are closed."""
    kept = [bytearray() for _ in streams]
    until = time.monotonic() + timeout_s
    with selectors.DefaultSelector() as selector:
        for number, (stream, _) in enumerate(streams):
            selector.register(stream, selectors.EVENT_READ, number)
        while selector.get_map():
            left = until - time.monotonic()
            if left <= 0.0:
                raise subprocess.TimeoutExpired([], timeout_s)
            for key, _ in selector.select(left):
                chunk, most = os.read(key.fd, CHUNK), streams[key.data][1]
                if not chunk:
                    selector.unregister(key.fileobj)
                kept[key.data] += chunk
                if len(kept[key.data]) > 2 * most:
                    del kept[key.data][:-most]
    return [end[-most:] for end, (_, most) in zip(kept, streams, strict=True)]
