"""Something done in a copy of this process: whatever it changes, nothing is changed here."""

from __future__ import annotations

import os
import pickle
import traceback
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def in_a_copy(do: Callable[[], T]) -> T | None:
    """What it returns. None: it raised, and its traceback is on stderr, or its process died."""
    reader, writer = os.pipe()
    pid = os.fork()
    if pid == 0:
        status = 1
        try:
            os.close(reader)
            with os.fdopen(writer, "wb") as pipe:
                pipe.write(pickle.dumps(do()))
            status = 0
        except Exception:  # noqa: BLE001 - it ends this copy alone
            traceback.print_exc()
        finally:
            os._exit(status)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        told = pipe.read()
    os.waitpid(pid, 0)
    found: T | None = pickle.loads(told) if told else None
    return found
