"""Output that never waits for its reader: a terminal that is held (Ctrl-S), a full pipe, a journal that hangs.

rclpy writes its log with Python's lock held: one line that waits would hold up every thread of the process, the control
thread too.
"""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Iterable, Mapping

STDOUT_AND_STDERR = (1, 2)
JOURNAL = "JOURNAL_STREAM"
"""systemd sets it for a service whose output goes to the journal: device and inode of that socket."""


def never_wait(environment: Mapping[str, str], descriptors: Iterable[int] = STDOUT_AND_STDERR) -> None:
    """From now on a line that cannot be written at once is lost. Files stay as they are, and so does what is refused.

    Terminals and pipes are opened again, so that other processes that share them still wait. A socket cannot be: only
    the one to the journal, which is this process's own, is changed.
    """
    for descriptor in descriptors:
        with contextlib.suppress(OSError):  # a closed descriptor; a terminal of another user
            _never_wait(descriptor, environment)


def is_journal(environment: Mapping[str, str], stream: os.stat_result) -> bool:
    """The stream of systemd.exec(5)."""
    return environment.get(JOURNAL) == f"{stream.st_dev}:{stream.st_ino}"


def _never_wait(descriptor: int, environment: Mapping[str, str]) -> None:
    found = os.fstat(descriptor)
    if stat.S_ISSOCK(found.st_mode) and is_journal(environment, found):
        os.set_blocking(descriptor, False)
    if stat.S_ISFIFO(found.st_mode) or os.isatty(descriptor):
        own = os.open(f"/proc/self/fd/{descriptor}", os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
        os.dup2(own, descriptor)
        os.close(own)
