"""A scanner that sees less far than the base needs to stop: what lies beyond its range does not count as free."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_campaign.lidar import Lidar
from canbase_config.robot import Robot
from canbase_config.stop_checks import needed_range_m
from canbase_runtime.stop_cause import StopCause
from canbase_velocity.clearance import NOWHERE, Field, ScanReader
from canbase_velocity.decision import Action
from canbase_velocity.obstacle import Geometry, Sight, range_share
from canbase_velocity.placement import Placement
from canbase_velocity.ramp import Moving, stop_way_s
from canbase_velocity.safety_filter import decide
from canbase_velocity.scan import Scan
from canbase_velocity.sweep import fastest_mps
from canbase_velocity.twist import ZERO, Twist
from support.filter_inputs import BOX, HOLD_S, LIMITS, config, given_that
from support.filter_world import FilterWorld, robot_with

PLACE = Placement(0.0, 0.0, (1.0, 0.0), (0.0, 1.0))


def fast_robot(linear_mps: float, deceleration_mps2: float, side_m: float, **scan: object) -> Robot:
    values = robot_with(uncommissioned_mps=5.0, scan={"required": True, **scan}).model_dump()
    values["limits"] |= {
        "linear_mps": linear_mps,
        "deceleration_mps2": deceleration_mps2,
        "acceleration_mps2": 1.5,
        "emergency_deceleration_mps2": 2.0 * deceleration_mps2,
    }
    values["safety"] |= {
        "slow_distance_m": 0.15 + linear_mps**2 / 2.0 / deceleration_mps2,
        "footprint": dict.fromkeys(("front_m", "rear_m", "left_m", "right_m"), side_m),
    }
    return Robot.model_validate(values)


def seen_up_to(range_m: float, scan: Scan) -> Scan:
    ranges_m = np.array(scan.ranges_m, dtype=np.float64)
    ranges_m[ranges_m > range_m] = math.inf
    return dataclasses.replace(scan, ranges_m=ranges_m, range_max_m=range_m)


@pytest.mark.parametrize(
    ("linear_mps", "deceleration_mps2", "range_m", "side_m"),
    [(3.0, 1.0, 4.0, 0.25), (3.0, 1.5, 4.0, 0.6), (3.0, 1.5, 3.0, 0.6), (2.0, 1.0, 2.0, 0.25), (3.0, 1.5, 1.5, 0.25)],
)
def test_a_wall_beyond_the_range_never_makes_the_base_brake_hard(
    linear_mps: float, deceleration_mps2: float, range_m: float, side_m: float
) -> None:
    """The wall is 9 m away, and appears at `range_m`: the ordinary ramp stops the base before it."""
    robot = fast_robot(linear_mps, deceleration_mps2, side_m)
    y_m = np.arange(-6.0, 6.0, 0.05)
    world = FilterWorld(robot, np.column_stack((np.full(y_m.shape, 9.0), y_m)))
    world.lidar, world.fault = Lidar(), lambda scan: seen_up_to(range_m, scan)
    assert world.run(Twist(linear_mps, 0.0), 9.0) > 0.1
    assert world.emergencies == 0


def sight(range_m: float, age_s: float = 0.0) -> Sight:
    return Sight(NOWHERE, (Field(PLACE, -math.pi, 2.0 * math.pi, 0.0, range_m),), age_s)


def farthest_m(speed_mps: float, age_s: float) -> float:
    """Of the corner ahead, by hand: from 1 m/s 0.1 m stop distance, 0.12 s and the scan's age, 0.25 m of ramp."""
    moves_s = age_s + HOLD_S + 0.1
    return math.hypot(0.4 + 0.1 + speed_mps * moves_s + speed_mps**2 / 2.0 / LIMITS.deceleration_mps2, 0.3)


@pytest.mark.parametrize("age_s", [0.0, 0.1, 0.3, 0.6])
@pytest.mark.parametrize("speed_mps", [0.2, 0.3, 0.5, 0.8, 0.999, 1.0])
@pytest.mark.parametrize("beside_m", [-0.1, -0.01, -1e-6, 1e-6, 0.01, 0.1])
def test_the_command_passes_where_the_range_is_just_enough_for_a_scan_of_this_age(
    age_s: float, speed_mps: float, beside_m: float
) -> None:
    seen = sight(farthest_m(speed_mps, age_s) + beside_m, age_s)
    decision = decide(given_that(command=Twist(speed_mps, 0.0), sight=seen), config())
    assert (decision.twist.linear_mps == speed_mps) is (beside_m > 0.0)
    assert (decision.cause, decision.action) == (
        (StopCause.NONE, Action.PASS) if beside_m > 0.0 else (StopCause.BLIND, Action.LIMIT)
    )
    slowest_mps = min(speed_mps, 0.15)
    assert decision.twist.linear_mps >= slowest_mps
    within = farthest_m(decision.twist.linear_mps, age_s) <= seen.fields[0].range_max_m + 1e-9
    assert within or decision.twist.linear_mps == pytest.approx(slowest_mps)


