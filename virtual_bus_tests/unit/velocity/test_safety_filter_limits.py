"""Speeds that the safety filter limits: ceilings, zones, directions in which no scanner looks, growth."""

from __future__ import annotations

import math

import pytest

from canbase_runtime.stop_cause import StopCause
from canbase_velocity.clearance import NOWHERE, Field
from canbase_velocity.decision import Action
from canbase_velocity.obstacle import Sight
from canbase_velocity.placement import Placement
from canbase_velocity.safety_filter import decide
from canbase_velocity.sweep import fastest_mps
from canbase_velocity.twist import ZERO, Twist
from support.filter_inputs import BOX, CEILING, ZONE, config, free, given_that, places


@pytest.mark.parametrize(
    ("asked", "ordered"),
    [
        (Twist(1.0, 2.0), Twist(1.0, 2.0)),  # exactly at both limits
        (Twist(2.0, 0.5), Twist(1.0, 0.25)),
        (Twist(-2.0, 0.5), Twist(-1.0, 0.25)),
        (Twist(0.5, 4.0), Twist(0.25, 2.0)),
        (Twist(4.0, -4.0), Twist(1.0, -1.0)),  # the harder of both limits
        (Twist(0.0, -8.0), Twist(0.0, -2.0)),
        (Twist(1e308, 0.0), Twist(1.0, 0.0)),
    ],
)
def test_the_speed_ceiling_keeps_the_curve(asked: Twist, ordered: Twist) -> None:
    decision = decide(given_that(command=asked), config())
    assert (decision.twist.linear_mps, decision.twist.angular_radps) == pytest.approx(
        (ordered.linear_mps, ordered.angular_radps)
    )
    assert (decision.action is Action.LIMIT) is (asked != ordered)
    assert (decision.cause is StopCause.SPEED) is (asked != ordered)


@pytest.mark.parametrize(
    ("at_m", "asked", "ordered"),
    [
        ((1.49, 0.9), Twist(-0.5, 0.0), Twist(-0.25, 0.0)),  # whatever the direction of travel
        ((1.51, 0.9), Twist(-0.5, 0.0), Twist(-0.5, 0.0)),
        ((0.0, 0.99), Twist(0.0, 1.0), Twist(0.0, 0.5)),
        ((0.0, 0.99), Twist(0.2, 0.1), Twist(0.2, 0.1)),
    ],
)
def test_something_in_a_limit_zone_limits_the_speed(at_m: tuple[float, float], asked: Twist, ordered: Twist) -> None:
    decision = decide(given_that(command=asked, sight=places(at_m)), config(limit_zones=(ZONE,)))
    assert decision.twist == ordered
    assert decision.cause is (StopCause.NONE if asked == ordered else StopCause.ZONE)


AHEAD_ONLY = Field(Placement(0.4, 0.0, (1.0, 0.0), (0.0, 1.0)), -math.pi / 2, math.pi, 0.05, 10.0)
BEHIND_ONLY = Field(Placement(-0.4, 0.0, (-1.0, 0.0), (0.0, -1.0)), -math.pi / 2, math.pi, 0.05, 10.0)


def looking(*fields: Field) -> Sight:
    return Sight(NOWHERE, fields)


@pytest.mark.parametrize(
    ("command", "fields", "speed_mps"),
    [
        (Twist(0.5, 0.0), (AHEAD_ONLY,), 0.5),
        (Twist(-0.5, 0.0), (AHEAD_ONLY,), 0.15),
        (Twist(-0.1, 0.0), (AHEAD_ONLY,), 0.1),
        (Twist(-0.5, 0.0), (AHEAD_ONLY, BEHIND_ONLY), 0.5),
        (Twist(0.5, 0.0), (BEHIND_ONLY,), 0.15),
        (Twist(0.0, 1.0), (AHEAD_ONLY,), 0.15),
        (Twist(-0.5, 0.0), (), 0.5),  # looks everywhere, or nobody looks at all and no scan is required
    ],
)
def test_where_no_scanner_looks_the_base_creeps(command: Twist, fields: tuple[Field, ...], speed_mps: float) -> None:
    decision = decide(given_that(command=command, sight=looking(*fields)), config())
    assert fastest_mps(BOX, decision.twist) == pytest.approx(speed_mps)
    assert (decision.cause is StopCause.BLIND) == (decision.twist != command)


def test_with_a_blind_speed_of_0_the_base_does_not_go_where_no_scanner_looks() -> None:
    decision = decide(given_that(command=Twist(-0.5, 0.0), sight=looking(AHEAD_ONLY)), config(blind_mps=0.0))
    assert (decision.action, decision.cause, decision.twist) == (Action.STOP, StopCause.BLIND, ZERO)


@pytest.mark.parametrize(
    ("previous", "asked", "ordered"),
    [
        (ZERO, Twist(0.5, 0.5), Twist(0.01, 0.01)),  # from rest on the curve of the command
        (ZERO, Twist(-0.2, 1.0), Twist(-0.004, 0.02)),
        (Twist(0.5, 0.0), Twist(0.5, 1.0), Twist(0.5, 0.02)),  # into a turn without slowing down
        (Twist(0.5, 0.5), Twist(0.2, 0.2), Twist(0.2, 0.2)),  # what falls, falls at once
        (Twist(0.5, 0.5), ZERO, ZERO),
        (Twist(0.5, 0.0), Twist(-0.5, 0.0), Twist(-0.01, 0.0)),  # a reversal begins at zero
        (Twist(0.59, 0.0), Twist(0.9, 0.0), Twist(0.6, 0.0)),  # a ceiling of its own, below that of the driver
    ],
)
def test_orders_grow_no_faster_than_the_ceiling_and_keep_the_curve(
    previous: Twist, asked: Twist, ordered: Twist
) -> None:
    decision = decide(given_that(command=asked, previous=previous), config(ceiling=CEILING))
    got = decision.twist
    assert (got.linear_mps, got.angular_radps) == pytest.approx((ordered.linear_mps, ordered.angular_radps))


def test_without_time_nothing_grows() -> None:
    decision = decide(given_that(previous=Twist(0.1, 0.0), since_s=0.0), config(ceiling=CEILING))
    assert decision.twist.linear_mps == pytest.approx(0.1)
    assert (decision.action, decision.cause) == (Action.LIMIT, StopCause.ACCELERATION)


def test_ceiling_and_obstacle_together_tell_the_more_severe_and_order_the_slower() -> None:
    decision = decide(given_that(command=Twist(4.0, 0.0), sight=free(ahead_m=0.35)), config())
    assert (decision.action, decision.cause) == (Action.SLOW, StopCause.OBSTACLE_NEAR)
    assert decision.twist.linear_mps == pytest.approx(0.6874, abs=1e-4)
    far = decide(given_that(command=Twist(4.0, 0.0), sight=free(ahead_m=0.621)), config())
    assert (far.action, far.twist.linear_mps) == (Action.LIMIT, 1.0)
