"""Nobody reads what a part writes: its terminal is held (Ctrl-S), its pipe is full, the journal hangs."""

from __future__ import annotations

import contextlib
import logging
import os
import pty
import subprocess
import sys
import termios
from collections.abc import Iterator

import pytest

from canbase_base.output import never_wait
from canbase_watchdog import log

LOGS_INTO_A_FULL_PIPE = """
import os, sys, threading, time
from rclpy.logging import get_logger
from canbase_base.output import never_wait

cycles = 0

def control_thread():
    global cycles
    while True:
        cycles += 1
        time.sleep(0.01)

threading.Thread(target=control_thread, daemon=True).start()
{call}
get_logger("a part").warning("a line that nobody reads")
before = cycles
time.sleep(0.2)
print(cycles - before, flush=True)
os._exit(0)
"""


@contextlib.contextmanager
def full_pipe() -> Iterator[tuple[int, int]]:
    """Its two ends; nothing more fits in."""
    end, start = os.pipe()
    os.set_blocking(start, False)
    with contextlib.suppress(BlockingIOError):
        while os.write(start, b"." * 4096):
            pass
    os.set_blocking(start, True)
    try:
        yield end, start
    finally:
        os.close(end)
        os.close(start)


def test_a_write_into_a_full_pipe_fails_at_once_and_other_processes_that_share_it_still_wait() -> None:
    with full_pipe() as (_, start):
        shared = os.dup(start)
        never_wait({}, (start,))
        with pytest.raises(BlockingIOError):
            os.write(start, b"a line\n")
        assert os.get_blocking(shared)
        os.close(shared)


def test_a_terminal_that_is_held_is_not_waited_for() -> None:
    keyboard, terminal = pty.openpty()
    try:
        never_wait({}, (terminal,))
        termios.tcflow(terminal, termios.TCOOFF)  # as Ctrl-S does
        with pytest.raises(BlockingIOError):
            os.write(terminal, b"a line\n")
        termios.tcflow(terminal, termios.TCOON)
        assert os.write(terminal, b"a line\n") == 7
    finally:
        os.close(keyboard)
        os.close(terminal)


def test_a_socket_is_left_alone_unless_it_is_the_one_to_the_journal() -> None:
    import socket

    mine, other = socket.socketpair()
    with mine, other:
        descriptor, found = mine.fileno(), os.fstat(mine.fileno())
        never_wait({"JOURNAL_STREAM": f"{found.st_dev}:{found.st_ino + 1}"}, (descriptor,))
        assert os.get_blocking(descriptor)
        never_wait({"JOURNAL_STREAM": f"{found.st_dev}:{found.st_ino}"}, (descriptor,))
        assert not os.get_blocking(descriptor)


def test_a_closed_descriptor_is_no_failure() -> None:
    end, start = os.pipe()
    os.close(end)
    os.close(start)
    never_wait({}, (start,))


def test_the_watchdogs_next_line_tells_how_many_were_lost() -> None:
    with full_pipe() as (end, start):
        never_wait({}, (start,))
        lines = log.Lines(start)
        lines.setFormatter(logging.Formatter("%(levelname)s %(message)s"))
        logger = logging.Logger("watchdog")
        logger.addHandler(lines)
        for rung in ("quick stop", "disable voltage"):
            logger.warning("ladder: %s", rung)
        assert lines.lost == 2
        os.read(end, 1 << 20)
        logger.warning("ladder: %s", "heartbeat withheld")
        logger.warning("all drives at standstill")
        assert os.read(end, 4096).decode() == (
            "WARNING (2 lines before this one were lost: the log did not accept them) ladder: heartbeat withheld\n"
            "WARNING all drives at standstill\n"
        )


def test_a_line_of_ros_that_nobody_reads_does_not_hold_up_the_control_thread() -> None:
    code = LOGS_INTO_A_FULL_PIPE.format(call="never_wait(os.environ)")
    with full_pipe() as (_, start):
        done = subprocess.run(
            [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=start, timeout=20.0, check=True
        )
    assert int(done.stdout) >= 5
