"""Keys that depend on each other: a file is refused just below the least value of each row, with that value."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from canbase_campaign.robots import EDGES, at_edges, draw_robot
from canbase_config.errors import ConfigError, Loc
from canbase_config.load import load_robot, sample
from canbase_config.profile_file import PROFILE_SCHEMA
from canbase_config.reserves import COUNTS, RESERVES, WITHOUT_RESERVE, Reserve, at, rounded_up
from canbase_config.robot import Rates, Robot
from canbase_config.schema import Schema
from canbase_config.state_age import status_period_s

SLOW: dict[str, Any] = {"control_hz": 20.0, "command_hz": 20.0, "odometry_hz": 5.0}
FAST: dict[str, Any] = {"control_hz": 200.0, "command_hz": 100.0, "odometry_hz": 100.0}
"""Rates at both ends of their ranges."""
NEAR = (1.5, 1.1, 1.01, 1.0001, 1.0, 0.9999, 0.99, 0.9, 0.5)


def bench(rates: dict[str, Any], counts: int) -> dict[str, Any]:
    """The values of the bench robot with these rates, and everything else long and wide enough for them."""
    values = load_robot(sample("bench")).robot.model_dump()
    values["rates"] |= rates
    values["drives"] = [{**drive, "counts_per_motor_rev": counts} for drive in values["drives"]]
    values["timeouts"] |= dict.fromkeys(("command_s", "lease_s", "feedback_s", "watchdog_s"), 0.5)
    values["timeouts"] |= {"drive_heartbeat_s": 1.0, "odometry_s": 1.0}
    values["watchdog"] |= {"travel_tolerance_m": 0.0625, "motion_missing_m": 0.1, "motion_missing_s": 0.5}
    values["safety"] |= {"command_timeout_s": 0.5, "reaction_s": 0.5}
    return values


def put(values: dict[str, Any], loc: Loc, value: float) -> None:
    for part in loc[:-1]:
        values = values[part]  # type: ignore[index]
    values[loc[-1]] = value  # type: ignore[index]


def in_range(key: str, value: float) -> bool:
    """Whether the range of the key itself, which is checked before, allows it."""
    low = {
        "watchdog.motion_missing_m": 0.001,
        "watchdog.travel_tolerance_m": 0.005,
        "timeouts.feedback_s": 0.02,
        "safety.reaction_s": 0.01,
    }
    return value >= low.get(key, 0.05)


@pytest.mark.parametrize("rates", [SLOW, FAST], ids=["slow", "fast"])
@pytest.mark.parametrize("counts", [6, 30])
@pytest.mark.parametrize("row", RESERVES, ids=lambda row: f"{row.key} {row.others[0]}")
def test_a_file_passes_down_to_the_least_value_of_each_row_and_no_further(
    row: Reserve, counts: int, rates: dict[str, Any]
) -> None:
    values = bench(rates, counts)
    robot = Robot.model_validate(values)
    (loc,) = row.keys(robot)
    needed = max(other.least(robot) for other in RESERVES if loc in other.keys(robot))
    for share in NEAR:
        given = needed * share
        if not in_range(row.key, given):
            continue
        put(values, loc, given)
        if share >= 1.0:
            Robot.model_validate(values)
        else:
            with pytest.raises(ValidationError, match=f"{row.key} .* is too little for"):
                Robot.model_validate(values)


@pytest.mark.parametrize("row", RESERVES, ids=lambda row: f"{row.key} {row.others[0]}")
def test_the_value_that_the_message_names_is_accepted_and_it_is_the_least_one(row: Reserve) -> None:
    for cycles in (20.0, 37.0, 100.0, 173.0, 200.0):
        values = bench({"control_hz": cycles, "command_hz": 33.0, "odometry_hz": 7.0}, counts=6)
        robot = Robot.model_validate(values)
        (loc,) = row.keys(robot)
        needed = max(other.least(robot) for other in RESERVES if loc in other.keys(robot))
        named = rounded_up(needed)
        assert needed <= named + 1e-9
        assert named <= 1.011 * needed
        put(values, loc, max(named, 0.05) if row.key.endswith("_s") else named)
        Robot.model_validate(values)


def test_the_least_values_of_the_sample_robot() -> None:
    robot = load_robot(sample("bench")).robot
    least = {(row.key, row.others[0]): row.least(robot) for row in RESERVES}
    increment_m = math.tau * robot.base.wheel_radius_m / (robot.drives[0].gear_ratio * 4096)

    assert least == pytest.approx(
        {
            ("timeouts.command_s", "rates.command_hz"): 0.09,
            ("timeouts.lease_s", "rates.command_hz"): 0.09,
            ("safety.command_timeout_s", "rates.command_hz"): 0.09,
            ("mux.sources.….timeout_s", "action.control_hz"): 0.14,
            ("timeouts.odometry_s", "rates.odometry_hz"): 0.11,
            ("timeouts.watchdog_s", "rates.control_hz"): 0.13,
            ("timeouts.feedback_s", "rates.control_hz"): 0.05,
            ("timeouts.drive_heartbeat_s", "rates.control_hz"): 0.05,
            ("timeouts.drive_heartbeat_s", "watchdog.loop_late_s"): 0.15,
            ("safety.reaction_s", "rates.control_hz"): 0.02,
            ("watchdog.travel_tolerance_m", COUNTS): 4.0 * increment_m,
            ("watchdog.motion_missing_m", COUNTS): 8.0 * increment_m,
            ("safety.footprint.left_m", "base.track_m"): 0.25,
            ("safety.footprint.right_m", "base.track_m"): 0.25,
            ("safety.footprint.front_m", "base.wheel_radius_m"): robot.base.wheel_radius_m,
            ("safety.footprint.rear_m", "base.wheel_radius_m"): robot.base.wheel_radius_m,
        }
    )


def test_encoders_of_twelve_increments_on_a_wheel_without_gear_are_refused_with_the_tolerance_that_fits() -> None:
    values = load_robot(sample("bench")).robot.model_dump()
    values["drives"] = [{**drive, "counts_per_motor_rev": 12, "gear_ratio": 1.0} for drive in values["drives"]]

    with pytest.raises(ValidationError, match=r"travel_tolerance_m \(0.05\) is too little .* at least 0\.\d+"):
        Robot.model_validate(values)


def test_the_drive_that_is_named_is_the_one_with_the_coarsest_encoder(tmp_path: Path) -> None:
    """Its gear ratio is wrong, and stands in the second of two drives."""
    file = tmp_path / "robot.yaml"
    first, second = "gear_ratio: 20.0              #", "gear_ratio: 20.0\n"
    text = sample("bench").read_text(encoding="utf-8")
    assert first in text
    assert text.count(second) == 1
    file.write_text(text.replace(second, "gear_ratio: 0.085\n"), encoding="utf-8")
    with pytest.raises(ConfigError, match=r"drives\[1\]\.(counts_per_motor_rev|gear_ratio): ") as told:
        load_robot(file)
    assert "or change drives.counts_per_motor_rev or drives.gear_ratio" in str(told.value)


def test_a_footprint_that_leaves_a_wheel_out_is_refused_but_for_a_base_that_skids() -> None:
    values = load_robot(sample("bench")).robot.model_dump()
    values["safety"]["footprint"]["right_m"] = 0.2
    with pytest.raises(
        ValidationError, match=r"right_m \(0\.2\) is too little for the right wheel: at least 0\.25 \(base"
    ):
        Robot.model_validate(values)
    values["safety"]["footprint"]["left_m"] = 0.2
    with pytest.raises(ValidationError, match=r"left_m \(0\.2\) .*; likewise .*right_m \(0\.2\): at least"):
        Robot.model_validate(values)
    more = [{**drive, "joint": f"{drive['joint']}_rear", "node_id": drive["node_id"] + 2} for drive in values["drives"]]
    values["drives"] = [*values["drives"], *more]
    Robot.model_validate(values)


def test_a_source_of_another_topic_may_have_any_timeout() -> None:
    values = load_robot(sample("bench")).robot.model_dump()
    values["mux"]["sources"]["joystick"]["timeout_s"] = 0.05
    Robot.model_validate(values)

    values["mux"]["sources"]["action"]["timeout_s"] = 0.139
    with pytest.raises(ValidationError, match=r"cmd_vel_action, where that is its topic, at the mux: at least 0\.14 "):
        Robot.model_validate(values)
    values["mux"]["sources"]["action"]["topic"] = "cmd_vel_other"
    Robot.model_validate(values)


@pytest.mark.parametrize("number", range(24))
def test_a_drawn_robot_with_all_keys_at_their_edges_is_one_that_the_check_accepts(number: int) -> None:
    robot = at_edges(draw_robot(number).robot)

    for row in EDGES:
        for loc in row.keys(robot):
            assert row.least(robot) <= at(robot, loc) + 1e-9
    coarse = [row for row in RESERVES if COUNTS in row.others]
    used = max(row.least(robot) / at(robot, loc) for row in coarse for loc in row.keys(robot))
    assert 0.3 < used <= 1.0 + 1e-6  # as coarse as whole increments allow


def times_and_rates() -> set[str]:
    """Every key of robot.yaml and of a drive profile whose name says that it is a time or a rate, by the models."""
    sections = (*Schema(Robot).sections, *PROFILE_SCHEMA.sections)
    return {f"{path}.{key}" for path, keys in sections for key in keys if key.endswith(("_s", "_ms", "_us", "_hz"))}


def test_each_time_and_rate_has_a_rule_or_the_reason_why_it_has_none() -> None:
    with_rule = {key for row in RESERVES for key in (row.key, *row.others)}
    assert len(times_and_rates()) > 40
    assert times_and_rates() - with_rule - set(WITHOUT_RESERVE) == set()
    assert set(WITHOUT_RESERVE) - times_and_rates() == set()
    assert set(WITHOUT_RESERVE) & with_rule <= {"mux.sources.….timeout_s"}
    assert all(len(reason) > 20 for reason in WITHOUT_RESERVE.values())


@pytest.mark.parametrize(
    ("control_hz", "odometry_hz", "status_hz", "period_s"),
    [(100.0, 50.0, 10.0, 0.1), (100.0, 50.0, 50.0, 0.02), (100.0, 5.0, 50.0, 0.2), (20.0, 100.0, 50.0, 0.05),
     (70.0, 20.0, 20.0, 4 / 70)],
)  # fmt: skip
def test_the_status_of_the_driver_is_not_published_more_often_than_odometry(
    control_hz: float, odometry_hz: float, status_hz: float, period_s: float
) -> None:
    rates = Rates(control_hz=control_hz, odometry_hz=odometry_hz, status_hz=status_hz)
    assert status_period_s(rates) == pytest.approx(period_s)
