"""Each process of a robot that drives at 0.3 m/s is killed or hangs: the wheels must stand within a second, for good.

    0.3 m/s ───────╮ signal        all timeouts at their defaults
    0     ─────────╰────────────   measured by the simulator's ground truth, same clock as the signal's

`pytest --stop-times FILE` adds what was measured to FILE as rows of a Markdown table.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from canbase.msg import DriverStatus

from canbase_action_server.client import Drive, DriveClient
from canbase_action_server.outcome import ErrorCode, Status
from ros.running_robot import RESTS_M, RunningRobot, Standstill, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(150)]

SPEED_MPS = 0.3
STANDS_WITHIN_S = 1.0
QUIET_S = 2.0
PARTS = ("driver", "velocity", "watchdog", "action-server")
ENDS = {
    "driver": {ErrorCode.ODOMETRY_LOST},
    "velocity": {ErrorCode.WATCHDOG},  # the lease died with it
    "watchdog": {ErrorCode.WATCHDOG},
    "action-server": {ErrorCode.ODOMETRY_LOST},  # when it goes on, what it knows is old
}
"""How the goal may end. An action server that was killed tells nothing any more."""

Note = Callable[[str, str, Standstill, str], None]


@pytest.fixture(scope="module")
def note(request: pytest.FixtureRequest) -> Iterator[Note]:
    """Keeps what was measured, for the output and for --stop-times."""
    rows: list[str] = []

    def add(what: str, how: str, stop: Standstill, end: str) -> None:
        rows.append(f"| {what} | {how} | {stop.after_s * 1000:.0f} ms | {stop.way_m * 1000:.0f} mm | {end} |")
        print(rows[-1])

    yield add
    path: Path | None = request.config.getoption("--stop-times")
    if path is not None:
        with path.open("a") as file:
            file.writelines(f"{row}\n" for row in rows)


@pytest.fixture
def robot() -> Iterator[RunningRobot]:
    """One of its own for each test: a process that was killed leaves traces in DDS for seconds."""
    with own_domain() as domain, robot_on(domain, changes={}) as robot:
        yield robot


@pytest.fixture
def goal(robot: RunningRobot) -> Iterator[Drive]:
    """On its way at full speed."""
    client = DriveClient(robot.node.node, robot.node.executor)
    client.wait_for_server(20.0)
    robot.node.spin_for(1.0)  # the server rejects a goal before it has heard of all others
    goal = client.send(4.0, SPEED_MPS)
    robot.wait_speed(0.97 * SPEED_MPS)
    robot.node.spin_for(0.2)
    assert goal.result is None, f"{goal.result}\n{robot.logs()}"
    yield goal
    client.close()


@pytest.mark.parametrize("part", PARTS)
def test_a_process_is_killed_while_the_robot_drives(robot: RunningRobot, goal: Drive, note: Note, part: str) -> None:
    moment_s = robot.send(part, signal.SIGKILL)
    stop = stands_and_stays(robot, moment_s)
    end = "–"
    if part != "action-server":
        end = aborted_with(goal, ENDS[part])
    note(part, "SIGKILL", stop, end)
    assert stop.after_s < STANDS_WITHIN_S


@pytest.mark.parametrize("part", PARTS)
def test_a_process_hangs_while_the_robot_drives_and_goes_on_later(
    robot: RunningRobot, goal: Drive, note: Note, part: str
) -> None:
    moment_s = robot.send(part, signal.SIGSTOP)
    stop = stands_and_stays(robot, moment_s)
    resumed_s = robot.send(part, signal.SIGCONT)
    assert robot.moved_since(resumed_s, QUIET_S) < RESTS_M
    end = aborted_with(goal, ENDS[part])
    note(part, "SIGSTOP", stop, end)
    assert stop.after_s < STANDS_WITHIN_S

    robot.make_ready()
    assert robot.run("drive", "0.1", "--speed", "0.2") == 0  # nothing is broken for good
    assert robot.stack.death() is None


def test_a_driver_that_was_killed_can_be_started_again(robot: RunningRobot, goal: Drive) -> None:
    robot.send("driver", signal.SIGKILL)
    robot.wait_standing()
    assert robot.stack.end("driver") == -signal.SIGKILL
    robot.stack.start()
    started_s = time.monotonic()
    robot.node.wait_for(lambda: robot.status.since(started_s), 20.0, "the new driver")
    assert robot.moved_since(started_s, QUIET_S) < RESTS_M
    assert robot.status.messages[-1].state != DriverStatus.ENABLED  # the watchdog has tripped: that needs a reset
    robot.make_ready()
    assert robot.run("drive", "0.1", "--speed", "0.2") == 0


def stands_and_stays(robot: RunningRobot, moment_s: float) -> Standstill:
    """Waits until the base stands and QUIET_S longer: it must not move again meanwhile."""
    robot.wait_standing()
    stood_s = time.monotonic()
    assert robot.moved_since(stood_s, QUIET_S) < RESTS_M
    return robot.standstill_after(moment_s)


def aborted_with(goal: Drive, codes: set[ErrorCode]) -> str:
    """Name of the goal's error code, which must be one of these."""
    result = goal.wait(10.0)
    assert result is not None
    assert result.status is Status.ABORTED
    assert result.code in codes, result
    return result.code.name
