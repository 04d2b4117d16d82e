"""Stops of a whole robot over DDS, and its recordings: what is told of a stop is what really happened; the files of all
parts can be read, and decide the same again in a replay.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from subprocess import PIPE
from typing import Any

import can
import pytest
from canbase.msg import DriverStatus, StopEvent
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from typer.testing import CliRunner

from canbase_action_server.outcome import Status
from canbase_cli.main import app
from canbase_config.load import load_robot
from canbase_config.robot import Robot
from canbase_driver.runtime.black_box import MAX_FRAMES
from canbase_recording.cause import Cause
from canbase_recording.explain_file import explain_file
from canbase_recording.replay_file import read_velocity
from canbase_recording.replay_velocity import causes, replay_velocity
from support.running_robot import CANBASE, READY_S, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(180)]

WRITTEN_S = 20.0
SETPOINT, WATCHDOG_STATE, STATUS = 0x201, 0x1FE, 0x181
KINDS = (
    "order", "cmd_vel", "safety_filter/state", "velocity_mux/state", "motor_driver/state", "request", "answer",
)  # fmt: skip


@pytest.fixture(scope="module")
def robot() -> Iterator[RunningRobot]:
    with own_domain() as domain, robot_on(domain) as running:
        yield running


def event_since(robot: RunningRobot, since_s: float, by: str) -> StopEvent:
    """The first stop by that node."""

    def found() -> StopEvent | None:
        return next((each for each in robot.stop_events.since(since_s) if each.stopped_by == by), None)

    event = robot.node.wait_for(found, 15.0, f"a stop by {by}")
    assert event is not None
    return event


def at_speed(robot: RunningRobot) -> float:
    """A goal has the robot at 0.3 m/s; the time now."""
    robot.reset("safety_filter/reset")
    robot.make_ready()
    robot.goal(4.0, 0.3)
    robot.wait_speed(0.28)
    return time.monotonic()


def run(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, list(words))
    return done.exit_code, done.output


def record(robot: RunningRobot, *options: str) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of `canbase record start`, once the robot takes a request again; meanwhile the node
    of the test goes on, and with it its goal.
    """
    while True:
        words = [*CANBASE, "record", "start", *options]
        with subprocess.Popen(words, env=os.environ | robot.env, stdout=PIPE, stderr=PIPE, text=True) as process:
            robot.node.wait_for(lambda: process.poll() is not None, 60.0, "canbase record start")
            told, problem = process.communicate()
        if "less than 5 s ago" not in problem:
            return process.returncode, told.strip(), problem.strip()


def second_request(robot: RunningRobot) -> str:
    """The answer to the second of two requests for a recording that come at once."""
    client = robot.node.node.create_client(Trigger, "motor_driver/record")
    robot.node.wait_for(client.service_is_ready, READY_S, "motor_driver/record")
    answers = [client.call_async(Trigger.Request()) for _ in range(2)]
    robot.node.wait_for(lambda: all(answer.done() for answer in answers), READY_S, "both answers")
    robot.node.node.destroy_client(client)
    answer = answers[1].result()
    assert answer is not None
    assert not answer.success
    return str(answer.message)


def test_it_is_written_while_the_robot_drives_and_explain_export_and_replay_read_it(
    robot: RunningRobot, tmp_path: Path
) -> None:
    """── goal of 4 m ── at speed ── record --seconds 1 ── two requests at once ── at speed ── cancel ──"""
    robot.make_ready()
    goal = robot.goal(4.0, 0.3)
    robot.wait_speed(0.28)
    out = tmp_path / "driving.asc"
    code, told, problem = record(robot, "--seconds", "1", "--out", str(out))
    assert (code, told) == (0, str(out)), problem
    assert "less than 5 s ago" in second_request(robot)
    assert goal.result is None
    assert robot.truth().linear_mps > 0.28
    assert goal.cancel()
    result = goal.wait(READY_S)
    assert result is not None
    assert result.status is Status.CANCELED
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
    assert (code, text.count("cannot tell")) == (1, 2), "nothing tripped, so no part wrote its own file"


def test_a_latched_stop_has_its_time_its_way_and_a_file_that_python_can_reads(robot: RunningRobot) -> None:
    before_s = time.time()
    robot.reset("motor_driver/stop")  # the recording has what follows: a reset, ENABLED, and the next stop
    robot.wait_state(DriverStatus.LATCHED)
    written(robot, "velocity_*.jsonl", before_s)
    began_s, wall_s = at_speed(robot), time.time()
    assert robot.run("stop") == 0
    event = event_since(robot, began_s, "motor_driver")
    robot.wait_standing()
    age_s = robot.node.node.get_clock().now().nanoseconds * 1e-9 - (event.stamp.sec + event.stamp.nanosec * 1e-9)
    cause_s = time.monotonic() - age_s
    truth = robot.standstill_after(cause_s)
    assert (event.cause, event.latched, event.standstill) == ("stop requested", True, True)
    assert event.clears_on == "reset"
    assert event.standstill_s == pytest.approx(truth.after_s, abs=0.1)
    assert event.distance_m == pytest.approx(truth.way_m, abs=0.02)
    assert abs(event.turned_rad) < 0.05

    file = Path(event.black_box)
    robot.node.wait_for(file.exists, WRITTEN_S, event.black_box)
    with can.LogReader(file) as reader:
        frames = list(reader)
    assert 300 < len(frames) <= MAX_FRAMES
    assert {SETPOINT, WATCHDOG_STATE, STATUS} <= {frame.arbitration_id for frame in frames}
    assert 2.0 < frames[-1].timestamp - frames[0].timestamp <= 10.0
    comments = [line for line in file.read_text(encoding="utf-8").splitlines() if line.startswith("//")]
    for what in ("cmd_vel 0.3", "motor_driver STOPPING: stop requested", "safety_filter ", "velocity_mux action"):
        assert [line for line in comments if what in line], what
    found = json.loads(file.with_suffix(".json").read_text(encoding="utf-8"))
    assert (found["cause"], found["robot"], found["frames"]) == ("stop requested", robot.robot.name, file.name)
    assert Robot.model_validate(found["robot_yaml"]) == robot.robot
    assert found["at_s"] == pytest.approx(cause_s, abs=0.1)
    tells_all_that_was_ordered_and_what_became_of_it(found["events"])
    _, told = explain_file(file, load_robot(robot.config).robot)
    story = told.stories[-1]
    assert (story.cause, story.caught_by) == (Cause.STOP_REQUESTED, "motor_driver")
    assert story.standstill.stood_s == pytest.approx(truth.after_s, abs=0.1)
    assert story.standstill.distance_m == pytest.approx(truth.way_m, abs=0.02)
    is_decided_again_by_all_parts(robot, file, wall_s, "driver")


