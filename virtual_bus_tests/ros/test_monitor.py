"""`canbase monitor` beside a running robot: in a terminal until Ctrl-C, and as lines where there is none."""

from __future__ import annotations

import itertools
import os
import pty
import subprocess
import time
from collections.abc import Iterator

import pytest
from geometry_msgs.msg import TwistStamped

from support.running_robot import CANBASE, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]
CTRL_C = b"\x03"


@pytest.fixture(scope="module")
def robot() -> Iterator[RunningRobot]:
    with own_domain() as domain, robot_on(domain) as running:
        yield running


def test_in_a_terminal_it_shows_the_robot_until_ctrl_c(robot: RunningRobot) -> None:
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
        joystick = robot.node.repeat(TwistStamped, "cmd_vel_joy", 50.0)
        joystick.message = TwistStamped()
        robot.node.wait_for(lambda: sees("joystick drives", "operation enabled"), 20.0, f"the joystick in {shown!r}")
        joystick.message = None
        robot.node.node.destroy_publisher(joystick.publisher)
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


def test_without_a_terminal_it_prints_a_line_for_each_change(robot: RunningRobot) -> None:
    monitor = robot.command("monitor")
    robot.node.wait_for(lambda: "driver ENABLED" in monitor.log(), 20.0, "the first lines")
    joystick = robot.node.repeat(TwistStamped, "cmd_vel_joy", 50.0)
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
    import fcntl
    import termios

    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
