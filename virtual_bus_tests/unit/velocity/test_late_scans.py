"""A base that drives at a wall while its scans arrive late, by the clock of this computer and by another one.

Footprint 0.3 m to all sides, 0.8 m/s at most, stop distance 0.15 m, blind_mps 0.15 m/s, timeout 0.3 s,
10 scans a second. Times in s.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from canbase_campaign.lidar import Fault, Late, Lidar
from canbase_runtime.stop_cause import StopCause
from canbase_velocity.filter_state import SafetyFilter
from canbase_velocity.placement import Placement
from canbase_velocity.safety_filter import FilterConfig
from canbase_velocity.scan import Scan
from canbase_velocity.sweep import fastest_mps
from canbase_velocity.twist import ZERO, Twist
from support.filter_world import FilterWorld, robot_with

WALL = np.array([(2.0, y_m / 20.0) for y_m in range(-20, 21)] + [(-3.0, 0.5)])
AHEAD = Twist(0.8, 0.0)


def world(wall_m: float = 2.0, **scan: object) -> FilterWorld:
    made = FilterWorld(robot_with(scan={"required": True, **scan}), np.add(WALL, (wall_m - 2.0, 0.0)))
    made.lidar = Lidar()
    return made


def stamped(by_s: float) -> Fault:
    """Its stamps are off by so much."""
    return lambda scan: dataclasses.replace(scan, stamp_ns=(scan.stamp_ns or 0) + round(by_s * 1e9))


def detail(made: FilterWorld) -> str:
    assert made.decision is not None
    return made.decision.detail


# sound for 0.5 s ── each scan is handed out later, with the stamp of its measurement: a queue in the scanner's driver
@pytest.mark.parametrize("per_s", [0.1, 0.3, 1.0, 100.0])
@pytest.mark.parametrize("most_s", [1.0, 3.0])
@pytest.mark.parametrize("same_clock", [True, False])
def test_scans_that_come_late_do_not_lead_into_the_wall(same_clock: bool, most_s: float, per_s: float) -> None:
    """10 scans a second, and each one is new, noisy and complete."""
    made = world(6.0, same_clock=same_clock)  # time enough for a queue to grow
    made.run(AHEAD, 0.5)
    made.fault = Late(most_s, per_s)
    assert made.run(AHEAD, 12.0) > 0.1
    if most_s == 3.0 and per_s >= 0.3:
        assert made.decision is not None
        assert made.decision.cause is StopCause.SCAN_STALE
        assert "delayed by" in detail(made)


@pytest.mark.parametrize("late_s", [0.4, 1.0, 5.0])
def test_scans_that_were_always_late_move_nothing_and_a_restart_changes_nothing(late_s: float) -> None:
    made = world()
    made.fault = Late(late_s)
    made.scans = False
    made.run(ZERO, late_s + 0.2)
    made.scans = True
    for _ in range(3):
        made.run(AHEAD, 8.0)
        assert detail(made).startswith(f"scan: delayed by {late_s:.2f} s (limit 0.30 s, same_clock true)")
        made.filter = SafetyFilter(FilterConfig.of(made.robot))
    assert made.path_m == 0.0


# the scanner is sound ── its scans are a second late for eleven minutes and more ── they are recent again
@pytest.mark.parametrize("same_clock", [True, False])
def test_a_delay_that_lasts_is_not_forgotten_and_ends_with_scans_that_are_recent_again(same_clock: bool) -> None:
    story = Slow(same_clock)
    assert story.drives(0.02, 5.0)
    for _ in range(70):
        assert not story.drives(1.0, 10.0)
    assert story.drives(0.02, 2.0)


# a driver that does a little less than its scanner sends
@pytest.mark.parametrize("per_s", [0.1e-3, 0.5e-3, 0.9e-3, 2e-3, 5e-3])
@pytest.mark.parametrize("same_clock", [True, False])
def test_a_queue_of_scans_that_grows_slowly_is_never_used_above_the_timeout(same_clock: bool, per_s: float) -> None:
    story = Slow(same_clock)
    for step in range(40):
        delay_s = 0.021 + 0.0097 * step
        story.at_s += 0.0097 / per_s
        assert story.drives(delay_s, 1.0) is (delay_s <= (0.3 if same_clock else 0.321))


@pytest.mark.parametrize(("by_s", "why"), [
    (0.05, ""), (0.2, "stamped in the future by 0.20 s"), (10.0, "stamped in the future by 10.00 s"),
    (-0.2, ""), (-0.5, "delayed by 0.50 s"), (-100.0, "delayed by 100.00 s"),
])  # fmt: skip
def test_a_scanner_with_another_clock_is_not_used_unless_its_key_says_so(by_s: float, why: str) -> None:
    made = world()
    made.fault = stamped(by_s)
    made.run(AHEAD, 1.2)
    assert why in detail(made)
    assert (made.path_m == 0.0) is bool(why)


@pytest.mark.parametrize("by_s", [-100.0, 0.0, 10.0])
def test_where_the_age_of_scans_is_unknown_the_base_is_no_faster_than_where_it_sees_nothing(by_s: float) -> None:
    made = world(same_clock=False)
    made.fault = stamped(by_s)
    fastest = 0.0
    for _ in range(100):
        assert made.run(AHEAD, 0.1) > 0.1
        assert made.decision is not None
        fastest = max(fastest, fastest_mps(made.box, made.decision.twist))
        if made.path_m < 1.0:
            assert detail(made).startswith("how old the scans on scan are is unknown (same_clock false): ")
    assert 0.14 < fastest <= 0.15 + 1e-9


def test_a_second_scanner_whose_age_is_known_lets_the_base_drive_where_it_looks() -> None:
    robot = robot_with(more_scans=[{"required": True, "topic": "rear", "same_clock": False}])
    made, lidar = SafetyFilter(FilterConfig.of(robot)), Lidar()
    for step in range(10):
        now_s = 0.1 * step
        for scanner in robot.safety.scans:
            scan = dataclasses.replace(lidar.scan(WALL), stamp_ns=round(now_s * 1e9))
            made.on_laser_scan(scanner.topic, scan, Placement.of(scanner), now_s, now_s)
        made.accept_command(AHEAD, now_s)
        decision = made.decide(now_s)
    assert decision.twist == AHEAD


@pytest.mark.parametrize("by_s", [-0.05, -100.0])
def test_a_scanner_whose_clock_is_set_back_loses_scans_until_they_are_recent(by_s: float) -> None:
    made = world()
    made.run(AHEAD, 0.5)
    made.fault = lambda scan: stamped(by_s - 0.1)(scan)
    made.run(AHEAD, 0.5)
    (scanner,) = made.filter.inputs(made.now_s).scans
    assert scanner.dropped == (1 if by_s == -0.05 else 5)


class Slow:
    """A filter without a world, for hours: two scans a second, each with a command."""

    def __init__(self, same_clock: bool) -> None:
        self.robot = robot_with(blind_mps=0.15, scan={"required": True, "same_clock": same_clock})
        self.filter, self.lidar = SafetyFilter(FilterConfig.of(self.robot)), Lidar()
        self.at_s = 0.0

    def drives(self, delay_s: float, seconds: float) -> bool:
        """Each scan arrives so late; whether the base may move at the end."""
        scanner = self.robot.safety.scan
        for _ in range(round(seconds / 0.5)):
            self.at_s += 0.5
            now_s = self.at_s + delay_s
            scan: Scan = dataclasses.replace(self.lidar.scan(WALL), stamp_ns=round(self.at_s * 1e9))
            self.filter.on_laser_scan(scanner.topic, scan, Placement.of(scanner), now_s, now_s)
            self.filter.accept_command(Twist(0.1, 0.0), now_s)
            moves = not self.filter.decide(now_s).twist.is_zero
        return moves
