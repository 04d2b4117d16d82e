"""`canbase up` as a process: every way to end it leaves the robot standing and no part behind.

The simulated drives are a process of their own here, which outlives it and tells what the wheels do afterwards.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from canbase_sim.control import control_path
from support.ros_harness import Process
from support.running_robot import RESTS_M, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

PARTS = {"driver", "velocity", "watchdog", "action-server"}
END_S = 30.0


class Driving:
    """`canbase up`, whose robot drives at 0.3 m/s."""

    def __init__(self, robot: RunningRobot) -> None:
        self.robot = robot
        robot.command("serve", "sim", "--config", str(robot.config))
        robot.node.wait_for(control_path(robot.robot).is_socket, 20.0, "the simulator")
        self.up: Process = robot.command("up", "--config", str(robot.config), "--no-sim")
        robot.wait_whole()
        self.parts = parts_of(self.up.pid)
        robot.goal(4.0, 0.3)
        robot.wait_speed(0.28)

    def assert_all_ended_standing(self) -> None:
        ended_s = time.monotonic()
        assert self.robot.moved_since(ended_s, 1.0) < RESTS_M
        assert self.robot.truth().linear_mps == pytest.approx(0.0, abs=1e-6)
        assert [part for part, pid in self.parts.items() if lives(pid)] == []


@pytest.fixture
def driving() -> Iterator[Driving]:
    with own_domain() as domain, robot_on(domain, start=False) as robot:
        yield Driving(robot)


def test_asked_to_end_it_stops_the_robot_and_ends_well(driving: Driving) -> None:
    assert set(driving.parts) == PARTS
    driving.up.interrupt()
    assert driving.robot.exit_code(driving.up, END_S) == 0, driving.up.log()
    driving.assert_all_ended_standing()


def test_when_a_part_dies_it_says_which_and_ends_the_others(driving: Driving) -> None:
    os.kill(driving.parts["action-server"], signal.SIGKILL)
    assert driving.robot.exit_code(driving.up, END_S) == 1
    assert "action-server was ended by SIGKILL" in driving.up.log()
    driving.assert_all_ended_standing()


def test_when_it_is_killed_itself_the_parts_stop_the_robot_and_end(driving: Driving) -> None:
    driving.up.kill()
    driving.robot.node.wait_for(lambda: not any(map(lives, driving.parts.values())), END_S, "the end of the parts")
    driving.assert_all_ended_standing()


def test_a_stop_signal_while_the_parts_still_start_ends_it_well() -> None:
    with own_domain() as domain, robot_on(domain, start=False) as robot:
        up = robot.command("up", "--config", str(robot.config))
        robot.node.wait_for(lambda: len(parts_of(up.pid)) == len(PARTS) + 1, 20.0, "the parts")
        up.terminate()
        assert robot.exit_code(up, END_S) in (0, 1)  # a part that has no handler yet dies of its SIGTERM
        assert "stopping the robot" in up.log()


def test_it_says_when_the_robot_is_ready_and_no_part_imports_from_the_folder_in_which_it_was_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each part imports difflib, by typer; Fast DDS would read this profile, and complain of it."""
    (tmp_path / "difflib.py").write_text(f"open({str(tmp_path / 'caught')!r}, 'a').write('difflib')\n")
    (tmp_path / "DEFAULT_FASTRTPS_PROFILES.xml").write_text("<planted/>")
    monkeypatch.chdir(tmp_path)
    with own_domain() as domain, robot_on(domain, start=False) as robot:
        up = robot.command("up", "--config", str(robot.config))
        robot.node.wait_for(lambda: "canbase: READY after" in up.log(), 40.0, "READY")
        drive = robot.command("drive", "0.05")  # the first thing that it names
        assert robot.exit_code(drive, 20.0) == 0, drive.log()
        up.interrupt()
        assert robot.exit_code(up, END_S) == 0, up.log()
        assert "`canbase drive 0.5`, `canbase monitor`" in up.log()
        assert "canbase.sim:" not in up.log()  # with -v alone
        assert "XMLPARSER" not in up.log()

    assert not (tmp_path / "caught").exists()


def parts_of(pid: int) -> dict[str, int]:
    """Process ids of the children of `canbase up`, by part; none before it has come to its own command."""
    children = [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    parts = {part_of(child): child for child in children}
    return {part: child for part, child in parts.items() if part is not None}


def part_of(pid: int) -> str | None:
    """From `python -m canbase_cli.child PARENT part …`, and `python -m canbase_watchdog …`, which that becomes."""
    words = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
    if "canbase_watchdog" in words:
        return "watchdog"
    return words[words.index("canbase_cli.child") + 3] if "canbase_cli.child" in words else None


def lives(pid: int) -> bool:
    """It runs, and is no zombie that waits to be reaped."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except (FileNotFoundError, ProcessLookupError):
        return False
