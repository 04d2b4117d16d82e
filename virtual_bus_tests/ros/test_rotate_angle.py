"""The action rotate_angle over DDS, beside drive_distance on one base, and `canbase rotate`."""

from __future__ import annotations

import json
import math
import sys

import pytest

from canbase_action_server.client import DriveClient, RejectedError
from canbase_action_server.outcome import ErrorCode, Status
from canbase_action_server.rotate_client import RotateClient, RotateFeedback
from ros.conftest import MakeRobot, Spawn
from support.fake_base import FakeBase, server_code
from support.ros_harness import TestNode

pytestmark = pytest.mark.ros

LEVER_M = 0.2
"""Half the track of the tests' robot."""
TOLERANCE_RAD = 0.005 / LEVER_M


class Stage:
    """A running server before a base, and a client of each action."""

    def __init__(self, node: TestNode, spawn: Spawn, make_robot: MakeRobot) -> None:
        self.node, self.spawn = node, spawn
        # A loaded test machine may hold the test's base up for longer than the 0.2 s of a robot.
        self.server = spawn(server_code(make_robot({"timeouts": {"odometry_s": 1.0}})))
        self.base = FakeBase(node)
        self.turns = RotateClient(node.node, node.executor)
        self.drives = DriveClient(node.node, node.executor)
        self.turns.wait_for_server(20.0)
        self.drives.wait_for_server(5.0)
        node.wait_for(lambda: self.base.heard, 20.0, "the server to listen")
        node.spin_for(1.0)


@pytest.fixture
def stage(test_node: TestNode, spawn: Spawn, make_robot: MakeRobot) -> Stage:
    return Stage(test_node, spawn, make_robot)


def test_turns_end_at_their_angle_and_may_be_more_than_one_turn(stage: Stage) -> None:
    for angle_rad in (1.0, -7.0):
        began_rad, seen = stage.base.yaw_rad, list[RotateFeedback]()
        result = stage.turns.send(angle_rad, 1.5, on_feedback=seen.append).wait(20.0)
        assert result is not None
        assert (result.status, result.code) == (Status.SUCCEEDED, ErrorCode.OK), result.message
        assert result.turned_rad == pytest.approx(angle_rad, abs=TOLERANCE_RAD)
        assert stage.base.yaw_rad - began_rad == pytest.approx(angle_rad, abs=TOLERANCE_RAD)
        assert 0.0 <= result.overshoot_rad <= TOLERANCE_RAD
        assert math.copysign(1.0, seen[-1].turned_rad) == math.copysign(1.0, angle_rad)
    assert math.hypot(stage.base.x_m, stage.base.y_m) < 1e-6


def test_a_cancel_stops_the_turn(stage: Stage) -> None:
    turn = stage.turns.send(20.0, 0.8)
    stage.node.wait_for(lambda: stage.base.yaw_rad > 0.3, 10.0, "the base to turn")
    assert turn.cancel()
    result = turn.wait(5.0)
    assert result is not None
    assert (result.status, result.code) == (Status.CANCELED, ErrorCode.CANCELED)
    assert 0.3 < result.turned_rad < 5.0


def test_drive_and_turn_share_one_base_and_wrong_numbers_are_rejected(stage: Stage) -> None:
    for angle_rad, speed_radps in ((0.0, 0.5), (100.0, 0.5), (math.nan, 0.5), (1.0, 9.0), (1.0, -0.5)):
        with pytest.raises(RejectedError):
            stage.turns.send(angle_rad, speed_radps)
    turn = stage.turns.send(2.0, 0.8)
    with pytest.raises(RejectedError):
        stage.drives.send(0.1, 0.2)
    result = turn.wait(10.0)
    assert result is not None
    assert result.code is ErrorCode.OK
    drive = stage.drives.send(0.1, 0.2).wait(10.0)
    assert drive is not None
    assert drive.code is ErrorCode.OK


def test_canbase_rotate_turns_and_tells(stage: Stage) -> None:
    command = [sys.executable, "-c", "from canbase_cli.main import app; app()", "rotate"]
    process = stage.spawn([*command, "-90deg", "--speed", "1.0", "--json"])
    stage.node.wait_for(lambda: process.exit_code is not None, 20.0, "the end of canbase rotate")
    assert process.exit_code == 0, process.log()
    told = json.loads(process.log())
    assert (told["status"], told["code"]) == ("SUCCEEDED", "OK")
    assert told["turned_rad"] == pytest.approx(-math.pi / 2, abs=TOLERANCE_RAD)