def test_the_limit_is_reported_with_range_and_speeds() -> None:
    decision = decide(given_that(command=Twist(1.0, 0.0), sight=sight(0.8)), config())
    assert decision.detail.startswith("scanners with a range of 0.8 m and no longer: 1.00 m/s, 0.00 rad/s ordered, 0.")
    assert decision.clears_on == "a slower command, or a scanner with a longer range"


@pytest.mark.parametrize(("blind_mps", "order", "action"), [(0.0, 0.0, Action.STOP), (0.15, 0.15, Action.LIMIT)])
def test_a_range_below_the_stop_distance_shows_nothing_of_the_path(
    blind_mps: float, order: float, action: Action
) -> None:
    decision = decide(given_that(command=Twist(1.0, 0.0), sight=sight(0.45)), config(blind_mps=blind_mps))
    assert (decision.twist, decision.action) == (Twist(order, 0.0), action)
    assert decision.cause is StopCause.BLIND


commands = st.builds(Twist, st.floats(-3.0, 3.0), st.floats(-5.0, 5.0)).filter(lambda twist: not twist.is_zero)


@given(command=commands, range_m=st.floats(0.3, 4.0), age_s=st.floats(0.0, 1.0), more_m=st.floats(0.0, 2.0))
def test_more_range_never_makes_the_order_slower_and_an_older_scan_never_faster(
    command: Twist, range_m: float, age_s: float, more_m: float
) -> None:
    def ordered_mps(seen: Sight) -> float:
        twist = decide(given_that(command=command, sight=seen), config(scan=True)).twist
        return 0.0 if twist == ZERO else fastest_mps(BOX, twist)

    least = ordered_mps(sight(range_m, age_s))
    steps = max(fastest_mps(BOX, command) / 256.0, 1e-9)
    assert least <= ordered_mps(sight(range_m + more_m, age_s)) + steps
    assert ordered_mps(sight(range_m, age_s + 0.1)) <= least + steps


@given(command=commands, range_m=st.floats(0.3, 4.0), age_s=st.floats(0.0, 1.0))
def test_from_what_the_range_leaves_the_base_stops_within_it(command: Twist, range_m: float, age_s: float) -> None:
    """As far as the origin of base_link drives, and the nearest edge is beyond it."""
    geometry = Geometry.of(LIMITS, config().safety, 1.0 / HOLD_S)
    share = range_share(command, sight(range_m, age_s), geometry)
    assert 0.0 <= share <= 1.0
    left = command.scaled(share)
    if share in (0.0, 1.0) or abs(left.angular_radps) > 0.05 * abs(left.linear_mps):
        return
    drives_s = age_s + HOLD_S + 0.1 + stop_way_s(Moving(left), LIMITS)
    assert abs(left.linear_mps) * drives_s <= range_m


@pytest.mark.parametrize("range_m", [1.0, 1.5, 2.0, 3.0, 4.0, 5.0])
@pytest.mark.parametrize("yaw_rad", [0.0, math.pi])
def test_config_check_states_the_speed_that_the_filter_allows(range_m: float, yaw_rad: float) -> None:
    robot = fast_robot(3.0, 1.5, 0.3, range_m=range_m, yaw_rad=yaw_rad, x_m=0.2, y_m=-0.05)
    scan = robot.safety.scan
    geometry = Geometry.of(robot.limits, robot.safety, robot.rates.command_hz)
    field = Field(Placement.of(scan), -math.pi / 2.0, math.pi, 0.0, range_m)
    command = Twist(math.copysign(3.0, math.cos(yaw_rad)), 0.0)
    share = range_share(command, Sight(NOWHERE, (field,), scan.timeout_s), geometry)
    assert needed_range_m(robot, scan, 3.0 * share) <= range_m + 1e-6
    assert share == 1.0 or needed_range_m(robot, scan, 3.0 * (share + 1.5 / 256.0)) > range_m


def test_the_range_in_robot_yaml_counts_where_it_is_the_shorter_one() -> None:
    for stated_m, counts_m in ((None, 10.0), (4.0, 4.0), (30.0, 10.0)):
        config_of = robot_with(scan={"required": True, "range_m": stated_m}).safety.scan
        scan = Lidar().scan(np.array([(2.0, 0.0), (6.0, 2.0)]))
        view = ScanReader(config_of).read(dataclasses.replace(scan, range_max_m=10.0), PLACE)
        assert view.field.range_max_m == counts_m
        assert view.points.at_m[:, 0].max() > 5.0  # an obstacle beyond it counts all the same
