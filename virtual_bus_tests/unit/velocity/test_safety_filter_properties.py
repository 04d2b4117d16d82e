"""Properties of the safety filter that hold for all inputs."""

from __future__ import annotations

import dataclasses
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_runtime.stop_cause import StopCause
from canbase_velocity.clearance import Field
from canbase_velocity.decision import Action, Decision
from canbase_velocity.estop import EstopState
from canbase_velocity.obstacle import Sight, allowed_share
from canbase_velocity.placement import Placement
from canbase_velocity.ramp import Moving, stop_way_s
from canbase_velocity.safety_filter import FilterConfig, Inputs, decide
from canbase_velocity.sweep import first_touch
from canbase_velocity.twist import ZERO, Twist
from support.filter_inputs import BOX, CEILING, LIMITS, ZONE, config, places, scanned

numbers = st.floats() | st.floats(-3.0, 3.0) | st.sampled_from([0.0, -0.0, 1.0, -1.0, 2.0, -2.0, 5e-324])
finite = numbers.filter(math.isfinite)
ages_s = st.just(math.inf) | st.floats(0.0, 1.0) | st.sampled_from([0.2, 0.3, 0.5])
spots_m = st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)) | st.sampled_from([(0.4, 0.3), (0.5, 0.0), (0.0, 0.0)])
sights = st.lists(spots_m, max_size=8).map(lambda at: places(*at))
motions = st.builds(Twist, st.floats(-1.0, 1.0), st.floats(-2.0, 2.0)) | st.just(ZERO)
movings = st.builds(Moving, motions, st.floats(-2.0, 2.0))
all_inputs = st.builds(
    Inputs,
    command=st.builds(Twist, numbers, numbers),
    command_age_s=ages_s,
    scans=ages_s.map(scanned),
    sight=sights,
    moving=movings,
    previous=motions,
    since_s=st.floats(0.0, 0.1),
    estop=st.sampled_from(EstopState),
    pressed=st.booleans(),
    estop_age_s=ages_s,
)
moving_inputs = st.builds(
    Inputs,
    command=st.builds(Twist, finite, finite),
    command_age_s=st.floats(0.0, 0.2),
    scans=st.floats(0.0, 0.3).map(scanned),
    sight=sights,
    moving=movings,
    previous=motions,
    since_s=st.floats(0.0, 0.1),
    estop=st.just(EstopState.FREE),
    pressed=st.just(False),
    estop_age_s=st.floats(0.0, 0.5),
)
ceilings = st.none() | st.just(CEILING)
configs = st.builds(
    lambda scan, estop, ceiling, zones: config(scan=scan, estop=estop, ceiling=ceiling, limit_zones=zones),
    st.booleans(), st.booleans(), ceilings, st.just(()) | st.just((ZONE,)),
)  # fmt: skip


@given(inputs=all_inputs | moving_inputs, settings=configs)
def test_the_order_is_finite_never_faster_than_the_command_or_the_limits_and_never_turned_around(
    inputs: Inputs, settings: FilterConfig
) -> None:
    order = decide(inputs, settings).twist
    assert order.is_finite
    assert abs(order.linear_mps) <= LIMITS.linear_mps
    assert abs(order.angular_radps) <= LIMITS.angular_radps
    for ordered, asked in (
        (order.linear_mps, inputs.command.linear_mps),
        (order.angular_radps, inputs.command.angular_radps),
    ):
        assert ordered == 0.0 or (
            abs(ordered) <= abs(asked) * (1 + 1e-12) and math.copysign(1.0, ordered) == math.copysign(1.0, asked)
        )


@given(inputs=moving_inputs)
def test_without_a_ceiling_of_growth_the_curve_is_that_of_the_command(inputs: Inputs) -> None:
    order, asked = decide(inputs, config()).twist, inputs.command
    across = order.linear_mps * asked.angular_radps - order.angular_radps * asked.linear_mps
    scale = max(abs(asked.angular_radps), abs(asked.linear_mps))
    assert not math.isfinite(across) or abs(across) <= 1e-9 * scale


