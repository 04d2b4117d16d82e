"""A stop of a whole robot of real processes: `canbase record replay` finds the files of all parts, and all decide the
same. An emergency stop: test_stop_events.py; a dead driver: bus/test_watchdog_inputs.py."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
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


# 0.3 m/s ── canbase stop ── the files of driver, mux and filter: the same setpoints and decisions
def test_a_stop_on_request_is_replayed_by_the_files_of_all_parts(robot: RunningRobot) -> None:
    at_speed(robot)
    began_s = time.time()
    assert robot.run("stop") == 0
    velocity, driver = written(robot, "velocity_*.jsonl", began_s), written(robot, "stop_*.asc", began_s)
    inputs = read_velocity(velocity)
    assert inputs.head.cause == "driver"
    found = replay_velocity(inputs)
    assert found.agrees, (found.mux_differences[:2], found.filter_differences[:2])
    assert found.decisions > 50
    assert "estop" not in [replayed.cause for _, replayed in causes(found)]
    values = replayed(driver)
    assert values["velocity"]["source"] == velocity.name  # type: ignore[index]