def tells_all_that_was_ordered_and_what_became_of_it(events: list[dict[str, Any]]) -> None:
    """`events` of a goal at 0.3 m/s until motor_driver/stop, over the last seconds."""
    assert [event["at_s"] for event in events] == sorted(event["at_s"] for event in events)
    by_kind = {what: [event for event in events if event["what"] == what] for what in KINDS}
    orders = [order for order in by_kind["order"] if order["source"] == "action"]
    assert max(order["linear_mps"] for order in orders) == pytest.approx(0.3, abs=0.01)
    assert len(orders) > 50
    commands = by_kind["cmd_vel"]
    assert max(command["linear_mps"] for command in commands) == pytest.approx(0.3, abs=0.01)
    wall_s = [command["stamp_s"] - command["at_s"] for command in commands]
    assert max(wall_s) - min(wall_s) < 0.1
    assert any(state["ordered_linear_mps"] > 0.25 for state in by_kind["safety_filter/state"])
    assert any(state["active"] == "action" for state in by_kind["velocity_mux/state"])
    assert [state["state"] for state in by_kind["motor_driver/state"]][-2:] == ["ENABLED", "STOPPING"]
    assert [request["request"] for request in by_kind["request"]][-1] == "stop"
    assert by_kind["answer"][-1]["done"]


def is_decided_again_by_all_parts(robot: RunningRobot, file: Path, since_s: float, cause: str) -> None:
    """A stop since then (s since 1970): mux and filter decide the same from their file, all parts from both files."""
    velocity = written(robot, f"velocity_*_{cause}.jsonl", since_s)
    inputs = read_velocity(velocity)
    assert inputs.head.cause == cause
    found = replay_velocity(inputs)
    assert found.agrees, (found.mux_differences[:2], found.filter_differences[:2])
    assert found.decisions > 50
    assert (cause == "estop") == ("estop" in [replayed.cause for _, replayed in causes(found)])
    code, text = run("record", "replay", str(file), "--json")
    assert code == 0, run("record", "replay", str(file))
    assert json.loads(text)["velocity"]["source"] == velocity.name


def written(robot: RunningRobot, pattern: str, since_s: float) -> Path:
    """The first such file that is written after this time [s since 1970]."""

    def found() -> Path | None:
        files = Path(robot.env["XDG_STATE_HOME"]).rglob(pattern)
        return next((file for file in sorted(files) if file.stat().st_mtime > since_s), None)

    file = robot.node.wait_for(found, WRITTEN_S, pattern)
    assert file is not None
    return file


# 0.3 m/s ── the button, and its release ── the files of driver, mux and filter: the same setpoints and decisions
def test_an_emergency_stop_is_decided_again_by_the_files_of_all_parts(robot: RunningRobot) -> None:
    at_speed(robot)
    wall_s = time.time()
    button = robot.node.node.create_publisher(Bool, "estop_state", 1)
    robot.node.wait_for_subscriber(button)
    for pressed in (True, False):
        for _ in range(5):
            button.publish(Bool(data=pressed))
            robot.node.spin_for(0.1)
    robot.node.node.destroy_publisher(button)
    is_decided_again_by_all_parts(robot, written(robot, "stop_*.asc", wall_s), wall_s, "estop")


def test_a_folder_that_cannot_be_written_is_told_to_the_caller_and_the_robot_goes_on(robot: RunningRobot) -> None:
    """The folder becomes a file: root may write where permissions forbid it."""
    folder = Path(robot.env["XDG_STATE_HOME"]) / "canbase"
    away = folder.with_name("away")
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


def test_a_source_that_hangs_is_a_stop_that_is_not_latched(robot: RunningRobot) -> None:
    began_s = at_speed(robot)
    robot.send("action-server", signal.SIGSTOP)
    event = event_since(robot, began_s, "velocity_mux")
    robot.send("action-server", signal.SIGCONT)
    assert (event.cause, event.latched, event.standstill, event.black_box) == ("no_source", False, True, "")
    assert "action: no message for" in event.detail
    assert 0.05 < event.standstill_s < 2.0


def test_without_out_it_is_beside_the_recordings_of_stops(robot: RunningRobot) -> None:
    code, told, problem = record(robot)
    assert code == 0, problem
    assert Path(told).name.startswith("record_")
    assert Path(told).with_suffix(".json").is_file()
    assert Path(told).is_relative_to(robot.env["XDG_STATE_HOME"])
