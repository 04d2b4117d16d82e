"""Goals on one whole robot: of the programs of docs/actions.md, of Nav2's recovery, under a lock of the mux, and beside
a second publisher of a state. Nothing moves when the lock opens, or when that publisher ends.
"""

from __future__ import annotations

import asyncio
import math
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from threading import Event
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from builtin_interfaces.msg import Duration
from canbase.msg import MuxState
from geometry_msgs.msg import Point, TwistStamped
from nav2_msgs.action import BackUp, Spin
from nav_msgs.msg import Odometry
from rclpy.action import ActionClient
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from std_msgs.msg import Bool

from canbase_action_server.client import DriveClient, RejectedError
from canbase_action_server.outcome import ErrorCode, Status
from canbase_action_server.rotate_client import RotateClient
from canbase_config.state_age import STATE_PERIOD_S, state_timeout_s
from canbase_velocity.mux_node import GRAPH_PERIOD_S
from ros.conftest import Spawn
from support.ros_harness import Repeater, TestNode, merged
from support.running_robot import PATIENT, RESTS_M, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(400)]

LOCK = {"topic": "pause", "priority": 45, "required": False}
"""Above the goals, below navigation and joystick."""
CHANGES = merged(PATIENT, {"mux": {"locks": {"pause": LOCK}}, "action": {"nav2_behaviors": True}})
NOTICED_S = GRAPH_PERIOD_S + STATE_PERIOD_S
"""From a second publisher in the ROS graph to the goal that stops, but for one control cycle."""
ENDS_S = NOTICED_S + 0.3 / 0.8 + 0.6
"""To its end: braking from 0.3 m/s, and standstill that the encoders have shown."""
LOADED_S = 2.0
"""For DDS, which discovers the second publisher, and for a loaded computer."""
RESULT_S = 20.0
ALLOWANCE = Duration(sec=15)
PAGE = Path(__file__).parents[2] / "docs" / "actions.md"
MOST_LINES = 40
BUILD_S = 300.0


