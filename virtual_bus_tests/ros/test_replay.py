"""Stops of a whole robot of real processes: `canbase record replay` finds the files of all parts, and all decide the
same."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from std_msgs.msg import Bool
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_recording.replay_file import read_velocity
from canbase_recording.replay_velocity import causes, replay_velocity
from support.running_robot import RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(180)]

WRITTEN_S = 20.0


@pytest.fixture(scope="module")
def robot() -> Iterator[RunningRobot]:
    with own_domain() as domain, robot_on(domain) as running:
        yield running


def at_speed(robot: RunningRobot) -> None:
    robot.reset("safety_filter/reset")
    robot.make_ready()
    robot.goal(4.0, 0.3)
    robot.wait_speed(0.28)


def written(robot: RunningRobot, pattern: str, since_s: float) -> Path:
    """The first such file that is written after this time [s since 1970]."""

    def found() -> Path | None:
        files = Path(robot.env["XDG_STATE_HOME"]).rglob(pattern)
        return next((file for file in sorted(files) if file.stat().st_mtime > since_s), None)

    file = robot.node.wait_for(found, WRITTEN_S, pattern)
    assert file is not None
    return file


def replayed(file: Path) -> dict[str, object]:
    done = CliRunner().invoke(app, ["record", "replay", str(file), "--json"])
    assert done.exit_code == 0, CliRunner().invoke(app, ["record", "replay", str(file)]).output
    values = json.loads(done.output)
    assert isinstance(values, dict)
    return values


def press(robot: RunningRobot) -> None:
    """The button, and its release."""
    button = robot.node.node.create_publisher(Bool, "estop_state", 1)
    robot.node.wait_for_subscriber(button)
    for pressed in (True, False):
        for _ in range(5):
            button.publish(Bool(data=pressed))
            robot.node.spin_for(0.1)
    robot.node.node.destroy_publisher(button)


# 0.3 m/s ── a stop that needs a reset ── the files of driver, mux and filter: the same setpoints and decisions
@pytest.mark.parametrize(("stop", "said"), [(lambda robot: robot.run("stop"), "driver"), (press, "estop")])
def test_a_latched_stop_is_replayed_by_the_files_of_all_parts(
    robot: RunningRobot, stop: Callable[[RunningRobot], object], said: str
) -> None:
    at_speed(robot)
    began_s = time.time()
    stop(robot)
    velocity, driver = written(robot, "velocity_*.jsonl", began_s), written(robot, "stop_*.asc", began_s)
    inputs = read_velocity(velocity)
    assert inputs.head.cause == said
    found = replay_velocity(inputs)
    assert found.agrees, (found.mux_differences[:2], found.filter_differences[:2])
    assert found.decisions > 50
    assert (said == "estop") == ("estop" in [replayed.cause for _, replayed in causes(found)])
    values = replayed(driver)
    assert values["velocity"]["source"] == velocity.name  # type: ignore[index]


# 0.3 m/s ── the driver is killed, with all that it had recorded ── the watchdog trips, and has the frames
def test_the_stop_of_a_driver_that_is_dead_is_replayed(robot: RunningRobot) -> None:
    """The last test of this robot."""
    at_speed(robot)
    began_s = time.time()
    robot.send("driver", signal.SIGKILL)
    values = replayed(written(robot, "watchdog_*.jsonl", began_s))
    life = values["watchdog"]["lives"][-1]  # type: ignore[index]
    assert life["recorded"] == life["replayed"]
    assert (life["recorded"]["cause"], life["late_s"]) == ("DRIVER_SILENT", 0.0)
