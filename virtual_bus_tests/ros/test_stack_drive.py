"""The whole stack under commands as a person types them: where the robot really goes, what holds it still, and what
`canbase monitor` shows of it.
"""

from __future__ import annotations

import fcntl
import itertools
import math
import os
import pty
import subprocess
import termios
import time
from collections.abc import Iterator

import pytest
from canbase.msg import DriverStatus
from geometry_msgs.msg import TwistStamped

from canbase_action_server.goal_errors import RejectedError
from support.running_robot import CANBASE, RESTS_M, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

CTRL_C = b"\x03"


@pytest.fixture(scope="module")
def robot() -> Iterator[RunningRobot]:
    with own_domain() as domain, robot_on(domain) as robot:
        yield robot


@pytest.mark.parametrize("distance_m", [0.3, -0.3])
def test_a_drive_ends_at_its_distance_by_encoders_and_in_truth_and_stays_there(
    robot: RunningRobot, distance_m: float
) -> None:
    odometry, truth = robot.odometry(), robot.truth()
    command = robot.command("drive", f"{distance_m}", "--speed", "0.3")
    assert robot.exit_code(command) == 0, command.log()
    ended_s = time.monotonic()
    assert robot.moved_since(ended_s, 1.0) < RESTS_M
    ended = robot.truth()
    along_m = (ended.x_m - truth.x_m) * math.cos(truth.yaw_rad) + (ended.y_m - truth.y_m) * math.sin(truth.yaw_rad)
    assert along_m == pytest.approx(distance_m, abs=0.010)
    assert math.dist(odometry, robot.odometry()) == pytest.approx(abs(distance_m), abs=0.005)


def test_a_goal_out_of_range_is_rejected_and_nothing_moves(robot: RunningRobot) -> None:
    before_s = time.monotonic()
    assert robot.run("drive", "100") == 5
    assert robot.moved_since(before_s, 0.5) < RESTS_M


def test_ctrl_c_cancels_and_the_base_stands_when_the_command_ends(robot: RunningRobot) -> None:
    start = robot.truth()
    command = robot.command("drive", "3.0", "--speed", "0.3")
    robot.wait_speed(0.25)
    command.interrupt()
    assert robot.exit_code(command) == 3, command.log()
    assert robot.moved_since(time.monotonic(), 1.0) < RESTS_M
    assert 0.05 < robot.truth().travel_m - start.travel_m < 2.5


def test_without_a_server_there_is_an_exit_code_of_its_own(robot: RunningRobot) -> None:
    nowhere = ("--wait", "1", "--namespace", "nobody_is_here")
    commands = [robot.command(*words, *nowhere) for words in (("drive", "0.5"), ("stop",))]
    assert [robot.exit_code(command) for command in commands] == [6, 6]


def test_canbase_stop_holds_the_robot_until_canbase_reset(robot: RunningRobot) -> None:
    command = robot.command("drive", "3.0", "--speed", "0.3")
    robot.wait_speed(0.25)
    assert robot.run("stop") == 0
    assert robot.exit_code(command) == 4
    assert "DRIVE_FAULT" in command.log()
    robot.wait_state(DriverStatus.LATCHED)
    robot.wait_standing()

    latched_s = time.monotonic()
    with pytest.raises(RejectedError):
        robot.client.send(0.3, 0.2)
    assert robot.moved_since(latched_s, 1.0) < RESTS_M

    assert robot.run("reset") == 0
    robot.wait_enabled()
    assert robot.moved_since(latched_s, 1.0) < RESTS_M
    assert robot.driven(0.05)


def test_a_reset_is_refused_while_a_source_orders_a_velocity(robot: RunningRobot) -> None:
    joystick = robot.node.source()
    assert robot.run("stop") == 0
    robot.wait_state(DriverStatus.LATCHED)
    robot.wait_standing()

    held_s = time.monotonic()
    joystick.message = TwistStamped()
    joystick.message.twist.linear.x = 0.2
    robot.node.spin_for(0.5)
    refused = robot.command("reset")
    assert robot.exit_code(refused) == 1
    assert "joystick orders a velocity" in refused.log()
    assert robot.moved_since(held_s, 1.0) < RESTS_M

    joystick.message = None
    robot.make_ready()
    assert robot.moved_since(held_s, 1.0) < RESTS_M


def test_in_a_terminal_monitor_shows_the_robot_until_ctrl_c(robot: RunningRobot) -> None:
    ours, its = pty.openpty()
    os.set_blocking(ours, False)
    environment = {**os.environ, **robot.env, "TERM": "xterm", "COLUMNS": "150", "LINES": "50"}
    process = subprocess.Popen(
        [*CANBASE, "monitor"], stdin=its, stdout=its, stderr=its, env=environment, start_new_session=True,
        preexec_fn=_take_terminal,
    )  # fmt: skip
    os.close(its)
    shown = bytearray()

    def sees(*words: str) -> bool:
        try:
            shown.extend(os.read(ours, 1 << 16))
        except OSError:  # nothing there now, or the terminal's other end is closed
            return False
        return all(word.encode() in shown for word in words)

    try:
        robot.node.wait_for(
            lambda: sees("no active source", "driver ENABLED", "watchdog ok", "left_wheel"), 20.0, "a picture"
        )
        joystick = robot.node.source()
        joystick.message = TwistStamped()
        robot.node.wait_for(lambda: sees("joystick drives", "operation enabled"), 20.0, f"the joystick in {shown!r}")
        joystick.message = None
        os.write(ours, CTRL_C)
        deadline_s = time.monotonic() + 10.0
        while process.poll() is None and time.monotonic() < deadline_s:
            sees()
            time.sleep(0.05)
        sees()
        assert process.poll() == 0
        assert b"Traceback" not in shown
        assert shown.rfind(b"\x1b[?25h") > shown.rfind(b"\x1b[?25l")  # the cursor is back
        assert shown.rfind(b"\x1b[?1049l") > shown.rfind(b"\x1b[?1049h")  # and the screen as it was
    finally:
        process.kill()
        process.wait(10.0)
        os.close(ours)


def test_without_a_terminal_monitor_prints_a_line_for_each_change(robot: RunningRobot) -> None:
    monitor = robot.command("monitor")
    robot.node.wait_for(lambda: "driver ENABLED" in monitor.log(), 20.0, "the first lines")
    joystick = robot.node.source()
    joystick.message = TwistStamped()
    robot.node.wait_for(lambda: "joystick drives" in monitor.log(), 20.0, "the change")
    joystick.message = None
    robot.node.wait_for(lambda: "no active source" in monitor.log().splitlines()[-1], 20.0, "the change back")
    monitor.interrupt()
    assert robot.exit_code(monitor) == 0
    lines = [text[10:] for text in monitor.log().splitlines()]  # without the time of day
    assert all(text != before for before, text in itertools.pairwise(lines))
    assert "\x1b" not in monitor.log()


def _take_terminal() -> None:
    """The pty becomes the controlling terminal of the new session, so that Ctrl-C in it is SIGINT."""
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
