"""The watchdog's loop acts just when a timeout runs out, also while it takes in frames. Its clock is made up.

ticks     |    |    |    |        every 5 ms
timeout          x                acted on within two turns, not at the next tick
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import pytest

from canbase_watchdog.bus_health import BusHealth
from canbase_watchdog.ladder import Step
from canbase_watchdog.loop import TICK_S, Loop
from canbase_watchdog.trip_cause import FINE
from canbase_watchdog.watchdog import Answer, State, Status

START_S = 1000.0
TURN_S = 0.0004
"""What taking in the frames that wait lasts here."""


class Machine:
    """A computer with a clock that runs only while something is done, a bus that is never quiet, and a watchdog."""

    status = Status(State.WATCHING, FINE, Step.NONE, True, (0, Answer.NONE))
    dropped_frames, datagrams_dropped, keeps_relay = 0, 0, True
    has_unreported_flag, request_problem = False, ""

    def __init__(self, expires_at: float) -> None:
        self.now_s = START_S
        self.expires_at = expires_at
        self.ticks: list[float] = []
        self.health = BusHealth()
        self.refused_leases: dict[Any, int] = {}

    def monotonic(self) -> float:
        return self.now_s

    def select(self, _read: Any, _write: Any, _error: Any, timeout_s: float) -> None:
        """Somebody always says something after 0.7 ms."""
        self.now_s += min(timeout_s, 0.0007)

    def fileno(self) -> int:
        return 0

    def receive(self, *_now_s: float) -> list[Any]:
        self.now_s += TURN_S / 2.0
        return []

    def on_bus(self, _failed_since: float, _errors: int) -> None:
        """All is well."""

    def expire(self, _now_s: float) -> list[Any]:
        return []

    def next_expiry(self, since: float) -> float:
        return self.expires_at if self.expires_at > since else math.inf

    def tick(self, now_s: float) -> list[Any]:
        self.ticks.append(now_s)
        return []


@pytest.mark.parametrize("late_us", range(0, 10_000, 97))
def test_a_timeout_is_acted_on_when_it_runs_out_whatever_the_loop_does(
    monkeypatch: pytest.MonkeyPatch, late_us: int
) -> None:
    machine = Machine(START_S + 0.02 + late_us * 1e-6)
    monkeypatch.setattr("canbase_watchdog.loop.time", SimpleNamespace(monotonic=machine.monotonic))
    monkeypatch.setattr("canbase_watchdog.loop.suspended_s", lambda: 0.0)
    monkeypatch.setattr("canbase_watchdog.loop.select", SimpleNamespace(select=machine.select))
    anything = cast(Any, machine)
    loop = Loop(anything, anything, anything)
    while machine.now_s < START_S + 0.05:
        loop._turn()
    first = next(at for at in machine.ticks if at >= machine.expires_at)
    assert first - machine.expires_at <= 2.0 * TURN_S + 1e-9
    assert len(machine.ticks) <= 0.05 / TICK_S + 2
