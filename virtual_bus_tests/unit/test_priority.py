"""Real-time priority of the processes: what is asked for, in which order, and what happens where it is refused."""

from __future__ import annotations

import os

import pytest

from canbase_cli.priority import PRIORITY, raise_priority
from canbase_watchdog import realtime


def test_drives_come_before_the_watchdog_and_it_before_all_that_it_watches() -> None:
    assert 50 > PRIORITY["sim"] > realtime.PRIORITY
    assert max(PRIORITY["driver"], PRIORITY["velocity"], PRIORITY["action-server"]) < realtime.PRIORITY


def test_a_part_gets_its_priority(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, int, int]] = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda pid, kind, p: asked.append((pid, kind, p.sched_priority)))
    raise_priority("driver")
    assert asked == [(0, os.SCHED_FIFO, PRIORITY["driver"])]


def test_where_it_is_not_allowed_one_line_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_arguments: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    raise_priority("driver")
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("canbase driver: no real-time priority")
    assert "LimitRTPRIO" in line
