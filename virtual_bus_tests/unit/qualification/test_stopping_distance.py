"""The distance to plan scanner fields with: each term by its key, and a person who walks toward the base."""

from __future__ import annotations

import pytest

from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_qualification.stopping_distance import stopping_distances
from support.made_results import KILLED, PRESSED, collected, never, stop

ROBOT = load_robot(sample("bench")).robot


def with_scan(**changes: object) -> Robot:
    safety = ROBOT.safety.model_copy(update={"scan": ROBOT.safety.scan.model_copy(update=changes)})
    return ROBOT.model_copy(update={"safety": safety})


def test_each_term_and_the_sum() -> None:
    robot = with_scan(required=True, timeout_s=0.3, min_points=1)
    found = collected([stop(PRESSED, 1, 0.5, 0.2), stop(PRESSED, 2, 0.6, 0.19), stop(KILLED, 3, 0.9, 0.42)])
    ordered, failing = stopping_distances(found, robot)
    speed_mps, period_s = robot.limits.linear_mps, 1.0 / robot.rates.command_hz
    assert [term.time_s for term in ordered.terms] == [0.6, 0.3, period_s]
    assert ordered.distance_m == pytest.approx(0.2 + speed_mps * (0.3 + period_s))
    assert ordered.approach_m == pytest.approx(1.6 * (0.6 + 0.3 + period_s))
    assert failing.terms[0].distance_m == 0.42
    assert KILLED in failing.terms[0].source
    assert ["another run" in case.terms[0].source for case in (ordered, failing)] == [True, False]


def test_a_filter_that_waits_for_a_second_scan_adds_it() -> None:
    found = collected([stop(PRESSED, 1, 0.5, 0.2)])
    once, twice = (stopping_distances(found, with_scan(min_points=points))[0] for points in (1, 2))
    assert twice.time_s - once.time_s == pytest.approx(ROBOT.safety.scan.timeout_s)


def test_the_scanner_that_is_missed_last_counts_of_those_that_are_required() -> None:
    slow = ROBOT.safety.scan.model_copy(update={"topic": "scan_rear", "timeout_s": 0.9, "required": False})
    safety = with_scan(required=True, timeout_s=0.2, min_points=1).safety.model_copy(update={"more_scans": (slow,)})
    robot = ROBOT.model_copy(update={"safety": safety})
    found = collected([stop(PRESSED, 1, 0.5, 0.2)])
    assert stopping_distances(found, robot)[0].terms[1].time_s == 0.2


def test_a_base_that_was_faster_than_its_limit_counts_with_its_speed() -> None:
    found = collected([stop(PRESSED, 1, 0.5, 0.2, speed_mps=1.1)])
    assert stopping_distances(found, ROBOT)[0].speed_mps == 1.1


def test_a_stop_that_never_ended_is_no_distance() -> None:
    failing = stopping_distances(collected([stop(KILLED, 1, 0.5, 0.2), never(KILLED, 2)]), ROBOT)
    assert [case.terms[0].distance_m for case in failing] == [0.2]
    assert failing[0].measured.never == 1
    assert stopping_distances(collected([never(KILLED, 2)]), ROBOT) == []