@given(inputs=all_inputs, settings=configs)
def test_it_stops_whenever_a_required_input_is_stale_or_the_emergency_stop_is_not_free(
    inputs: Inputs, settings: FilterConfig
) -> None:
    stale = [
        inputs.command_age_s > 0.2,
        not inputs.scans[0].is_fresh,
        inputs.estop is not EstopState.FREE,
        not inputs.command.is_finite,
    ]
    decision = decide(inputs, settings)
    assert decision.action is Action.STOP or not any(stale)
    assert decision.twist == ZERO or decision.action is not Action.STOP
    assert (decision.cause is StopCause.NONE) == (decision.action is Action.PASS)


def stands_in_time(decision: Decision, inputs: Inputs) -> bool:
    """Along the arc of the order, by the ordinary ramp, before the stop distance."""
    touch = first_touch(inputs.sight.points, BOX, decision.twist, 0.1)
    return stop_way_s(Moving(decision.twist), LIMITS) <= touch.slack_s * (1 + 1e-9)


@given(inputs=moving_inputs)
def test_from_every_ordered_speed_the_base_can_stand_before_the_stop_distance(inputs: Inputs) -> None:
    decision = decide(inputs, config())
    assert decision.twist.is_zero or stands_in_time(decision, inputs)


@given(inputs=moving_inputs)
def test_one_more_obstacle_never_makes_an_order_faster(inputs: Inputs) -> None:
    fewer = dataclasses.replace(inputs, sight=Sight(inputs.sight.points[1:]))
    order, order_of_fewer = decide(inputs, config()).twist, decide(fewer, config()).twist
    assert abs(order.linear_mps) <= abs(order_of_fewer.linear_mps) * (1 + 1e-12)


@given(inputs=all_inputs, settings=configs)
def test_zero_is_always_allowed(inputs: Inputs, settings: FilterConfig) -> None:
    assert decide(dataclasses.replace(inputs, command=ZERO), settings).twist == ZERO


AHEAD = Field(Placement(0.4, 0.0, (1.0, 0.0), (0.0, 1.0)), -math.pi / 2, math.pi, 0.05, 10.0)


@given(
    inputs=all_inputs | moving_inputs,
    settings=configs,
    share=st.floats(0.0, 1.0),
    looks_ahead_only=st.booleans(),
    braking_hard=st.booleans(),
)
def test_an_order_nearer_to_zero_never_loses_the_hard_braking(
    inputs: Inputs, settings: FilterConfig, share: float, looks_ahead_only: bool, braking_hard: bool
) -> None:
    """Whatever stops or slows it: a stick pulled back, a blind direction, a zone, a scanner that is stale."""
    fields = (AHEAD,) if looks_ahead_only else ()
    sight = dataclasses.replace(inputs.sight, fields=fields)
    fast = dataclasses.replace(inputs, sight=sight, braking_hard=braking_hard)
    slow = dataclasses.replace(fast, command=fast.command.scaled(share))
    assert not decide(fast, settings).emergency or decide(slow, settings).emergency


@given(inputs=all_inputs | moving_inputs, settings=configs)
def test_whoever_brakes_hard_is_ordered_zero(inputs: Inputs, settings: FilterConfig) -> None:
    decision = decide(inputs, settings)
    assert decision.twist == ZERO or not decision.emergency


@given(
    slack_s=st.floats(-1.0, 10.0) | st.sampled_from([0.0, 5e-324]),
    twist=st.builds(Twist, st.floats(0.001, 1.0), st.floats(-2.0, 2.0)),
    jerk_mps3=st.sampled_from([0.1, 1.0, 10.0, 1e9]),
    hold_s=st.floats(0.001, 0.3),
)
def test_the_allowed_share_uses_the_time_up(slack_s: float, twist: Twist, jerk_mps3: float, hold_s: float) -> None:
    gentle = LIMITS.model_copy(update={"jerk_mps3": jerk_mps3})
    share = allowed_share(slack_s, twist, gentle, hold_s)
    assert 0.0 <= share <= 1.0
    used_s = share * (hold_s + stop_way_s(Moving(twist.scaled(share)), gentle))
    assert share == 1.0 or used_s == pytest.approx(max(slack_s, 0.0), abs=1e-6)
    assert share == 0.0 or used_s <= slack_s
