"""When a want of usable scans counts like a stop: how long, for which causes. Times in s."""

from __future__ import annotations

import pytest

from canbase_runtime.stop_cause import StopCause
from canbase_velocity.filter_state import NO_SCAN, WITHOUT_SCANS_S, SafetyFilter
from canbase_velocity.twist import Twist
from support.filter_inputs import config, see

FORWARD = Twist(0.3, 0.0)
CYCLE_S = 0.02
TIMEOUT_S = 0.3
"""Of the scanner."""


class Base:
    """A filter at 50 Hz whose emergency stop is free, and a scanner at 10 Hz."""

    def __init__(self, *, required: bool = True) -> None:
        self.filter = SafetyFilter(config(scan=required, estop=False))
        self.cycle, self.scans = 0, True
        self.causes: set[StopCause] = set()

    @property
    def now_s(self) -> float:
        return 10.0 + self.cycle * CYCLE_S

    def run(self, seconds: float, *ahead: tuple[float, float], commanded: bool = True) -> str:
        """What the filter says of its scans at the end."""
        for _ in range(round(seconds / CYCLE_S)):
            self.cycle += 1
            if self.scans and self.cycle % 5 == 0:
                see(self.filter, self.now_s, *ahead)
            if commanded:
                self.filter.accept_command(FORWARD, self.now_s)
            self.causes.add(self.filter.decide(self.now_s).cause)
        return self.filter.without_scans


@pytest.mark.parametrize(("stale_s", "counts"), [
    (0.0, False), (0.5, False), (WITHOUT_SCANS_S - CYCLE_S, False), (WITHOUT_SCANS_S + CYCLE_S, True), (30.0, True),
])  # fmt: skip
def test_scans_that_are_missing_count_from_a_second_on(stale_s: float, counts: bool) -> None:
    base = Base()
    assert base.run(1.0) == ""
    base.scans = False
    assert bool(base.run(TIMEOUT_S + stale_s)) is counts
    base.scans = True
    assert base.run(0.2) == ""


def test_it_says_why() -> None:
    base = Base()
    base.run(1.0)
    base.scans = False
    assert base.run(2.0) == "no usable scan for 1.0 s: scan_stale"


def test_gaps_that_are_each_shorter_do_not_add_up() -> None:
    base = Base()
    for _ in range(5):
        base.scans = True
        base.run(0.5)
        base.scans = False
        assert base.run(TIMEOUT_S + 0.5) == ""


def test_a_command_that_is_late_meanwhile_does_not_begin_the_second_anew() -> None:
    """── no scans for 0.5 s ── no command for 0.3 s ── commands again, still no scans for 0.3 s ── disarmed"""
    base = Base()
    base.run(1.0)
    base.scans = False
    base.run(TIMEOUT_S + 0.5)
    base.run(0.3, commanded=False)
    assert StopCause.COMMAND_STALE in base.causes
    assert base.run(0.3) == "no usable scan for 1.0 s: scan_stale"


def test_an_obstacle_or_a_scanner_that_is_not_required_is_no_want_of_scans() -> None:
    base = Base()
    assert base.run(3.0, (0.45, 0.0)) == ""
    assert StopCause.OBSTACLE in base.causes
    base = Base(required=False)
    base.scans = False
    assert base.run(5.0) == ""


def test_every_cause_of_a_scanner_counts() -> None:
    assert {cause for cause in StopCause if cause.value.startswith("scan_")} == set(NO_SCAN)
