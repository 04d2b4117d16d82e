"""The owner of the base: one goal at a time, a few zeros after it, silence, and what happens after a defect."""

from __future__ import annotations

from dataclasses import replace

import pytest

from canbase_action_server.active_goal import FAREWELL_S, ActiveGoal
from canbase_action_server.goal_request import DriveRequest
from canbase_action_server.inputs import Inputs
from canbase_action_server.motion import BaseTwist
from canbase_action_server.outcome import ErrorCode
from support.action_plant import Plant, bench_robot, good_inputs

REQUEST = DriveRequest(1.0, 0.2)


def good(now_s: float) -> Inputs:
    """A healthy robot that stands."""
    return good_inputs(Plant().odometry(now_s))


def test_the_base_has_one_owner_and_is_free_again_after_it() -> None:
    owner = ActiveGoal(bench_robot())
    assert owner.tick(good(0.0), 0.0) is None  # nobody drives: silence
    owner.start(REQUEST, good(0.0), 0.0)
    with pytest.raises(RuntimeError, match="not free"):
        owner.start(REQUEST, good(0.0), 0.0)
    now_s = 0.0
    while owner.busy:
        now_s += 0.02
        order = owner.tick(replace(good(now_s), cancel_requested=now_s > 0.1), now_s)
    assert order is not None
    assert order.end is not None
    farewell, silence = owner.tick(good(now_s), now_s + 0.1), owner.tick(good(now_s), now_s + FAREWELL_S + 0.01)
    assert farewell is not None
    assert (farewell.twist, farewell.end) == (BaseTwist(), None)
    assert silence is None
    owner.start(REQUEST, good(now_s), now_s)


def test_a_base_that_was_never_seen_is_not_taken() -> None:
    with pytest.raises(RuntimeError, match="odometry"):
        ActiveGoal(bench_robot()).start(REQUEST, Inputs(), 0.0)


def test_after_a_defect_the_goal_only_stops_and_ends_as_internal() -> None:
    owner = ActiveGoal(bench_robot())
    owner.start(REQUEST, good(0.0), 0.0)
    owner.fail(ZeroDivisionError("a defect"), 0.0)
    owner.fail(ValueError("a second one, which changes nothing"), 0.1)
    now_s, twists, end = 0.0, set(), None
    while end is None:
        now_s += 0.02
        order = owner.tick(good(now_s), now_s)
        assert order is not None
        twists.add(order.twist)
        end = order.end
    assert twists == {BaseTwist()}
    assert end.code is ErrorCode.INTERNAL
    assert "ZeroDivisionError('a defect')" in end.message


def test_a_process_out_of_time_ends_its_goal_at_once() -> None:
    owner = ActiveGoal(bench_robot())
    assert owner.give_up(ErrorCode.SHUTDOWN, "no time", 0.0) is None
    owner.start(REQUEST, good(0.0), 0.0)
    order = owner.give_up(ErrorCode.SHUTDOWN, "no time", 0.1)
    assert order is not None
    assert order.end is not None
    assert (order.twist, order.end.code) == (BaseTwist(), ErrorCode.SHUTDOWN)
    assert not owner.busy
