"""The example without a robot over DDS: a goal in each of the ways that it can end, and `canbase fibonacci`."""

from __future__ import annotations

import sys
from functools import partial

import pytest

from canbase_action_server.fibonacci import refusal
from canbase_action_server.fibonacci_client import FibonacciClient
from canbase_action_server.goal_errors import RejectedError
from canbase_action_server.outcome import Status
from ros.conftest import Spawn
from support.ros_harness import Process, TestNode

pytestmark = pytest.mark.ros

COMMAND = (sys.executable, "-m", "canbase_cli", "fibonacci")
TO_55 = (0, 1, 1, 2, 3, 5, 8, 13, 21, 34, 55)


def test_a_learner_sees_a_goal_succeed_fail_be_canceled_and_be_rejected(test_node: TestNode, spawn: Spawn) -> None:
    server = spawn([*COMMAND, "serve", "--period", "0.05"])
    client = FibonacciClient(test_node.node, test_node.executor)
    seen: list[tuple[int, ...]] = []
    done = client.send(10, on_feedback=seen.append, discovery_timeout_s=20.0)
    beside = client.send(3)  # goals share nothing: both run
    assert beside.wait(10.0) is not None
    assert done.result is None
    result = done.wait(10.0)
    assert result is not None
    assert (result.status, result.sequence) == (Status.SUCCEEDED, TO_55)
    assert seen[-1] == TO_55[:-1]
    assert len(seen) >= 8

    long = client.send(1000)
    test_node.spin_for(0.4)
    assert long.cancel()
    canceled = long.wait(5.0)
    assert canceled is not None
    assert canceled.status is Status.CANCELED
    assert 3 < len(canceled.sequence) < 40

    too_far = client.send(1000).wait(20.0)
    assert too_far is not None
    assert (too_far.status, too_far.sequence[-1]) == (Status.ABORTED, 1836311903)
    for order in (0, -1, 1001):
        with pytest.raises(RejectedError, match=f"rejects the goal: {refusal(order)}"):
            client.send(order)
    server.interrupt()
    assert server.wait(5.0) == 0


def test_the_command_shows_each_step_and_ends_with_its_code_also_where_both_sides_are_remapped(
    test_node: TestNode, spawn: Spawn
) -> None:
    server = ["serve", "--period", "0.05", "--namespace", "school", "--ros-args", "-r", "fibonacci:=numbers"]
    spawn([*COMMAND, *server])
    client = FibonacciClient(test_node.node, test_node.executor)
    remap = ("--wait", "20", "--ros-args", "-r", "fibonacci:=/school/numbers")
    sent = spawn([*COMMAND, "send", "10", *remap])
    canceled = spawn([*COMMAND, "send", "1000", "--cancel-after", "0.5", *remap])
    rejected = spawn([*COMMAND, "send", "0", *remap])
    assert sent.wait(40.0) == 0, sent.log()
    assert "accepted: that is no result yet" in sent.log()
    assert f"SUCCEEDED: {' '.join(map(str, TO_55))}" in sent.log()
    assert canceled.wait(40.0) == 3, canceled.log()
    assert "cancel accepted" in canceled.log()
    assert rejected.wait(40.0) == 5
    assert not client.server_ready  # there is none outside the namespace


def test_half_a_remap_is_an_error(spawn: Spawn) -> None:
    rule = ("--ros-args", "-r", "fibonacci/_action/feedback:=elsewhere")
    for torn in [spawn([*COMMAND, *command, *rule]) for command in (["serve"], ["send", "3"])]:
        assert torn.wait(40.0) == 2
        assert "/fibonacci/_action/feedback to /elsewhere" in torn.log()
        assert "-r fibonacci:=NAME" in torn.log()


def test_ctrl_c_cancels_waits_for_the_end_and_a_second_one_stops_waiting(test_node: TestNode, spawn: Spawn) -> None:
    server = spawn([*COMMAND, "serve", "--period", "0.2"])
    sent = spawn([*COMMAND, "send", "1000", "--wait", "20"])
    test_node.wait_for(lambda: "feedback: 0 1 1" in sent.log(), 40.0, "feedback")
    sent.interrupt()
    assert sent.wait(20.0) == 3, sent.log()
    accepted, result = sent.log().strip().splitlines()[-2:]
    assert accepted == "cancel accepted: that is no result yet either"
    assert result.startswith("CANCELED: 0 1 1")
    assert "cancel requested" in server.log()
    assert "Traceback" not in server.log() + sent.log()

    spawn([*COMMAND, "serve", "--period", "5", "--namespace", "slow"])
    hasty = spawn([*COMMAND, "send", "1000", "--wait", "20", "--namespace", "slow"])
    for told in ("accepted: that is no result yet", "cancel accepted"):
        test_node.wait_for(partial(_says, hasty, told), 40.0, told)
        hasty.interrupt()
    assert hasty.wait(20.0) == 1, hasty.log()
    assert "no longer waiting for the result" in hasty.log()


def _says(process: Process, told: str) -> bool:
    return told in process.log()


def test_ctrl_c_before_a_server_is_found_ends_the_command(test_node: TestNode, spawn: Spawn) -> None:
    sent = spawn([*COMMAND, "send", "10", "--wait", "60"])
    found = test_node.node.get_node_names
    test_node.wait_for(lambda: "canbase_fibonacci" in found(), 40.0, "the command to look for it")
    sent.interrupt()
    assert sent.wait(20.0) == 3
    assert "nothing was sent" in sent.log()
