"""Real-time priority of the processes: what is asked for, in which order, and what happens where it is refused."""

from __future__ import annotations

import os

import pytest

from canbase_cli.priority import PRIORITY, raise_priority
from canbase_driver import loop
from canbase_watchdog import realtime


def test_drives_come_before_the_watchdog_and_it_before_all_that_it_watches() -> None:
    assert 50 > PRIORITY["sim"] > realtime.PRIORITY
    assert max(PRIORITY["driver"], PRIORITY["velocity"], PRIORITY["action-server"]) < realtime.PRIORITY


def test_no_part_waits_for_another_one_that_is_just_starting() -> None:
    mine = [*PRIORITY.values(), realtime.PRIORITY]
    assert len(set(mine)) == len(mine)


def test_the_cycle_goes_before_all_other_threads_of_the_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    monkeypatch.setattr(os, "sched_getscheduler", lambda pid: os.SCHED_FIFO)
    monkeypatch.setattr(os, "sched_getparam", lambda pid: os.sched_param(PRIORITY["driver"]))
    monkeypatch.setattr(os, "sched_setscheduler", lambda pid, kind, p: asked.append(p.sched_priority))
    loop.lead()
    assert asked == [PRIORITY["driver"] + 1]
    assert PRIORITY["driver"] + 1 < realtime.PRIORITY


def test_without_real_time_priority_the_cycle_stays_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []
    monkeypatch.setattr(os, "sched_getscheduler", lambda pid: os.SCHED_OTHER)
    monkeypatch.setattr(os, "sched_setscheduler", lambda *given: asked.append(given))
    loop.lead()
    assert asked == []


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
