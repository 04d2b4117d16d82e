"""`canbase record start` beside a robot of real processes: written as it drives, read by all that read a stop's."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from subprocess import PIPE

import pytest
from typer.testing import CliRunner

from canbase_action_server.outcome import Status
from canbase_cli.main import app
from support.running_robot import CANBASE, READY_S, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(180)]


@pytest.fixture(scope="module")
def robot() -> Iterator[RunningRobot]:
    with own_domain() as domain, robot_on(domain) as running:
        yield running


def record(robot: RunningRobot, *options: str) -> tuple[int, str, str]:
    """Exit code, stdout, stderr; the test's node goes on meanwhile, so that its goal does too."""
    words = [*CANBASE, "record", "start", *options]
    with subprocess.Popen(words, env=os.environ | robot.env, stdout=PIPE, stderr=PIPE, text=True) as process:
        robot.node.wait_for(lambda: process.poll() is not None, 60.0, "canbase record start")
        told, problem = process.communicate()
        return process.returncode, told.strip(), problem.strip()


def run(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, list(words))
    return done.exit_code, done.output


def test_it_is_written_while_the_robot_drives_and_explain_export_and_replay_read_it(
    robot: RunningRobot, tmp_path: Path
) -> None:
    """── goal of 4 m ── at speed ── record --seconds 1 ── a second request at once ── the goal succeeds ──"""
    robot.make_ready()
    goal = robot.goal(4.0, 0.3)
    robot.wait_speed(0.28)
    out = tmp_path / "driving.asc"
    code, told, problem = record(robot, "--seconds", "1", "--out", str(out))
    assert (code, told) == (0, str(out)), problem
    code, _, problem = record(robot)
    assert code == 1
    assert "less than 5 s ago" in problem
    robot.wait_speed(0.28)
    result = goal.wait(READY_S)
    assert result is not None
    assert result.status is Status.SUCCEEDED
    values = json.loads(out.with_suffix(".json").read_text())
    assert (values["stopped_by"], values["cause"]) == ("nobody", "recording requested")
    assert {"order", "cmd_vel", "velocity_mux/state", "safety_filter/state", "motor_driver/state"} <= {
        event["what"] for event in values["events"]
    }
    assert values["robot_yaml_sha256"]
    assert values["versions"]["canbase"]
    code, text = run("explain", str(out))
    assert code == 0, text
    assert "No stop was found" in text
    assert run("record", "export", str(out), "--mcap", str(tmp_path / "driving.mcap"))[0] == 0
    code, text = run("record", "replay", str(out))
    assert code == 0, text


def test_without_out_it_is_beside_the_recordings_of_stops(robot: RunningRobot) -> None:
    robot.node.spin_for(5.0)
    code, told, problem = record(robot)
    assert code == 0, problem
    assert Path(told).name.startswith("record_")
    assert Path(told).with_suffix(".json").is_file()
    assert Path(told).is_relative_to(robot.env["XDG_STATE_HOME"])


def test_a_folder_that_cannot_be_written_is_told_to_the_caller_and_the_robot_goes_on(robot: RunningRobot) -> None:
    """The folder becomes a file: root may write where permissions forbid it."""
    folder = Path(robot.env["XDG_STATE_HOME"]) / "canbase"
    away = folder.with_name("away")
    robot.node.spin_for(5.0)
    os.rename(folder, away)
    try:
        folder.write_text("a file")
        code, _, problem = record(robot)
    finally:
        folder.unlink()
        os.rename(away, folder)
    assert code == 1
    assert f"the black box cannot write to {folder}" in problem
    robot.make_ready()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--out", "a.txt"), "must end with .asc"),
    ],
)
def test_what_the_command_line_cannot_mean(options: tuple[str, ...], said: str) -> None:
    code, text = run("record", "start", *options)
    assert (code, said in text) == (2, True)
