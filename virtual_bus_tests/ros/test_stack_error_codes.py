"""Every error code of drive_distance, provoked for real on a whole robot: it comes with its status, and after the stop.

Drives, wheels and bus are the simulator's; driver, watchdog, mux, filter and server are the processes of the robot.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from signal import SIGTERM
from typing import Any, Final

import pytest
from canbase.action import DriveDistance
from rclpy.action import ActionClient
from unique_identifier_msgs.msg import UUID

from canbase_action_server.client import Drive
from canbase_action_server.outcome import ErrorCode, Status
from exit_matrix.driven_robot import Scene, sabotaged
from exit_matrix.failures import DRIVER, SERVER
from exit_matrix.injections import Inject, breaks, estop_pressed, fault, scan_dies, sends
from support.running_robot import READY_S, RESTS_M, own_domain, robot_on
from support.scanner import BEAMS
from support.surroundings import BLOCKED_M, scan

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

END_S: Final = 15.0
LAST_M: Final = 0.05
"""So far before its goal a base loses the force to brake: friction alone takes longer."""
CHANGES: Final[Mapping[str, Any]] = {
    "safety": {
        "scan": {"required": True},
        "estop": {"required": True},
        "limit_zones": [
            {"front_m": 1.0, "rear_m": 1.0, "left_m": 1.0, "right_m": 1.0, "linear_mps": 0.05, "angular_radps": 0.1}
        ],
    },
    "action": {
        "goal_policy": "preempt",
        "require_client_lease": True,
        "overall_factor": 1.1,
        "overall_extra_s": 0.5,
        "progress_timeout_s": 1.0,
        "tolerance_m": 0.002,
    },
    "watchdog": {"motion_tolerance_mps": 0.2},  # it would stop a base that cannot brake before that overshoots
}


Ended = tuple[Status, ErrorCode]
Provoke = Callable[["Stage"], object]


class Stage:
    """The robot, which is well at the beginning of each test."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.robot = scene, scene.robot
        self.goal_m = 0.0
        """Where the last goal ends, as travel_m of the ground truth."""
        self.broken: set[str] = set()
        """Parts that a test has broken inside: they are started anew."""

    def driving(self, way_m: float = 1.0, speed_mps: float = 0.3) -> Drive:
        """A goal whose base goes at its speed. A computer that is busy may end one before: then the next one."""
        for _ in range(3):
            start_m = self.robot.truth().travel_m
            drive = self.robot.goal(way_m, speed_mps)
            self.goal_m = start_m + way_m
            if self._fast(drive, 0.9 * speed_mps):
                return drive
            print(f"ended before it was fast: {drive.result}")
            self.recover()
        raise AssertionError(f"the base does not drive\n{self.robot.logs()}")

    def _fast(self, drive: Drive, least_mps: float) -> bool:
        """Until it goes that fast, or has ended."""
        found = self.robot.node.wait_for(
            lambda: "fast" if abs(self.robot.truth().linear_mps) >= least_mps else "ended" if drive.result else "",
            20.0,
            f"{least_mps} m/s, or the goal's end",
        )
        return found == "fast"

    def end_of(self, drive: Drive) -> Ended:
        """Its result; the base stood when it came, and stands from then on."""
        result = drive.wait(END_S)
        ended_s = time.monotonic()
        assert result is not None, self.robot.logs()
        self.stood_at(ended_s)
        assert self.robot.moved_since(ended_s, 1.0) < RESTS_M
        return result.status, result.code

    def stood_at(self, ended_s: float) -> None:
        """No wheel turned when a result came."""
        rows = [row for row in self.robot.sim.trace(ended_s - 0.1) if row[0] <= ended_s]
        slowest_mps = min(max(abs(row[4]), abs(row[5])) for row in rows)
        assert slowest_mps <= self.robot.robot.base.standstill_mps

    def recover(self) -> None:
        """The robot is well; what ended or is broken inside is started anew."""
        stack = self.robot.stack
        death = stack.death()
        anew = self.broken | ({death.part} if death else set())
        for part in anew:
            stack.end(part)
        stack.start()
        self.broken.clear()
        self.scene.fault("heal")
        self.scene.recover(restarted=bool(anew))


@pytest.fixture(scope="module")
def running() -> Iterator[Stage]:
    with (
        tempfile.TemporaryDirectory(prefix="canbase-codes-", dir="/tmp") as folder,
        own_domain() as domain,
        robot_on(domain, changes=CHANGES, start=False, env=sabotaged(Path(folder))) as robot,
    ):
        robot.stack.start()
        scene = Scene(robot)
        scene.recover(restarted=True)
        yield Stage(scene)


@pytest.fixture
def stage(running: Stage) -> Stage:
    running.recover()
    return running


def of(inject: Inject) -> Provoke:
    """As a row of the exit matrix does it."""
    return lambda stage: inject(stage.scene)