def program(name: str) -> str:
    """The block below the mark `<!-- program: name -->`."""
    (block,) = re.findall(rf"<!-- program: {re.escape(name)} -->\n```\w+\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    assert len(block.splitlines()) <= MOST_LINES
    return str(block)


def has_rclcpp() -> bool:
    try:
        get_package_prefix("rclcpp_action")
    except (PackageNotFoundError, OSError):  # OSError: ROS 2 from PyPI, without AMENT_PREFIX_PATH
        return False
    return shutil.which("cmake") is not None


class Paused:
    """A robot and the button that locks it."""

    def __init__(self, robot: RunningRobot, domain: int) -> None:
        self.robot, self.domain = robot, domain
        self.button: Repeater[Bool] = robot.node.repeat(Bool, "pause", 10.0)
        robot.node.wait_for_subscriber(self.button.publisher)

    def hold(self, locked: bool) -> None:
        self.button.message = Bool(data=locked)
        self.robot.node.spin_for(0.5)


@pytest.fixture(scope="module")
def paused() -> Iterator[Paused]:
    with own_domain() as domain, robot_on(domain, changes=CHANGES) as robot:
        yield Paused(robot, domain)


@pytest.fixture(scope="module")
def in_python(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    file = tmp_path_factory.mktemp("python") / "errand.py"
    file.write_text(program(file.name), encoding="utf-8")
    return [sys.executable, str(file)]


@pytest.fixture(scope="module")
def in_cpp(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder = tmp_path_factory.mktemp("cpp")
    for name in ("errand.cpp", "CMakeLists.txt"):
        (folder / name).write_text(program(name), encoding="utf-8")
    (folder / "package.xml").write_text(
        '<package format="3"><name>errand</name><version>0.0.0</version><description>x</description>'
        '<maintainer email="x@example.org">x</maintainer><license>Apache-2.0</license></package>'
    )
    build = folder / "build"
    for command in (["cmake", "-S", str(folder), "-B", str(build)], ["cmake", "--build", str(build)]):
        subprocess.run(command, check=True, timeout=BUILD_S)
    return [str(build / "errand")]


CPP = pytest.param("in_cpp", marks=pytest.mark.skipif(not has_rclcpp(), reason="rclcpp_action is not installed"))


EXECUTORS: dict[str, Callable[..., Any]] = {
    "single": SingleThreadedExecutor,
    "multi": partial(MultiThreadedExecutor, 3),
    "events": EventsExecutor,
}


@contextmanager
def spinning(executor: Any) -> Iterator[None]:
    """In another thread."""
    ended = Event()

    def spin() -> None:
        while not ended.is_set():
            executor.spin_once(timeout_sec=0.1)
            time.sleep(0.01)  # the work of the application, in which nothing spins

    with ThreadPoolExecutor(1) as thread:
        spun = thread.submit(spin)
        try:
            yield
        finally:
            ended.set()
        spun.result()  # no error of two threads in one executor


@pytest.mark.parametrize("thread", ["this", "another"])
@pytest.mark.parametrize("executor", EXECUTORS)
def test_two_clients_on_one_node_drive_with_each_executor(paused: Paused, executor: str, thread: str) -> None:
    context = paused.robot.node.node.context
    node, spins = Node("application", context=context), EXECUTORS[executor](context=context)
    spins.add_node(node)
    drive, rotate = DriveClient(node), RotateClient(node)
    with spinning(spins) if thread == "another" else nullcontext():
        for client, way, speed in ((drive, 0.1, 0.3), (rotate, 0.2, 1.0)):
            result = client.send(way, speed, discovery_timeout_s=RESULT_S).wait(RESULT_S)
            assert result is not None
            assert result.status is Status.SUCCEEDED
    drive.close()
    rotate.close()
    spins.shutdown()
    node.destroy_node()


def test_two_threads_use_the_clients_of_one_node(paused: Paused) -> None:
    """One goal gets the base, the other is rejected: none is sent and left alone by an error of the executor."""
    node = Node("application", context=paused.robot.node.node.context)
    clients: tuple[Any, ...] = (DriveClient(node), RotateClient(node))

    def send(client: Any) -> str:
        try:
            return str(client.send(0.1, 0.3, discovery_timeout_s=RESULT_S).wait(RESULT_S).status.name)
        except RejectedError:
            return "REJECTED"

    with ThreadPoolExecutor(2) as threads:
        assert sorted(threads.map(send, clients)) == ["REJECTED", "SUCCEEDED"]
    for client in clients:
        client.close()
    node.destroy_node()


def test_the_square_of_the_page_ends_where_it_began(paused: Paused, tmp_path: Path, spawn: Spawn) -> None:
    robot, file = paused.robot, tmp_path / "square.py"
    file.write_text(program(file.name), encoding="utf-8")
    start = robot.truth()
    square = spawn([sys.executable, str(file)], robot.env)
    assert square.wait(60.0) == 0, square.log()
    end = robot.truth()
    assert math.dist((start.x_m, start.y_m), (end.x_m, end.y_m)) < 0.02
    assert end.path_m - start.path_m == pytest.approx(2.0, abs=0.02)


def test_an_application_of_asyncio_waits_in_a_thread_and_its_loop_runs_on(paused: Paused) -> None:
    node, turns = Node("application", context=paused.robot.node.node.context), 0
    client = DriveClient(node)

    async def application() -> Any:
        nonlocal turns
        goal = await asyncio.to_thread(client.send, 0.1, 0.3, discovery_timeout_s=RESULT_S)
        result = asyncio.create_task(asyncio.to_thread(goal.wait, RESULT_S))
        while not result.done():
            await asyncio.sleep(0.01)
            turns += 1
        return result.result()

    assert asyncio.run(application()).status is Status.SUCCEEDED
    assert turns > 10
    client.close()
    node.destroy_node()


@pytest.mark.parametrize("language", ["in_python", CPP])
def test_the_program_drives_its_distance_and_reports_a_rejection_and_a_cancel(
    paused: Paused, language: str, request: pytest.FixtureRequest, spawn: Spawn
) -> None:
    robot, argv = paused.robot, list[str](request.getfixturevalue(language))

    start_m = robot.truth().travel_m
    there = spawn([*argv, "0.4"], robot.env)
    assert robot.exit_code(there) == 0, there.log()
    assert "m left" in there.log()
    assert "at standstill" in there.log()
    assert robot.truth().travel_m - start_m == pytest.approx(0.4, abs=0.01)

    start_m = robot.truth().travel_m
    far = spawn([*argv, "100"], robot.env)
    assert robot.exit_code(far) != 0
    assert "reject" in far.log().lower()
    assert robot.truth().travel_m - start_m < RESTS_M

    canceled = spawn([*argv, "3.0"], robot.env)
    robot.wait_speed(0.2)
    canceled.interrupt()
    assert robot.exit_code(canceled) not in (0, -signal.SIGINT), canceled.log()
    assert robot.moved_since(time.monotonic(), 0.5) < RESTS_M
    assert robot.truth().travel_m - start_m < 2.5


def result_of(robot: RunningRobot, client: ActionClient, goal: Any) -> Any:
    """Of a goal that is accepted at once."""
    answer = client.send_goal_async(goal)
    robot.node.wait_for(answer.done, 5.0, "the answer")
    assert answer.result().accepted, robot.logs()
    ended = answer.result().get_result_async()
    robot.node.wait_for(ended.done, RESULT_S, "the result")
    return ended.result()


def test_a_recovery_follows_on_a_controller_that_has_just_driven(paused: Paused) -> None:
    robot = paused.robot
    back_up = ActionClient(robot.node.node, BackUp, "backup")
    spin = ActionClient(robot.node.node, Spin, "spin")
    robot.node.wait_for(lambda: back_up.server_is_ready() and spin.server_is_ready(), 10.0, "the servers")
    controller = robot.node.source("cmd_vel_nav")
    controller.message = TwistStamped()
    controller.message.twist.linear.x = 0.25
    robot.wait_speed(0.2)
    controller.message = TwistStamped()  # it gives up …
    robot.node.spin_for(0.1)  # … and the base is still braking
    controller.message = None

    ended = result_of(robot, back_up, BackUp.Goal(target=Point(x=0.3), speed=0.2, time_allowance=ALLOWANCE))
    ended_s, stood = time.monotonic(), robot.truth()
    assert ended.status == GoalStatus.STATUS_SUCCEEDED, ended.result.error_msg
    assert "drove -0.30" in ended.result.error_msg or "drove -0.29" in ended.result.error_msg
    assert robot.moved_since(ended_s, 1.0) < RESTS_M

    ended = result_of(robot, spin, Spin.Goal(target_yaw=-1.57, time_allowance=ALLOWANCE))
    assert ended.status == GoalStatus.STATUS_SUCCEEDED, ended.result.error_msg
    turned_rad = math.remainder(robot.truth().yaw_rad - stood.yaw_rad, 2.0 * math.pi)
    assert turned_rad == pytest.approx(-1.57, abs=0.05)  # in truth: the simulated wheels slip a little


def test_a_goal_under_a_lock_is_rejected(paused: Paused) -> None:
    paused.hold(True)
    with pytest.raises(RejectedError, match="velocity_mux holds action back: locked: pause holds"):
        paused.robot.client.send(0.5, 0.3)
    drive = paused.robot.command("drive", "0.5")
    assert paused.robot.exit_code(drive) == 5
    assert "velocity_mux holds action back: locked: pause holds; unlock it first" in drive.log()
    paused.hold(False)
    assert paused.robot.driven(0.05)


def test_a_goal_whose_lock_closes_ends_blocked_and_nothing_moves_when_it_opens(paused: Paused) -> None:
    paused.hold(False)
    goal = paused.robot.goal(2.0, 0.3)
    paused.robot.wait_speed(0.25)
    paused.hold(True)
    result = goal.wait(5.0)
    assert result is not None
    assert result.code is ErrorCode.BLOCKED
    assert "locked: pause holds" in result.message
    paused.robot.wait_standing()
    opened_s = time.monotonic()
    paused.hold(False)
    assert paused.robot.moved_since(opened_s, 1.5) < RESTS_M


@pytest.mark.parametrize(
    ("topic", "kind", "code", "node"),
    [
        ("odom", Odometry, ErrorCode.ODOMETRY_LOST, "motor_driver"),
        ("velocity_mux/state", MuxState, ErrorCode.TAKEN_OVER, "velocity_mux"),
    ],
)
def test_a_second_publisher_of_a_state_ends_the_goal_and_none_starts(
    paused: Paused, topic: str, kind: type[Any], code: ErrorCode, node: str
) -> None:
    robot, why = paused.robot, f"/player publishes on /{topic}: only /{node} should"
    goal = robot.goal(4.0, 0.3)
    robot.wait_speed(0.25)
    with TestNode("player", domain_id=paused.domain) as player:
        replayed = player.repeat(kind, topic, 50.0)
        replayed.message = kind() if kind is MuxState else None  # five times as often as the mux: reports no publisher
        added_s = time.monotonic()
        while (result := goal.wait(0.05)) is None and time.monotonic() < added_s + ENDS_S + LOADED_S:
            player.spin_for(0.02)
        assert result is not None
        assert result.code is code
        assert why in result.message
        robot.wait_standing()
        asked_s = time.monotonic()
        while time.monotonic() < asked_s + 2.0 * state_timeout_s():
            player.spin_for(0.02)
            with pytest.raises(RejectedError, match=why):
                robot.client.send(0.5, 0.3)
    ended_s = time.monotonic()
    assert robot.moved_since(ended_s, 1.0) < RESTS_M
    assert robot.driven(0.05)
