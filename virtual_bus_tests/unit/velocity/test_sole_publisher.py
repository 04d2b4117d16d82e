"""Two publishers on the topic of one scanner: whose scans count, and from when on none does. Times in s."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from canbase_campaign.lidar import Lidar
from canbase_runtime.stop_cause import StopCause
from canbase_velocity.decision import Action
from canbase_velocity.filter_state import SafetyFilter
from canbase_velocity.placement import Placement
from canbase_velocity.sole_publisher import LATCHED_S, SolePublisher
from canbase_velocity.twist import Twist
from support.filter_inputs import config

ONE, TWO = ("/front",), ("/rear", "/front")
FAR = np.array([(5.0, 0.0), (-4.0, 1.0)])
PLACE = Placement(0.0, 0.0, (1.0, 0.0), (0.0, 1.0))


@pytest.mark.parametrize(("together_s", "latched"), [(0.0, False), (LATCHED_S - 0.5, False), (LATCHED_S, True)])
def test_two_that_were_together_for_long_are_two_scanners(together_s: float, latched: bool) -> None:
    sole = SolePublisher()
    sole.check_publishers(ONE, ONE, 9.5)
    assert sole.problem == ""
    for step in range(round(together_s / 0.5) + 1):
        sole.check_publishers(TWO, TWO, 10.0 + 0.5 * step)
        assert sole.problem.startswith("2 publishers (/front, /rear): give each scanner a topic")
    assert ("until the next start" in sole.problem) is latched
    sole.check_publishers(ONE, ONE, 10.5 + together_s)
    assert bool(sole.problem) is latched
    sole.check_publishers((), (), 11.0 + together_s)
    assert bool(sole.problem) is latched


def graph(now_s: float, starts_s: tuple[float, ...], kept_s: float = 20.0) -> list[str]:
    """The publishers of one driver that is killed and started again at these times: DDS keeps a dead one `kept_s`."""
    ends_s = (*starts_s[1:], math.inf)
    lives = zip(starts_s, ends_s, strict=True)
    return [f"{start_s:g}" for start_s, end_s in lives if start_s <= now_s < end_s + kept_s]


@pytest.mark.parametrize(
    "starts_s", [(0.0, 8.0, 16.0, 24.0, 32.0), (0.0, 29.0, 30.0, 49.0, 60.0), (0.0, 0.5, 1.0, 30.5)]
)
def test_a_driver_that_is_started_again_and_again_is_one_scanner(starts_s: tuple[float, ...]) -> None:
    sole = SolePublisher()
    for step in range(240):
        now_s = 0.5 * step
        keys = graph(now_s, starts_s)
        sole.check_publishers(["/front"] * len(keys), keys, now_s)
        assert bool(sole.problem) is (len(keys) > 1)
    assert sole.problem == ""


class Base:
    """Two scanners on one topic, of one frame_id and one geometry: nothing in their scans tells them apart."""

    def __init__(self) -> None:
        self.filter = SafetyFilter(config(estop=False))
        self.cycle = 0
        self.scanners = (Lidar(), Lidar(seed=2))
        self.topic = "scan"

    def run(self, seconds: float, alive: tuple[int, ...], in_graph: tuple[str, ...]) -> set[tuple[Action, StopCause]]:
        """The decisions of that time."""
        found = set()
        for _ in range(round(seconds / 0.05)):
            self.cycle += 1
            now_s = 10.0 + 0.05 * self.cycle
            if self.cycle % 10 == 0:
                self.filter.on_scan_publishers(self.topic, in_graph, in_graph, now_s)
            number = self.cycle % 2
            if number in alive:
                scan = dataclasses.replace(self.scanners[number].scan(FAR), stamp_ns=round(now_s * 1e9))
                self.filter.on_laser_scan(self.topic, scan, PLACE, now_s, now_s)
            self.filter.accept_command(Twist(0.3, 0.0), now_s)
            decision = self.filter.decide(now_s)
            found.add((decision.action, decision.cause))
        return found


# one scanner ── 2.0: a second one on its topic ── 40: the first one dies, and its half of the world with it
def test_the_scans_of_two_do_not_count_and_neither_do_those_of_the_one_that_is_left() -> None:
    base = Base()
    base.run(1.0, (0,), ONE)
    assert base.run(1.0, (0,), ONE) == {(Action.PASS, StopCause.NONE)}
    base.run(0.6, (0, 1), TWO)
    assert base.run(38.0, (0, 1), TWO) == {(Action.STOP, StopCause.SCAN_INVALID)}
    assert base.run(30.0, (1,), TWO) == {(Action.STOP, StopCause.SCAN_INVALID)}
    assert base.run(30.0, (1,), ONE) == {(Action.STOP, StopCause.SCAN_INVALID)}


def test_a_driver_that_was_killed_is_replaced_when_the_graph_has_forgotten_it() -> None:
    base = Base()
    base.run(2.0, (0,), ONE)
    base.run(0.6, (), ONE)
    base.run(0.6, (0,), TWO)
    assert base.run(19.0, (0,), TWO) == {(Action.STOP, StopCause.SCAN_INVALID)}
    base.run(0.6, (0,), ONE)
    assert base.run(1.0, (0,), ONE) == {(Action.PASS, StopCause.NONE)}


# a scanner's driver that crashes every 8 s, five times ── 20 s after the last crash the graph has one publisher again
def test_a_driver_that_was_restarted_five_times_in_forty_seconds_counts_again() -> None:
    base, starts_s = Base(), (0.0, 8.0, 16.0, 24.0, 32.0, 40.0)
    for step in range(120):
        decisions = base.run(0.5, (0,), tuple(graph(0.5 * step, starts_s)))
        assert (decisions == {(Action.STOP, StopCause.SCAN_INVALID)}) is (8.0 < 0.5 * step < 60.0)
    base.run(1.0, (0,), ("40",))
    assert base.run(2.0, (0,), ("40",)) == {(Action.PASS, StopCause.NONE)}
