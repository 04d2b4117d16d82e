"""Real-time priority for the processes of the chain: on a loaded computer they run before everything that is not.

The watchdog sees to itself (`canbase_watchdog.realtime`): it is a process that imports nothing of ours.
"""

from __future__ import annotations

import os
from typing import Final

import typer

PRIORITY: Final = {"sim": 45, "driver": 37, "velocity": 35, "action-server": 30}
"""SCHED_FIFO, 1 to 99. The watchdog has 40: above all that it watches, below the simulated drives, which stand in for
hardware. No two alike: under FIFO one that is just starting would hold up another of its priority. Below 50, where the
kernel's threads that serve interrupts run: without them no frame would arrive."""


def raise_priority(part: str) -> None:
    """Of this thread and of those that it starts from now on. Where that is not allowed, one line says so."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY[part]))
    except (OSError, AttributeError) as error:
        hint = "it may be late on a loaded computer; the service needs LimitRTPRIO"
        typer.echo(f"canbase {part}: no real-time priority ({error}): {hint}", err=True)
