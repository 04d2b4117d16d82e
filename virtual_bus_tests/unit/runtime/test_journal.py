"""What goes into the systemd journal: one datagram an entry, and never an exception or a wait."""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from canbase_runtime.journal import EVENT_LOG_BURST, EVENT_LOG_PER_S, EventLog, Journal
from canbase_runtime.log_priority import Priority
from canbase_watchdog.log import formatter

UNDER_SYSTEMD = {"JOURNAL_STREAM": "8:12345"}


@pytest.fixture
def path(tmp_path: Path) -> str:
    return str(tmp_path / "socket")


@pytest.fixture
def listener(path: str) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as bound:
        bound.bind(path)
        bound.setblocking(False)
        yield bound


def test_an_entry_has_message_priority_part_and_fields(path: str, listener: socket.socket) -> None:
    Journal("motor_driver", UNDER_SYSTEMD, path).write("LATCHED", Priority.WARNING, cause="drive fault", node_id=1)
    assert listener.recv(1000).decode().splitlines() == [
        "MESSAGE=LATCHED",
        "PRIORITY=4",
        "SYSLOG_IDENTIFIER=canbase",
        "CANBASE_PART=motor_driver",
        "CANBASE_CAUSE=drive fault",
        "CANBASE_NODE_ID=1",
    ]


def test_a_line_break_cannot_make_a_field_of_its_own(path: str, listener: socket.socket) -> None:
    Journal("x", UNDER_SYSTEMD, path).write("one\nPRIORITY=0", Priority.INFO)
    assert listener.recv(1000).decode().splitlines()[:2] == ["MESSAGE=one\\nPRIORITY=0", "PRIORITY=6"]


def test_outside_of_systemd_nothing_is_sent(path: str, listener: socket.socket) -> None:
    Journal("x", {}, path).write("text", Priority.INFO)
    with pytest.raises(BlockingIOError):
        listener.recv(1000)


def test_a_journal_that_is_gone_or_full_costs_nothing(path: str, listener: socket.socket) -> None:
    Journal("x", UNDER_SYSTEMD, path + "gone").write("text", Priority.INFO)
    for _ in range(2000):
        Journal("x", UNDER_SYSTEMD, path).write("text " * 100, Priority.INFO)


class HeardLogger:
    """ROS's logger as far as it is used."""

    def __init__(self) -> None:
        self.lines: list[tuple[str, str]] = []

    def error(self, message: str) -> None:
        self.lines.append(("ERROR", message))

    def warning(self, message: str) -> None:
        self.lines.append(("WARN", message))

    def info(self, message: str) -> None:
        self.lines.append(("INFO", message))


@pytest.mark.parametrize(
    ("priority", "severity"),
    [(Priority.ERROR, "ERROR"), (Priority.WARNING, "WARN"), (Priority.NOTICE, "INFO"), (Priority.INFO, "INFO")],
)
def test_a_voice_is_heard_in_the_log_of_ros_and_in_the_journal(
    path: str, listener: socket.socket, priority: Priority, severity: str
) -> None:
    logger = HeardLogger()
    EventLog(logger, Journal("velocity_mux", UNDER_SYSTEMD, path)).write("nav drives", priority, active="nav")
    assert logger.lines == [(severity, "nav drives")]
    entry = listener.recv(1000).decode().splitlines()
    assert entry[:2] == ["MESSAGE=nav drives", f"PRIORITY={int(priority)}"]
    assert entry[3:] == ["CANBASE_PART=velocity_mux", "CANBASE_ACTIVE=nav"]


def test_a_flood_of_lines_is_cut_off_and_errors_are_not(path: str, monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 5.0
    monkeypatch.setattr("canbase_runtime.journal.time.monotonic", lambda: now_s)
    logger = HeardLogger()
    log = EventLog(logger, Journal("velocity_mux", {}, path))
    for _ in range(10_000):
        log.write("lock pause is set", Priority.NOTICE)
    assert len(logger.lines) == EVENT_LOG_BURST
    log.write("defect", Priority.ERROR)
    assert logger.lines[-1] == ("ERROR", "defect")
    now_s += 1.5 / EVENT_LOG_PER_S
    log.write("nav drives", Priority.INFO)
    assert logger.lines[-2:] == [("WARN", "9800 lines omitted: more than 20 each second"), ("INFO", "nav drives")]


@pytest.mark.parametrize(
    ("level", "prefix"),
    [(logging.DEBUG, "<7>"), (logging.INFO, "<6>"), (logging.WARNING, "<4>"), (logging.ERROR, "<3>")],
)
def test_the_watchdogs_lines_have_a_priority_under_systemd_and_a_time_elsewhere(level: int, prefix: str) -> None:
    record = logging.LogRecord("canbase.watchdog", level, "f.py", 1, "tripped\nnow", None, None)
    with socket.socket() as some:
        stderr = os.fstat(some.fileno())
    stream = {"JOURNAL_STREAM": f"{stderr.st_dev}:{stderr.st_ino}"}
    assert formatter(stream, stderr).format(record) == f"{prefix}canbase.watchdog: tripped now"
    for other in ({}, UNDER_SYSTEMD):
        assert formatter(other, stderr).format(record).endswith("canbase.watchdog: tripped\nnow")
