"""Real-time priority of the processes of the chain: for all threads, and loudly not at all where it is forbidden."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from canbase_cli import raise_priority as priority
from canbase_cli.child import CHILD


@pytest.fixture
def scheduled(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[tuple[int, int, int]]:
    """Thread, policy and priority of each call, in a process of three threads of which the second has just ended."""
    calls: list[tuple[int, int, int]] = []

    def schedule(thread: int, policy: int, parameters: os.sched_param) -> None:
        if thread == 12:
            raise ProcessLookupError
        calls.append((thread, policy, parameters.sched_priority))

    for name in ("11", "12", "13"):
        (tmp_path / name).mkdir()
    monkeypatch.setattr(priority, "THREADS", tmp_path)
    monkeypatch.setattr(os, "sched_setscheduler", schedule)
    return calls


@pytest.mark.parametrize(("part", "level"), [("driver", 37), ("velocity", 35), ("action-server", 30), ("sim", 45)])
def test_every_thread_gets_it(scheduled: list[tuple[int, int, int]], part: str, level: int) -> None:
    priority.raise_priority(part)

    assert sorted(scheduled) == [(11, os.SCHED_FIFO, level), (13, os.SCHED_FIFO, level)]


def test_where_it_is_forbidden_one_line_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def forbidden(thread: int, policy: int, parameters: os.sched_param) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", forbidden)

    monkeypatch.delenv(CHILD, raising=False)
    priority.raise_priority("driver")

    assert capsys.readouterr().err.count("canbase driver: no real-time priority") == 1
    monkeypatch.setenv(CHILD, "driver")
    priority.raise_priority("driver")
    assert capsys.readouterr().err == ""
