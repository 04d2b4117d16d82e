"""What the judges allow: by physics, and by the times that the documents state; never by what the product chose."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from canbase_campaign.judged_by import Bounds, hard_ramp_s, jerk_adds_s, lag_s, max_wheel_mps, ramp_s, tolerance_mps
from canbase_campaign.robots import DrawnRobot, campaign_robot, draw_robot
from canbase_campaign.wall_place import far_enough_m
from canbase_config import state_age, stopping
from canbase_hazards import catalogue, stated_times
from canbase_hazards.formula import evaluate
from canbase_sim.plant.base import PlantParameters
from canbase_velocity.base_ready import status_timeout_s
from canbase_watchdog.ladder import RUNGS, Step
from canbase_watchdog.stopper import FRESH_S

ROOT = Path(__file__).resolve().parents[3]
DECIDES = ("canbase_action_server", "canbase_driver", "canbase_runtime", "canbase_velocity", "canbase_watchdog")


def test_the_properties_of_small_worlds_import_nothing_that_decides() -> None:
    """small_worlds is no package of import-linter's; the campaign's judges have their contract in pyproject.toml."""
    tree = ast.parse((ROOT / "virtual_bus_tests/small_worlds/properties.py").read_text(encoding="utf-8"))
    found = {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert {name for name in found if name.startswith(DECIDES)} == {"canbase_velocity.twist"}
    assert not {name for name in found if name.startswith("canbase_config")}


def test_the_stated_times_are_those_of_the_catalogue() -> None:
    rows = {row.id: row.within_s for row in catalogue.load().rows if row.within_s}
    assert stated_times.formulas() == rows
    robot = campaign_robot()
    assert stated_times.stated_s("cable_cut", robot) == evaluate(rows["cable_cut"], robot)
    with pytest.raises(KeyError):
        stated_times.stated_s("process_resumes", robot)


def test_the_rungs_are_those_of_the_page_and_the_ladder_is_no_slower() -> None:
    page = (ROOT / "docs/bus.md").read_text(encoding="utf-8")
    rungs = [float(found) for found in re.findall(r"^\| [1-4] .*for ([0-9.]+) s: rung", page, re.MULTILINE)]
    stated = [
        stated_times.QUICK_STOP_S,
        stated_times.PRE_OPERATIONAL_S,
        stated_times.DISABLE_VOLTAGE_S,
        stated_times.HEARTBEAT_WITHHELD_S,
    ]
    assert rungs == stated
    steps = (Step.QUICK_STOP, Step.PRE_OPERATIONAL, Step.DISABLE_VOLTAGE, Step.HEARTBEAT_WITHHELD)
    for step, stated_s in zip(steps, stated, strict=True):
        assert RUNGS[step].obey_s <= stated_s
    assert f"at most {stated_times.RESET_FEEDBACK_S:g} s old" in page
    assert FRESH_S <= stated_times.RESET_FEEDBACK_S


def test_a_state_is_lost_as_the_page_states() -> None:
    page = (ROOT / "docs/ros_api.md").read_text(encoding="utf-8")
    assert f"`safety_filter/state` {stated_times.STATE_LOST_S:g} s" in page
    assert state_age.STATE_PERIOD_S <= stated_times.STATE_PERIOD_S
    assert state_age.state_timeout_s() <= stated_times.STATE_LOST_S + 1e-9


@pytest.mark.parametrize(("status_hz", "odometry_hz", "control_hz"), [
    (10.0, 50.0, 100.0), (50.0, 1.0, 100.0), (25.0, 30.0, 100.0), (20.0, 7.0, 50.0), (10.0, 10.0, 20.0),
])  # fmt: skip
def test_a_status_is_lost_as_the_rows_state_however_seldom_odometry_is_published(
    status_hz: float, odometry_hz: float, control_hz: float
) -> None:
    """motor_driver/status is published with an odometry sample, and those are whole cycles apart."""
    robot = campaign_robot()
    rates = robot.rates.model_copy(
        update={"status_hz": status_hz, "odometry_hz": odometry_hz, "control_hz": control_hz}
    )
    robot = robot.model_copy(update={"rates": rates})
    period_s = state_age.status_period_s(rates)
    lost_s = stated_times.stated_s("goal_without_the_status_of_the_driver", robot) - 1.0 / robot.action.control_hz
    assert 0.0 <= lost_s - state_age.state_timeout_s(period_s) + 1e-9 <= 2.0 / control_hz + 2e-9
    for row in ("status_lost", "topic_of_a_decision_disturbed"):
        assert stated_times.stated_s(row, robot) >= status_timeout_s(rates) - 1e-9


@pytest.mark.parametrize("drawn", [draw_robot(number) for number in range(10)], ids=lambda drawn: str(drawn.number))
def test_the_product_stops_no_slower_than_physics_says(drawn: DrawnRobot) -> None:
    """The same ramps, worked out twice."""
    robot, limits = drawn.robot, drawn.robot.limits
    for linear, angular in ((0.0, limits.angular_radps), (limits.linear_mps, 0.0), (0.01, 0.0), (0.3, 0.5)):
        assert ramp_s(limits, linear, angular) == pytest.approx(stopping.ramp(limits, linear, angular).time_s)
        hard = stopping.ramp(limits, linear, -angular, emergency=True)
        assert hard_ramp_s(limits, -linear, angular) == pytest.approx(hard.time_s)
    assert jerk_adds_s(limits) == pytest.approx(stopping.jerk_adds_s(limits))
    assert max_wheel_mps(robot) == stopping.max_wheel_mps(robot)


def test_a_watchdog_that_is_set_wide_changes_no_speed_that_is_allowed() -> None:
    robot = campaign_robot()
    wide = robot.watchdog.model_copy(
        update={
            "target_tolerance_mps": 0.2,
            "target_tolerance_share": 0.2,
            "motion_tolerance_mps": 0.5,
            "motion_tolerance_share": 0.5,
            "latency_s": 0.5,
        }
    )
    other = robot.model_copy(update={"watchdog": wide})
    assert tolerance_mps(other) == tolerance_mps(robot)
    for name in ("runaway_mps", "path_radps", "path_s", "stands_mps"):
        assert getattr(Bounds.of(other), name) == getattr(Bounds.of(robot), name)


def test_the_bounds_of_the_sample() -> None:
    bounds = Bounds.of(campaign_robot())
    assert bounds.runaway_mps == pytest.approx(0.05 + 0.3 * 0.8)
    assert 0.5 < bounds.runaway_s < 0.65
    assert bounds.path_s == pytest.approx(1.0)
    assert bounds.stands_mps == pytest.approx(0.15)


@pytest.mark.parametrize(("payload", "bandwidth_radps", "expected_s"), [
    (1.0, 200.0, 0.025), (2.0, 200.0, 0.04), (2.0, 60.0, 0.11), (0.5, 100.0, 0.025),
])  # fmt: skip
def test_a_drive_follows_later_with_load(payload: float, bandwidth_radps: float, expected_s: float) -> None:
    body = PlantParameters(payload_factor=payload, bandwidth_radps=bandwidth_radps)
    assert lag_s(body) == pytest.approx(expected_s)


def test_a_wall_is_farther_from_a_fast_base_and_from_one_whose_scanner_lies() -> None:
    robot = campaign_robot()
    near, far = (far_enough_m(robot, mps, 0.1, lies=False) for mps in (0.1, 0.8))
    assert robot.safety.stop_distance_m < near < far
    assert far_enough_m(robot, -0.8, 0.1, lies=False) == far
    assert far_enough_m(robot, 0.8, 0.1, lies=True) > far
