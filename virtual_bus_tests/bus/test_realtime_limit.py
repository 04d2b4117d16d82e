"""A thread with real-time priority that spins is ended by its own limit, before it starves the computer."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

pytestmark = [pytest.mark.bus, pytest.mark.needs_root("raise a thread to real-time priority")]

SPINS = "while True: pass"
RAISE = {
    "driver": "from canbase_cli.raise_priority import raise_priority; raise_priority('driver')",
    "watchdog": "from canbase_watchdog.realtime import raise_priority; assert raise_priority() is None",
}


def _may_be_realtime() -> bool:
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        os.sched_setscheduler(0, *before)
    except OSError:
        return False
    return True


@pytest.fixture(autouse=True)
def realtime_priority() -> None:
    """Containers may deny it to root as well."""
    if not _may_be_realtime():
        pytest.skip("NOT CHECKED: no real-time priority here (CAP_SYS_NICE), so RLIMIT_RTTIME is not tested")


@pytest.mark.parametrize("part", list(RAISE))
def test_a_thread_that_spins_is_ended(part: str) -> None:
    began_s = time.monotonic()
    child = subprocess.run(
        [sys.executable, "-c", f"{RAISE[part]}\n{SPINS}"],
        env=os.environ | {"_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"}, timeout=60.0, check=False,
    )  # fmt: skip
    assert child.returncode == -signal.SIGXCPU
    assert time.monotonic() - began_s < 50.0


@pytest.mark.parametrize("part", list(RAISE))
def test_a_thread_that_waits_is_not(part: str) -> None:
    """Busy for 2 s in all, with a wait every 20 ms."""
    turns = """
import time
busy = time.thread_time() + 1.5
while time.thread_time() < busy:
    until = time.thread_time() + 0.02
    while time.thread_time() < until: pass
    time.sleep(0.001)
"""
    child = subprocess.run(
        [sys.executable, "-c", RAISE[part] + turns],
        env=os.environ | {"_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"}, timeout=60.0, check=False,
    )  # fmt: skip
    assert child.returncode == 0
