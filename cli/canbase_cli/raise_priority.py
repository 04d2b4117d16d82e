"""Real-time priority for the processes of the chain: on a loaded computer they run before everything that is not.

The watchdog sees to itself (`canbase_watchdog.realtime`): it is a process that imports nothing of ours.
"""

from __future__ import annotations

import os
import resource
from contextlib import suppress
from pathlib import Path
from typing import Final

import typer

from canbase_cli.child import CHILD

PRIORITY: Final = {"sim": 45, "driver": 37, "velocity": 35, "action-server": 30}
"""SCHED_FIFO, 1 to 99. The watchdog has 40: above all that it watches, below the simulated drives, which stand in for
hardware. No two alike: under FIFO one that is busy would hold up another of its priority. Below 50, where the
kernel's threads that serve interrupts run: without them no frame would arrive."""


LONGEST_US: Final = 1_000_000
"""A thread with real-time priority that runs for this long without ever waiting ends its process (RLIMIT_RTTIME,
SIGXCPU): it would keep everything else of the computer from running. The threads here wait every 20 ms."""
THREADS: Final = Path("/proc/self/task")


def raise_priority(part: str) -> None:
    """Of all threads that this process has, and of those that they start. Where it is not allowed, it logs one
    line, and none as a part of `canbase up`: that of the watchdog speaks for all.

    For a process that is ready to run: one that is still starting, above others, would hold them up for a second where
    processors are few, and the mux would take a late message of a joystick for its release.
    """
    try:
        resource.setrlimit(resource.RLIMIT_RTTIME, (LONGEST_US, 2 * LONGEST_US))
        for thread in THREADS.iterdir():
            with suppress(ProcessLookupError):  # one that has just ended
                os.sched_setscheduler(int(thread.name), os.SCHED_FIFO, os.sched_param(PRIORITY[part]))
    except (OSError, AttributeError, ValueError) as error:
        hint = "it may be late on a loaded computer; the service needs LimitRTPRIO"
        if CHILD not in os.environ:
            typer.echo(f"canbase {part}: no real-time priority ({error}): {hint}", err=True)
