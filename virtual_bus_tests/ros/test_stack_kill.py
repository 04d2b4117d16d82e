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

from canbase_action_server.client import Drive
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
    path: Path | None = request.config.getoption("--stop-times", default=None)
    if path is not None:
        with path.open("a") as file:
            file.writelines(f"{row}\n" for row in rows)


@pytest.fixture
def fresh() -> Iterator[RunningRobot]:
    """A robot for one test: a process that was killed leaves traces in DDS for seconds."""
    with own_domain() as domain, robot_on(domain, changes={}) as robot:
        yield robot


@pytest.fixture(scope="module")
def lasting() -> Iterator[RunningRobot]:
    """A robot for all tests after which every process still runs."""
    with own_domain() as domain, robot_on(domain, changes={}) as robot:
        yield robot


@pytest.mark.parametrize("part", PARTS)
def test_a_process_is_killed_while_the_robot_drives(fresh: RunningRobot, note: Note, part: str) -> None:
    goal = driving(fresh)
    moment_s = fresh.send(part, signal.SIGKILL)
    stop = stands_and_stays(fresh, moment_s)
    end = "–" if part == "action-server" else aborted_with(goal, ENDS[part])
    note(part, "SIGKILL", stop, end)
    assert stop.after_s < STANDS_WITHIN_S


@pytest.mark.parametrize("part", PARTS)
def test_a_process_hangs_while_the_robot_drives_and_goes_on_later(lasting: RunningRobot, note: Note, part: str) -> None:
    goal = driving(lasting)
    moment_s = lasting.send(part, signal.SIGSTOP)
    stop = stands_and_stays(lasting, moment_s)
    resumed_s = lasting.send(part, signal.SIGCONT)
    assert lasting.moved_since(resumed_s, QUIET_S) < RESTS_M
    note(part, "SIGSTOP", stop, aborted_with(goal, ENDS[part]))
    assert stop.after_s < STANDS_WITHIN_S
    assert lasting.stack.death() is None
    lasting.make_ready()
    assert lasting.driven(0.1)  # nothing is broken for good


def test_a_driver_that_was_killed_can_be_started_again(fresh: RunningRobot) -> None:
    driving(fresh)
    fresh.send("driver", signal.SIGKILL)
    fresh.wait_standing()
    assert fresh.stack.end("driver") == -signal.SIGKILL
    started_s = time.monotonic()
    fresh.stack.start()
    fresh.node.wait_for(lambda: fresh.status.since(started_s), 20.0, "the new driver")
    assert fresh.moved_since(started_s, QUIET_S) < RESTS_M
    assert fresh.status.messages[-1].state != DriverStatus.ENABLED  # the watchdog has tripped: that needs a reset
    fresh.make_ready()
    assert fresh.driven(0.1)


def driving(robot: RunningRobot) -> Drive:
    """A goal on its way at full speed."""
    goal = robot.goal(4.0, SPEED_MPS)
    robot.wait_speed(0.97 * SPEED_MPS)
    robot.node.spin_for(0.2)
    assert goal.result is None, f"{goal.result}\n{robot.logs()}"
    return goal


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
