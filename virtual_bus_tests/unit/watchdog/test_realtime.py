"""What keeps the watchdog punctual, and the one sentence about what this computer forbids."""

from __future__ import annotations

import ctypes
import errno
import os
import subprocess
import sys
from typing import Any

import pytest

from canbase_watchdog import realtime

LOCKED, PRIORITISED = "memory not locked (Cannot allocate memory)", "no real-time priority ([Errno 1] not permitted)"
ADVICE = ": stops may be late under load. Give the service LimitMEMLOCK and LimitRTPRIO."


class FakeLibc:
    """mlockall(2), which answers `result`."""

    def __init__(self, result: int) -> None:
        self.result = result
        self.flags: list[int] = []

    def mlockall(self, flags: int) -> int:
        self.flags.append(flags)
        ctypes.set_errno(errno.ENOMEM)
        return self.result


@pytest.fixture
def scheduled(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """Policies and priorities that were asked for, and allowed."""
    asked: list[tuple[int, int]] = []

    def allow(_pid: int, policy: int, param: os.sched_param) -> None:
        asked.append((policy, param.sched_priority))

    monkeypatch.setattr(os, "sched_setscheduler", allow)
    return asked


@pytest.fixture(autouse=True)
def a_collector_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """The one of the tests goes on."""
    monkeypatch.setattr(realtime, "calm_the_collector", lambda: None)


def libc(monkeypatch: pytest.MonkeyPatch, result: int) -> FakeLibc:
    it = FakeLibc(result)
    monkeypatch.setattr(ctypes, "CDLL", lambda _name, **_keys: it)
    return it


def forbid(*_: Any) -> None:
    raise PermissionError(1, "not permitted")


def test_where_all_is_allowed_nothing_is_said(
    monkeypatch: pytest.MonkeyPatch, scheduled: list[tuple[int, int]]
) -> None:
    it = libc(monkeypatch, 0)
    assert realtime.prepare() is None
    assert it.flags == [1 | 2]  # MCL_CURRENT, MCL_FUTURE
    assert scheduled == [(os.SCHED_FIFO, realtime.PRIORITY)]


@pytest.mark.parametrize(
    ("result", "forbidden", "told"),
    [(-1, False, LOCKED), (0, True, PRIORITISED), (-1, True, f"{LOCKED}; {PRIORITISED}")],
)
@pytest.mark.usefixtures("scheduled")
def test_what_is_forbidden_is_one_sentence_with_what_to_do(
    monkeypatch: pytest.MonkeyPatch, result: int, forbidden: bool, told: str
) -> None:
    libc(monkeypatch, result)
    with monkeypatch.context() as patch:
        for name in ["sched_setscheduler"] * forbidden:
            patch.setattr(os, name, forbid)
        assert realtime.prepare() == told + ADVICE


def test_a_system_without_mlockall_is_no_crash(
    monkeypatch: pytest.MonkeyPatch, scheduled: list[tuple[int, int]]
) -> None:
    monkeypatch.setattr(ctypes, "CDLL", lambda _name, **_keys: object())
    assert str(realtime.prepare()).startswith("memory not locked ('object' object has no attribute 'mlockall')")
    assert len(scheduled) == 1


def test_the_collector_is_off_and_what_exists_is_never_looked_at_again() -> None:
    code = """
import gc
from canbase_watchdog.realtime import calm_the_collector
calm_the_collector()
print(gc.isenabled(), gc.get_freeze_count() > 1000, len(gc.get_objects()) < 1000)
"""
    environment = os.environ | {"_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"}
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert told.stdout.split() == ["False", "True", "True"]
