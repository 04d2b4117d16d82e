"""Speed limits at run time: who lowers them, what is refused, and what the filter makes of them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_runtime.stop_cause import StopCause
from canbase_velocity.decision import Action
from canbase_velocity.filter_state import SafetyFilter
from canbase_velocity.safety_filter import decide
from canbase_velocity.speed_limit import Giver, RefusedLimitError, SpeedLimit, SpeedLimits
from canbase_velocity.twist import Twist
from support.filter_inputs import CEILING, config, fed, given_that

MOST = SpeedLimit(0.8, 2.0)
LIMITS = SpeedLimits(MOST)
SPEEDS = st.floats(-1.0, 1.0)


def test_at_first_robot_yaml_holds_and_a_lower_ceiling_of_it() -> None:
    robot = load_robot(sample("bench")).robot
    assert SpeedLimits.of(robot) == LIMITS
    values = robot.model_dump()
    values["safety"]["ceiling"] = CEILING.model_dump()
    assert SpeedLimits.of(Robot.model_validate(values)).effective == SpeedLimit(0.6, 1.0)
    assert LIMITS.by == ""


def test_of_two_givers_the_lower_one_holds_and_none_lifts_what_the_other_has_set() -> None:
    both = LIMITS.parameter("linear_mps", 0.4).nav2(50.0, percentage=True)
    assert both.effective == SpeedLimit(0.4, 1.0)
    assert both.by == "the parameters speed_limit of safety_filter and Nav2 on speed_limit"
    lifted = both.nav2(0.0, percentage=True)
    assert lifted.effective == SpeedLimit(0.4, 2.0)
    assert lifted.by == Giver.PARAMETER.value
    assert lifted.parameter("linear_mps", 0.8).effective == MOST


@pytest.mark.parametrize(
    ("speed_limit", "percentage", "limit"),
    [
        (0.4, False, SpeedLimit(0.4, 1.0)),
        (25.0, True, SpeedLimit(0.2, 0.5)),
        (0.0, False, MOST),
        (0.0, True, MOST),
        (5.0, False, MOST),
        (150.0, True, MOST),
    ],
)
def test_nav2_gives_a_share_or_a_speed_and_never_more_than_robot_yaml(
    speed_limit: float, percentage: bool, limit: SpeedLimit
) -> None:
    assert LIMITS.nav2(speed_limit, percentage=percentage).effective == limit


@pytest.mark.parametrize("speed_limit", [math.nan, math.inf, -0.1])
def test_a_message_of_nav2_that_is_no_limit_is_refused(speed_limit: float) -> None:
    with pytest.raises(RefusedLimitError, match="no speed limit"):
        LIMITS.nav2(speed_limit, percentage=False)


@pytest.mark.parametrize("value", [0.81, -0.1, math.nan, math.inf, "0.1", None, True])
def test_a_parameter_that_cannot_be_is_refused_with_what_can_be(value: Any) -> None:
    with pytest.raises(RefusedLimitError, match=r"speed_limit.linear_mps is .*: expected 0 to 0.8"):
        LIMITS.parameter("linear_mps", value)


def test_the_filter_goes_slower_on_the_same_curve_and_names_who_has_lowered_it() -> None:
    inputs = given_that(command=Twist(0.5, 0.8), speed_limit=SpeedLimit(0.25, 2.0), speed_limit_by="a test")
    decision = decide(inputs, config())
    assert (decision.action, decision.cause) == (Action.LIMIT, StopCause.SPEED)
    assert decision.twist == Twist(0.25, 0.4)
    assert decision.detail.startswith("a test: 0.50 m/s, 0.80 rad/s ordered, 0.25 m/s")
    assert "speed_limit" in decision.clears_on


def test_a_limit_of_zero_is_no_motion_and_zero_itself_passes() -> None:
    still = SpeedLimit(0.0, 0.0)
    assert decide(given_that(command=Twist(0.5, -0.8), speed_limit=still), config()).twist.is_zero
    assert decide(given_that(command=Twist(0.0, 0.0), speed_limit=still), config()).action is Action.PASS
    turning = decide(given_that(command=Twist(0.0, 0.8), speed_limit=SpeedLimit(0.0, 2.0)), config())
    assert turning.twist == Twist(0.0, 0.8)


@example(0.56, 0.0, 0.44, 1.0)  # 0.56 × (0.44 / 0.56) is above 0.44
@given(SPEEDS, SPEEDS, st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_no_order_is_above_the_limit_or_above_the_order_without_one(
    v: float, w: float, most: float, turn: float
) -> None:
    inputs = given_that(command=Twist(v, w))
    free = decide(inputs, config()).twist
    limited = decide(replace(inputs, speed_limit=SpeedLimit(most, turn)), config()).twist
    assert abs(limited.linear_mps) <= min(most, abs(free.linear_mps))
    assert abs(limited.angular_radps) <= min(turn, abs(free.angular_radps))


def test_a_limit_that_is_lowered_in_motion_holds_from_the_next_order_until_it_is_changed() -> None:
    the_filter: SafetyFilter = fed(0.0, Twist(0.5, 0.0))
    assert the_filter.decide(0.0).twist.linear_mps == 0.5
    the_filter.on_speed_limit(SpeedLimit(0.2, 2.0), "a test")
    assert the_filter.decide(0.001).twist.linear_mps == 0.2
    fed(3600.0, Twist(0.5, 0.0), the_filter=the_filter)
    assert the_filter.decide(3600.0).twist.linear_mps == 0.2, "no time lifts it"
    the_filter.on_speed_limit(SpeedLimit(0.8, 2.0), "")
    assert the_filter.decide(3600.01).twist.linear_mps == 0.5
