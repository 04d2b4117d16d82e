"""Keeps the process punctual: memory locked, real-time priority, garbage collected only when nothing turns.

Each of them may be forbidden; the watchdog then runs without it and logs that once.
"""

from __future__ import annotations

import ctypes
import gc
import os
import resource

PRIORITY = 40
"""Below the threads that serve interrupts (50 by default): without them no frame would arrive."""

LONGEST_US = 1_000_000
"""A thread that runs for this long without a wait ends its process (RLIMIT_RTTIME): it would starve the computer."""

_MCL_CURRENT = 1
_MCL_FUTURE = 2


def lock_memory() -> str | None:
    """mlockall(2): no page of this process is swapped out. Returns why not, or None."""
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        failed = libc.mlockall(_MCL_CURRENT | _MCL_FUTURE) != 0
    except (OSError, AttributeError) as error:
        return f"memory not locked ({error})"
    return f"memory not locked ({os.strerror(ctypes.get_errno())})" if failed else None


def raise_priority() -> str | None:
    """SCHED_FIFO for this process. Returns why not, or None."""
    try:
        resource.setrlimit(resource.RLIMIT_RTTIME, (LONGEST_US, 2 * LONGEST_US))
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except (OSError, AttributeError, ValueError) as error:
        return f"no real-time priority ({error})"
    return None


def calm_the_collector() -> None:
    """What exists now is not collected until the next call, and nothing else without a call of ours: no pause in the
    loop. What was left of an earlier life is collected first."""
    gc.unfreeze()
    gc.collect()
    gc.freeze()
    gc.disable()


def prepare() -> str | None:
    """All of it. Returns one sentence for the log when the process stays less punctual than it could be."""
    calm_the_collector()
    missing = [reason for reason in (lock_memory(), raise_priority()) if reason is not None]
    if not missing:
        return None
    return f"{'; '.join(missing)}: stops may be late under load. Give the service LimitMEMLOCK and LimitRTPRIO."
