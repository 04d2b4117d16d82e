"""stop_events and the black box over DDS: what is told of a stop is what really happened, and its file can be read."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import can
import pytest
from canbase.msg import StopEvent

from canbase_config.load import load_robot
from canbase_config.robot import Robot
from canbase_driver.runtime.black_box import MAX_FRAMES
from canbase_recording.cause import Cause
from canbase_recording.explain_file import explain_file
from support.running_robot import RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

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
    robot.make_ready()
    robot.goal(4.0, 0.3)
    robot.wait_speed(0.28)
    return time.monotonic()


def test_a_latched_stop_has_its_time_its_way_and_a_file_that_python_can_reads(robot: RunningRobot) -> None:
    began_s = at_speed(robot)
    assert robot.run("stop") == 0
    event = event_since(robot, began_s, "motor_driver")
    robot.wait_standing()
    age_s = robot.node.node.get_clock().now().nanoseconds * 1e-9 - (event.stamp.sec + event.stamp.nanosec * 1e-9)
    cause_s = time.monotonic() - age_s
    truth = robot.standstill_after(cause_s)
    assert (event.cause, event.latched, event.standstill) == ("stop requested", True, True)
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


def test_a_source_that_hangs_is_a_stop_that_is_not_latched(robot: RunningRobot) -> None:
    began_s = at_speed(robot)
    robot.send("action-server", signal.SIGSTOP)
    event = event_since(robot, began_s, "velocity_mux")
    robot.send("action-server", signal.SIGCONT)
    assert (event.cause, event.latched, event.standstill, event.black_box) == ("no_source", False, True, "")
    assert "action: no message for" in event.detail
    assert 0.05 < event.standstill_s < 2.0
