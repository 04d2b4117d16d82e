"""What the driver follows: fresh, finite, and only after a zero; how regular its cycle is."""

from __future__ import annotations

import math

import pytest

from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.motion.velocity_command import VelocityCommand
from canbase_driver.supervision.cycle_stats import CycleStats

FORWARD = Twist2D(0.3, 0.1)


def command(*twists: Twist2D) -> VelocityCommand:
    """These have come at 10.0 s."""
    made = VelocityCommand(timeout_s=0.2)
    for twist in twists:
        made.accept(twist, 10.0)
    return made


def test_before_the_first_command_the_target_is_zero() -> None:
    assert command().target(10.0) == Twist2D.ZERO
    assert not command().report(10.0).fresh
    assert command().motion(10.0) == ""


def test_a_motion_is_followed_only_after_a_zero() -> None:
    assert command(FORWARD).target(10.0) == Twist2D.ZERO
    assert command(Twist2D.ZERO, FORWARD).target(10.0) == FORWARD
    assert command(Twist2D(-0.0, 0.0), FORWARD).target(10.0) == FORWARD
    assert command(Twist2D(0.0, 1e-12), FORWARD).target(10.0) == Twist2D.ZERO


def test_await_zero_forgets_the_zero_that_was_seen() -> None:
    made = command(Twist2D.ZERO, FORWARD)
    made.await_zero()
    assert made.target(10.0) == Twist2D.ZERO
    made.accept(Twist2D.ZERO, 10.1)
    made.accept(FORWARD, 10.1)
    assert made.target(10.1) == FORWARD


@pytest.mark.parametrize(("now_s", "fresh"), [(10.0, True), (10.199, True), (10.201, False), (1e9, False)])
def test_a_command_counts_for_its_timeout(now_s: float, fresh: bool) -> None:
    made = command(Twist2D.ZERO, FORWARD)
    assert made.report(now_s).fresh is fresh
    assert (made.target(now_s) == FORWARD) is fresh
    assert (made.motion(now_s) == "cmd_vel orders 0.300 m/s, 0.100 rad/s") is fresh


def test_a_zero_is_no_motion() -> None:
    assert command(Twist2D.ZERO).motion(10.0) == ""


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", [0, 1])
def test_what_is_not_finite_is_refused_counted_and_changes_nothing(bad: float, place: int) -> None:
    made = command(Twist2D.ZERO, FORWARD)
    values = [0.1, 0.1]
    values[place] = bad
    assert not made.accept(Twist2D(*values), 10.15)
    assert (made.refused, made.target(10.1)) == (1, FORWARD)
    assert made.report(10.15).events == {"commands_refused": 1}
    assert made.report(10.15).age_s == pytest.approx(0.15)


def test_the_worst_lateness_is_that_of_the_last_second() -> None:
    stats = CycleStats(period_s=0.01)
    assert stats.worst_s == 0.0
    for now_s, lateness_s in ((10.0, 0.004), (10.5, 0.002), (10.9, 0.001)):
        stats.note(now_s, lateness_s)
    assert stats.worst_s == 0.004
    stats.note(11.2, 0.0)
    assert stats.worst_s == 0.002
    stats.note(13.0, 0.0)
    assert stats.worst_s == 0.0
    assert stats.cycles == 5


def test_more_than_half_a_period_late_is_an_overrun() -> None:
    stats = CycleStats(period_s=0.01)
    for lateness_s in (0.0, 0.0049, 0.0051, 0.5):
        stats.note(10.0, lateness_s)
    assert stats.overruns == 2
