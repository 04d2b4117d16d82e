"""A thread with a small stack: a process that locks its memory has all of it resident, 8 MB by default."""

from __future__ import annotations

import threading
from typing import Final

STACK_BYTES: Final = 512 * 1024


class SmallThread(threading.Thread):
    """The size is the process's: start such threads from its main thread, and later ones have the usual stack."""

    def start(self) -> None:
        """As Thread does it."""
        usual = threading.stack_size(STACK_BYTES)
        try:
            super().start()
        finally:
            threading.stack_size(usual)
