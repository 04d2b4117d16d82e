"""One robot of real processes: its parts are killed, started again or started twice, under a held stick or a goal."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator

import pytest
from canbase.msg import DriverStatus, MuxState

from canbase_action_server.outcome import ErrorCode, Status
from support.running_robot import LATCHED, RESTS_M, RunningRobot, own_domain, robot_on
from support.velocity_chain import drive

pytestmark = [pytest.mark.ros, pytest.mark.timeout(240)]
AT_ONCE_S = 0.3
"""Of a loaded computer; what it really takes is printed."""


@pytest.fixture(scope="module")
def running() -> Iterator[RunningRobot]:
    with own_domain() as domain, robot_on(domain) as robot:
        yield robot


@pytest.fixture
def robot(running: RunningRobot) -> RunningRobot:
    """Enabled and at standstill."""
    running.make_ready()
    running.wait_standing()
    return running


# a second of each part at once ── each ends with 1 and the holder's process
def test_a_second_of_each_part_is_refused_and_disturbs_nothing(robot: RunningRobot) -> None:
    pids = robot.stack.pids
    robot.status.clear()
    holders = {"up": "driver", "watchdog": "watchdog", "velocity": "velocity", "driver": "driver"}
    seconds = {part: robot.command(part, "--config", str(robot.config)) for part in holders}
    for part, second in seconds.items():
        code = robot.exit_code(second, 60.0)
        assert (code, f"process {pids[holders[part]]} of user" in second.log()) == (1, True), (part, second.log())
    assert {status.state for status in robot.status.messages} == {DriverStatus.ENABLED}
    assert robot.driven(0.1)


def stamp_s(message: DriverStatus | MuxState) -> float:
    """When it was made, by the computer's clock: a loaded test reads what waited first."""
    return float(message.stamp.sec + message.stamp.nanosec * 1e-9)


@pytest.mark.parametrize("part", ["driver", "velocity"])
def test_a_stick_held_while_a_part_is_killed_and_started_again_moves_nothing(robot: RunningRobot, part: str) -> None:
    mux = robot.node.record(MuxState, "velocity_mux/state", LATCHED)
    joystick = robot.node.source()
    try:
        joystick.message = drive(0.2)
        robot.wait_speed(0.19)
        robot.send(part, signal.SIGKILL)
        robot.wait_standing()
        assert robot.stack.end(part) == -signal.SIGKILL
        started_s = time.time()
        robot.stack.start()
        robot.node.wait_for(lambda: robot.status.last and stamp_s(robot.status.last) > started_s, 40.0, "the driver")
        robot.make_ready()
        robot.node.wait_for(lambda: mux.last and stamp_s(mux.last) > started_s and mux.last.ready, 40.0, "the mux")
        assert robot.moved_since(time.monotonic(), 2.0) < RESTS_M
        assert mux.messages[-1].sources[0].reason.startswith("waiting for zero (")
        robot.node.release(joystick)
        joystick.message = drive(0.2)
        robot.wait_speed(0.19)
    finally:
        joystick.message = None
        robot.wait_standing()


# driving with the stick held ── a stop that latches ── motor_driver/reset alone, which sees zeros ── enabled: stays
def test_a_reset_of_the_driver_alone_does_not_release_a_held_stick(robot: RunningRobot) -> None:
    joystick = robot.node.source()
    try:
        joystick.message = drive(0.2)
        robot.wait_speed(0.19)
        robot.reset("motor_driver/stop")
        robot.wait_state(DriverStatus.LATCHED)
        robot.wait_standing()
        reset_s = time.monotonic()
        robot.make_ready()  # motor_driver/reset, which resets the watchdog too; the stick is held all the time
        assert robot.moved_since(reset_s, time.monotonic() - reset_s + 3.0) < RESTS_M
        robot.node.release(joystick)
        joystick.message = drive(0.2)
        robot.wait_speed(0.19)
    finally:
        joystick.message = None
        robot.wait_standing()


def test_the_joystick_ends_the_goal_at_once_and_its_release_leaves_the_base_standing(robot: RunningRobot) -> None:
    states = robot.node.record(MuxState, "velocity_mux/state", LATCHED)
    joystick = robot.node.source()
    goal = robot.goal(3.0, 0.4)
    robot.wait_speed(0.35)

    taken_s = time.monotonic()
    joystick.message = drive(-0.1)
    robot.node.wait_for(lambda: goal.result is not None, 5.0, "the end of the goal")
    ended_s = time.monotonic()

    assert goal.result is not None
    assert (goal.result.status, goal.result.code) == (Status.ABORTED, ErrorCode.TAKEN_OVER)
    assert "joystick" in goal.result.message
    print(f"goal ended {1e3 * (ended_s - taken_s):.0f} ms after the joystick began to be asked at 50 Hz")
    assert ended_s - taken_s < AT_ONCE_S
    assert states.messages[-1].active == "joystick"
    robot.node.wait_for(lambda: robot.truth().linear_mps < -0.08, 10.0, "the base follows the joystick")

    joystick.message = None  # let go without a last zero, as when its radio dies
    robot.wait_standing()
    assert robot.moved_since(time.monotonic(), 1.0) < RESTS_M  # neither the joystick's command nor the goal comes back
    assert states.messages[-1].active == ""
    assert robot.driven(0.05)  # a new goal drives