def obstacle_ahead(stage: Stage) -> None:
    stage.scene.scan.message = scan(BLOCKED_M)


def somebody_beside(stage: Stage) -> None:
    """In the zone in which the filter lets the base creep."""
    message = scan()
    for beam in range(BEAMS // 4 - 1, BEAMS // 4 + 2):
        message.ranges[beam] = 0.7
    stage.scene.scan.message = message


def no_odometry(stage: Stage) -> None:
    stage.broken.add(DRIVER)
    stage.scene.sabotage(DRIVER, "withhold_odometry")


def no_motion_in_the_odometry(stage: Stage) -> None:
    """A wheel that really does not follow is the watchdog's: it trips long before the goal has waited."""
    stage.broken.add(DRIVER)
    stage.scene.sabotage(DRIVER, "freeze_odometry")


ABORTS: Final[Mapping[ErrorCode, Provoke]] = {
    ErrorCode.BLOCKED: obstacle_ahead,
    ErrorCode.ODOMETRY_LOST: no_odometry,
    ErrorCode.ESTOP: of(estop_pressed),
    ErrorCode.NO_PROGRESS: no_motion_in_the_odometry,
    ErrorCode.TIMEOUT: somebody_beside,
    ErrorCode.DRIVE_FAULT: of(fault("fault", 1)),
    ErrorCode.WATCHDOG: of(fault("frozen_encoder", 1)),
    ErrorCode.SCAN_LOST: of(scan_dies),
    ErrorCode.SHUTDOWN: of(sends(SERVER, SIGTERM)),
    ErrorCode.INTERNAL: of(breaks(SERVER, "raise_error")),
}


@pytest.mark.parametrize("code", ABORTS, ids=lambda code: code.name)
def test_what_goes_wrong_aborts_the_goal_with_its_own_code_after_the_stop(stage: Stage, code: ErrorCode) -> None:
    drive = stage.driving()
    ABORTS[code](stage)
    assert stage.end_of(drive) == (Status.ABORTED, code)


def test_ok(stage: Stage) -> None:
    assert stage.end_of(stage.driving(0.3)) == (Status.SUCCEEDED, ErrorCode.OK)


def test_canceled(stage: Stage) -> None:
    drive = stage.driving()
    assert drive.cancel()
    assert stage.end_of(drive) == (Status.CANCELED, ErrorCode.CANCELED)


def test_overshoot_of_a_base_that_cannot_brake(stage: Stage) -> None:
    drive = stage.driving(0.5, 0.2)
    stage.robot.node.wait_for(lambda: stage.robot.truth().travel_m > stage.goal_m - LAST_M, END_S, "the end of the way")
    stage.scene.fault("weak")
    assert stage.end_of(drive) == (Status.ABORTED, ErrorCode.OVERSHOOT)


def test_preempted_by_a_newer_goal_that_begins_after_the_stop(stage: Stage) -> None:
    older = stage.driving()
    newer = stage.robot.goal(-0.1, 0.2)
    result = older.wait(END_S)
    stage.stood_at(time.monotonic())
    assert result is not None
    assert (result.status, result.code) == (Status.ABORTED, ErrorCode.PREEMPTED)
    assert stage.end_of(newer) == (Status.SUCCEEDED, ErrorCode.OK)


def test_client_lost_of_a_client_whose_keepalives_end(stage: Stage) -> None:
    bare = ActionClient(stage.robot.node.node, DriveDistance, "drive_distance")
    keepalive = stage.robot.node.repeat(UUID, "drive_distance/keepalive", 10.0)
    stage.robot.node.wait_for_subscriber(keepalive.publisher)
    stage.robot.node.wait_for(bare.server_is_ready, READY_S, "the server")
    stage.robot.node.spin_for(0.5)  # the joystick of the surroundings has shown zero, and is silent from then on
    answer = bare.send_goal_async(DriveDistance.Goal(distance_m=1.0, max_speed_mps=0.3))
    stage.robot.node.wait_for(answer.done, READY_S, "the answer")
    assert answer.result().accepted, stage.robot.logs()
    keepalive.message = answer.result().goal_id
    stage.robot.wait_speed(0.27)
    keepalive.message = None
    ended = answer.result().get_result_async()
    stage.robot.node.wait_for(ended.done, END_S, "the result")
    stage.stood_at(time.monotonic())
    assert (ended.result().status, ended.result().result.error_code) == (Status.ABORTED, ErrorCode.CLIENT_LOST)


def test_no_code_is_without_its_story() -> None:
    here = {ErrorCode.OK, ErrorCode.CANCELED, ErrorCode.OVERSHOOT, ErrorCode.PREEMPTED, ErrorCode.CLIENT_LOST}
    # test_teleop_takeover.py: its base goes on to move; test_nav2_behaviors.py
    elsewhere = {ErrorCode.TAKEN_OVER, ErrorCode.INVALID_GOAL}
    assert set(ABORTS) | here | elsewhere == set(ErrorCode)
