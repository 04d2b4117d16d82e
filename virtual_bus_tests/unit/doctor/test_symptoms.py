"""`canbase doctor --symptom`, from what was seen to the first check that fails; and what it finds in /proc."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from canbase.msg import DriverStatus
from geometry_msgs.msg import TransformStamped, TwistStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage
from typer.testing import CliRunner

from canbase_action_server.along_track import BasePose
from canbase_action_server.goal_step import GoalStep
from canbase_action_server.inputs import Driver, Inputs, Mux, Safety
from canbase_action_server.inputs import Odometry as OdometryInput
from canbase_cli.main import app
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_doctor.check import INCONCLUSIVE, Verdict, exit_code, first_failure
from canbase_doctor.evidence import Answers, Endpoint, Evidence, Goal, Heard, LoggedStep, ServerProcess
from canbase_doctor.overload import Overload
from canbase_doctor.server_processes import server_processes, talks_by
from canbase_doctor.symptom_checks import CHECKS, walk
from canbase_doctor.symptoms import SYMPTOMS
from canbase_runtime.driver_state import DriverState
from canbase_runtime.received import Received
from canbase_runtime.stop_cause import StopCause
from canbase_runtime.watchdog_view import WatchdogView

WALL_S = 1_700_000_000
NOW = Time(sec=WALL_S)
SERVER = Endpoint("/drive_distance_server", "action_msgs/msg/GoalStatusArray")
SENDER = Endpoint("/drive_distance_server", "geometry_msgs/msg/TwistStamped")
CLIENT = Endpoint("/canbase_drive", "canbase/action/DriveDistance_FeedbackMessage")
RUNS = Goal("drive_distance", "ab", Goal.EXECUTING)
ENDED = Goal("drive_distance", "cd", 4)
ROBOT = load_robot(sample("bench")).robot
FEEDBACK = "drive_distance/_action/feedback"


def heard(*messages: Any, every_s: float = 0.1) -> Heard:
    return Heard(messages, tuple(1.0 + i * every_s for i in range(len(messages))))


def twist(linear_mps: float) -> TwistStamped:
    message = TwistStamped()
    message.twist.linear.x = linear_mps
    return message


def odometry(stamp: Time = NOW, child: str = "base_link") -> Odometry:
    message = Odometry(child_frame_id=child)
    message.header.frame_id, message.header.stamp = "odom", stamp
    return message


def scan(stamp: Time = NOW) -> LaserScan:
    message = LaserScan()
    message.header.stamp = stamp
    return message


def transforms(child: str = "base_link", x_m: float = 0.0) -> TFMessage:
    transform = TransformStamped(child_frame_id=child)
    transform.header.frame_id = "odom"
    transform.transform.translation.x = x_m
    return TFMessage(transforms=[transform])


def status(**values: Any) -> DriverStatus:
    return DriverStatus(**{"state": DriverStatus.ENABLED, "watchdog": "ok", "standstill": True} | values)


def step(name: str, at_s: float = WALL_S - 2.0, uuid: str | None = "cd", **values: Any) -> LoggedStep:
    return LoggedStep(GoalStep(name), uuid, at_s, values)


INPUTS = Inputs(
    odometry=Received(OdometryInput(9.9, BasePose(0.0, 0.0, 0.0), 0.0, 0.0), 9.9),
    safety=Received(Safety(False, StopCause.NONE, "", False), 9.9),
    driver=Received(
        Driver(DriverState.ENABLED, "none", "", WatchdogView.OK, "none", standstill=True, hears_command=True), 9.9
    ),
    mux=Received(Mux(""), 9.9),
)
HEALTHY = Evidence(
    robot=ROBOT,
    source="bench.yaml",
    now_s=10.0,
    wall_s=float(WALL_S),
    heard={
        "motor_driver/status": heard(status()),
        "odom": heard(*[odometry()] * 20, every_s=0.02),
        "tf": heard(transforms()),
        "scan": heard(scan()),
        "cmd_vel": heard(twist(0.0)),
        "cmd_vel_action": heard(twist(0.0)),
        FEEDBACK: heard(*[object()] * 10),
    },
    inputs=INPUTS,
    steps=(
        step("rejected", uuid=None, action="drive_distance", distance_m=1.0, max_speed_mps=0.2, reason="busy"),
        step("stopping", WALL_S - 3.0),
        step("standstill", WALL_S - 2.6),
    ),
    servers={"/drive_distance": (SERVER,), "/rotate_angle": (SERVER,)},
    publishers={"cmd_vel_action": (SENDER,), "cmd_vel": (SENDER,), "cmd_vel_mux": (SENDER,)},
    subscribers={FEEDBACK: (CLIENT,), "cmd_vel": (SENDER,)},
    goals=(ENDED,),
    processes=(ServerProcess(7, {}),),
    answers=Answers((0.002, 0.003), (0.002, 0.004), {"cd": True}),
)


def but(seen: Evidence = HEALTHY, **topics: Heard) -> Evidence:
    """`seen` with other messages on topics; / is written __."""
    return replace(seen, heard={**seen.heard, **{name.replace("__", "/"): each for name, each in topics.items()}})


RUNNING = replace(but(cmd_vel_action=heard(*[twist(0.2)] * 20, every_s=0.02)), goals=(ENDED, RUNS))


def publishing(topic: str, *endpoints: Endpoint) -> Evidence:
    return replace(HEALTHY, publishers={**HEALTHY.publishers, topic: endpoints})


TF = "tf2_msgs/msg/TFMessage"


def two_on_tf(tf: Heard) -> Evidence:
    return but(publishing("tf", Endpoint("/motor_driver", TF), Endpoint("/ekf_filter_node", TF)), tf=tf)


def rejected(**numbers: float) -> Evidence:
    return replace(HEALTHY, steps=(step("rejected", uuid=None, **numbers),))


def muxed(mux: Mux | None) -> Evidence:
    return replace(HEALTHY, inputs=replace(INPUTS, mux=Received(mux, 9.9)))


def driver(**values: Any) -> Evidence:
    return but(motor_driver__status=heard(status(**values)))


def robot_with(section: str, **values: Any) -> Robot:
    return ROBOT.model_copy(update={section: getattr(ROBOT, section).model_copy(update=values)})


WELL = dict.fromkeys(SYMPTOMS, HEALTHY) | {"no-feedback": RUNNING, "slow-cancel": RUNNING}


def test_the_table_has_the_eight_symptoms_and_checks_for_each() -> None:
    assert list(CHECKS) == list(SYMPTOMS)
    assert len(SYMPTOMS) == 8
    assert min(len(checks) for checks in CHECKS.values()) == 3


@pytest.mark.parametrize(
    ("symptom", "seen"),
    WELL.items(),
)
def test_on_a_robot_that_is_well_every_check_of_every_symptom_is_ok(symptom: str, seen: Evidence) -> None:
    rows = walk(symptom, seen)
    assert [(row.name, row.found) for row in rows if row.verdict is not Verdict.OK] == []
    assert len(rows) == len(CHECKS[symptom])


ELSEWHERE = replace(HEALTHY, servers={"/robot2/drive_distance": (SERVER,)})
OTHER_DOMAIN = replace(HEALTHY, servers={}, processes=(ServerProcess(7, {"ROS_DOMAIN_ID": "5"}),))
UNSEEN = replace(HEALTHY, servers={})
STAMPED, BARE = "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist"
JOINT_STATE = "sensor_msgs/msg/JointState"
OLD = Time(sec=WALL_S - 100)
NOT_ASKED = replace(HEALTHY, answers=Answers())
HUNG = replace(RUNNING, answers=Answers((math.inf,), ()))
OF_ANOTHER = replace(ELSEWHERE, processes=(ServerProcess(7, {}, "other"),))
BOTH = replace(ELSEWHERE, processes=(ServerProcess(7, {}, "other"), ServerProcess(8, {}, ROBOT.name)))

BROKEN = [
    ("not-listed", replace(UNSEEN, processes=()), "the server's process", "canbase up"),
    ("not-listed", ELSEWHERE, "name and namespace", "--namespace /robot2"),
    ("not-listed", OF_ANOTHER, "the server's process", f"none of {ROBOT.name} runs on this computer, and none is seen; "
     "process 7 is that of other; /robot2/drive_distance"),
    ("not-listed", BOTH, "name and namespace", f"--namespace /robot2, that of {ROBOT.name}"),
    ("not-listed", replace(OTHER_DOMAIN, processes=(ServerProcess(6, {"ROS_DOMAIN_ID": "9"}, "other"),
     *OTHER_DOMAIN.processes)), "domain and network", "process 7: ROS_DOMAIN_ID is 5 there"),
    ("not-listed", OTHER_DOMAIN, "domain and network", "5 there, 0"),
    ("not-listed", UNSEEN, "domain and network", "same settings"),
    ("rejected", rejected(distance_m=100.0, max_speed_mps=0.2), "range of the goal", "|distance_m| is 100"),
    ("rejected", rejected(angle_rad=1.0, max_speed_radps=9.0), "range of the goal", "max_speed_radps is 9"),
    ("rejected", rejected(distance_m=math.nan, max_speed_mps=0.2), "NaN and infinity", "nan"),
    ("rejected", RUNNING, "busy, or not safe to start", "busy: goal ab"),
    ("rejected", replace(HEALTHY, inputs=Inputs()), "busy, or not safe to start", "odom"),
    ("no-feedback", HUNG, "a goal executes", "whether a goal runs is unknown"),
    ("no-feedback", replace(NOT_ASKED, goals=()), "a goal executes", "does not answer"),
    ("no-feedback", HEALTHY, "a goal executes", "none runs"),
    ("no-feedback", replace(HEALTHY, goals=(replace(RUNS, status=1),)), "a goal executes", "waits"),
    ("no-feedback", but(RUNNING, **{FEEDBACK: Heard()}), "feedback is published", "0.0 Hz instead of 10"),
    ("no-feedback", but(RUNNING, **{FEEDBACK: heard(*[0] * 10, every_s=0.25)}), "feedback is published", "4.0 Hz"),
    ("no-feedback", replace(RUNNING, subscribers={}), "a client listens", "no subscriber"),
    ("slow-cancel", replace(RUNNING, answers=Answers((0.002, 0.3), (0.3,))), "no blocking work", "300 ms"),
    ("slow-cancel", NOT_ASKED, "no blocking work", "not found"),
    ("slow-cancel", replace(RUNNING, answers=Answers((0.002,), (0.3,))), "callback group of the cancel", "300 ms"),
    ("slow-cancel", but(RUNNING, cmd_vel_action=heard(*[twist(0.2)] * 5, every_s=0.3)), "executor", "0.30 s apart"),
    ("slow-cancel", replace(RUNNING, steps=(step("stopping", WALL_S - 5.0),)), "the stop itself", "took 5.00 s"),
    ("no-result", replace(HEALTHY, answers=Answers((math.inf,), ())), "the server answers", "ended, or hangs"),
    ("no-result", NOT_ASKED, "the server answers", "do not send the goal again"),
    ("no-result", replace(HEALTHY, answers=Answers((0.1,), (), {"cd": False})), "ended goals give their result", "cd"),
    ("no-result", but(RUNNING, cmd_vel_action=Heard()), "running goals are on their way to an end", "ab executes"),
    ("moves-after-cancel", but(cmd_vel_action=heard(twist(0.2))), "zero on cmd_vel_action", "defect"),
    ("moves-after-cancel", publishing("cmd_vel_action", SENDER, CLIENT), "zero on cmd_vel_action", "/canbase_drive"),
    ("moves-after-cancel", publishing("cmd_vel", SENDER, CLIENT), "who owns the base", "cmd_vel is published by"),
    ("moves-after-cancel", muxed(Mux("joystick")), "who owns the base", "joystick"),
    ("moves-after-cancel", muxed(None), "who owns the base", "publishes nothing"),
    ("moves-after-cancel", but(motor_driver__status=Heard()), "driver and watchdog", "publishes nothing"),
    ("moves-after-cancel", driver(standstill=False), "driver and watchdog", "wheel turns"),
    ("moves-after-cancel", driver(watchdog="missing"), "driver and watchdog", "missing"),
    ("only-in-simulation", but(odom=Heard()), "odometry", "nothing on odom"),
    ("only-in-simulation", but(odom=heard(odometry(OLD))), "odometry", "100.0 s old"),
    ("only-in-simulation", publishing("joint_states", Endpoint("/motor_driver", JOINT_STATE),
     Endpoint("/joint_state_broadcaster", JOINT_STATE)), "odometry", "end joint_state_broadcaster"),
    ("only-in-simulation", publishing("odom", Endpoint("/motor_driver", "nav_msgs/msg/Odometry"),
     Endpoint("/ekf", "nav_msgs/msg/Odometry")), "odometry", "odom is published by /motor_driver, /ekf"),
    ("only-in-simulation", but(odom=heard(odometry(child="base_footprint"))), "odometry", "base_footprint"),
    ("only-in-simulation", but(tf=heard(transforms("laser"))), "tf", "missing"),
    ("only-in-simulation", two_on_tf(heard(transforms(), transforms(x_m=0.1))), "tf", "from one of /ekf_filter_node"),
    ("only-in-simulation", two_on_tf(heard(*[transforms()] * 40)), "tf", "odometry.publish_tf: false"),
    ("only-in-simulation", replace(but(tf=heard()), robot=robot_with("odometry", publish_tf=False)),
     "tf", "start the filter"),
    ("only-in-simulation", but(scan=heard(scan(OLD))), "stamps of the sensors", "100.0 s ago"),
    ("only-in-simulation", publishing("cmd_vel_nav", Endpoint("/nav2", BARE)), "command interface", "stamped: false"),
    ("only-in-simulation", publishing("cmd_vel_nav", Endpoint("/wheels", JOINT_STATE)),
     "command interface", "set mux.sources.navigation.type: joint_command, or let it send geometry_msgs/msg/TwistSt"),
    ("only-in-simulation", replace(HEALTHY, subscribers={}), "command interface", "no subscriber on cmd_vel"),
    ("goals-collide", replace(HEALTHY, servers={"/drive_distance": (SERVER, SERVER)}), "one server", "2 servers"),
    ("goals-collide", UNSEEN, "one server", "no server offers"),
    ("goals-collide", replace(HEALTHY, goals=(RUNS, replace(RUNS, uuid="ef"))), "one goal at a time", "2 goals run"),
    ("goals-collide", publishing("cmd_vel_action", SENDER, CLIENT), "one publisher of cmd_vel_action", "canbase"),
]  # fmt: skip


@pytest.mark.parametrize(("symptom", "seen", "name", "told"), BROKEN)
def test_the_first_check_that_fails_is_named_and_says_what_to_do(
    symptom: str, seen: Evidence, name: str, told: str
) -> None:
    rows = walk(symptom, seen)
    failed = first_failure(rows)
    assert failed is not None
    assert failed.name == name
    assert failed is rows[-1]
    assert told in f"{failed.found}; {failed.advice}"
    assert failed.advice


def test_every_check_of_the_table_can_fail() -> None:
    failed = {first.name for symptom, seen, _, _ in BROKEN if (first := first_failure(walk(symptom, seen)))}
    names = {row.name for symptom in SYMPTOMS for row in walk(symptom, WELL[symptom])}
    assert failed == names


def test_motion_that_a_goal_orders_by_right_is_no_failure_but_is_named() -> None:
    rows = walk("moves-after-cancel", RUNNING)
    assert (rows[0].verdict, rows[0].advice) == (Verdict.WARN, "cancel it, then call doctor")


def test_a_required_scan_that_is_silent_fails_and_one_that_is_not_required_does_not() -> None:
    silent = but(scan=Heard())
    assert first_failure(walk("only-in-simulation", silent)) is None
    required = ROBOT.safety.scan.model_copy(update={"required": True})
    failed = first_failure(walk("only-in-simulation", replace(silent, robot=robot_with("safety", scan=required))))
    assert failed is not None
    assert "nothing on scan" in failed.found


def test_with_nav2s_behaviours_each_of_their_names_has_one_server_too() -> None:
    names = ("/drive_distance", "/rotate_angle", "/drive_on_heading", "/backup", "/spin")
    seen = replace(HEALTHY, robot=robot_with("action", nav2_behaviors=True), servers=dict.fromkeys(names, (SERVER,)))
    assert first_failure(walk("goals-collide", seen)) is None
    nav2 = Endpoint("/behavior_server", "nav2_msgs/action/Spin")
    failed = first_failure(walk("goals-collide", replace(seen, servers={**seen.servers, "/spin": (SERVER, nav2)})))
    assert failed is not None
    assert "2 servers offer /spin" in failed.found
    assert "behavior_plugins" in failed.advice


@pytest.mark.parametrize(
    "goal",
    [
        {"action": "spin", "target_yaw": 1.57},
        {"action": "backup", "target.x": 0.3, "speed": 0.15},
        {"action": "drive_on_heading", "target.x": -0.3, "speed": -0.15},
    ],
)
def test_a_rejected_goal_of_nav2_is_in_range_and_the_robot_has_the_reason(goal: Mapping[str, Any]) -> None:
    seen = replace(HEALTHY, steps=(step("rejected", uuid=None, **goal),), inputs=Inputs())
    failed = first_failure(walk("rejected", seen))
    assert failed is not None
    assert failed.name == "busy, or not safe to start"


@pytest.mark.parametrize(("length", "busy"), [(1, True), (2, False)])
def test_a_full_queue_is_busy_and_one_with_a_place_is_not(length: int, busy: bool) -> None:
    one_waits = (RUNS, replace(RUNS, uuid="ef", status=Goal.ACCEPTED))
    robot = robot_with("action", goal_policy="queue", queue_length=length)
    rows = walk("rejected", replace(HEALTHY, goals=one_waits, robot=robot))
    assert (rows[-1].verdict is Verdict.FAIL) is busy
    assert ("1 goals wait" in rows[-1].found) is busy


def process(proc: Path, pid: int, words: list[str], environment: Mapping[str, str]) -> None:
    """A process as /proc shows it."""
    folder = proc / str(pid)
    folder.mkdir()
    (folder / "exe").symlink_to("/usr/bin/python3" if words[0] != "bash" else "/usr/bin/bash")
    (folder / "cmdline").write_bytes("\0".join(words).encode() + b"\0")
    (folder / "environ").write_bytes("\0".join(f"{name}={value}" for name, value in environment.items()).encode())


def test_servers_are_found_among_all_processes_with_what_decides_whom_they_talk_to(tmp_path: Path) -> None:
    domain = {"ROS_DOMAIN_ID": "5", "SECRET": "x"}
    process(tmp_path, 10, ["python", "-m", "canbase_cli.child", "9", "action-server", "--config", "a"], domain)
    (tmp_path / "10" / "cwd").mkdir()
    (tmp_path / "10" / "cwd" / "a").write_text("name: robot_a\n", encoding="utf-8")
    process(tmp_path, 11, ["/usr/bin/canbase", "action-server"], {})
    process(tmp_path, 12, ["/usr/bin/canbase", "driver"], domain)
    process(tmp_path, 13, ["less", "action-server"], domain)
    (tmp_path / "14").mkdir()  # it ended between two looks
    process(tmp_path, 15, ["/usr/bin/python3", "/opt/ws/lib/canbase/drive_distance_server", "--config", "a"], {})
    process(tmp_path, 16, ["bash", "/usr/bin/canbase", "action-server"], domain)  # called as if it were one
    found = (ServerProcess(10, {"ROS_DOMAIN_ID": "5"}, "robot_a"), ServerProcess(11, {}), ServerProcess(15, {}))
    assert server_processes(tmp_path) == found
    assert talks_by(99, tmp_path) == {}


BUSY = Overload(late_s=0.4, load=5.0)
LATE = Time(sec=WALL_S - 3)
SLOW = [
    ("only-in-simulation", but(odom=heard(odometry(LATE))), "odometry"),
    ("no-feedback", but(RUNNING, **{FEEDBACK: heard(*[0] * 10, every_s=0.25)}), "feedback is published"),
    ("slow-cancel", replace(RUNNING, answers=Answers(question_s=(0.3,), cancel_s=(0.01,))), "no blocking work"),
    (
        "slow-cancel",
        replace(RUNNING, answers=Answers(question_s=(0.01,), cancel_s=(0.3,))),
        "callback group of the cancel",
    ),
]


@pytest.mark.parametrize(("symptom", "seen", "name"), SLOW)
def test_what_is_late_on_an_overloaded_computer_is_inconclusive_and_accuses_nobody(
    symptom: str, seen: Evidence, name: str
) -> None:
    quiet = {row.name: row for row in walk(symptom, seen)}
    assert quiet[name].verdict is Verdict.FAIL
    rows = walk(symptom, replace(seen, overload=BUSY))
    row = next(row for row in rows if row.name == name)
    assert row.verdict is Verdict.INCONCLUSIVE
    assert "this computer is overloaded: doctor's own turns were up to 0.40 s late" in row.found
    assert "clocks" not in row.advice
    assert exit_code([row]) == INCONCLUSIVE


@pytest.mark.parametrize(
    ("symptom", "seen", "name"),
    [
        ("only-in-simulation", but(odom=heard(odometry(OLD))), "odometry"),  # 100 s
        ("only-in-simulation", but(odom=heard(odometry(Time(sec=WALL_S + 30)))), "odometry"),  # from the future
        (
            "slow-cancel",
            replace(RUNNING, answers=Answers(question_s=(math.inf,), cancel_s=(0.01,))),
            "no blocking work",
        ),
    ],
)
def test_what_no_load_explains_fails_on_an_overloaded_computer_too(symptom: str, seen: Evidence, name: str) -> None:
    rows = walk(symptom, replace(seen, overload=BUSY))
    assert next(row for row in rows if row.name == name).verdict is Verdict.FAIL


@pytest.mark.parametrize(
    ("overload", "is_one"),
    [(Overload(), False), (Overload(0.1, 4.0), False), (Overload(0.11, 0.2), True), (Overload(0.0, 4.01), True)],
)
def test_what_an_overload_is(overload: Overload, is_one: bool) -> None:
    assert bool(overload.sentence) is is_one


def test_an_unknown_symptom_is_a_wrong_command_line_that_names_the_known_ones() -> None:
    done = CliRunner().invoke(app, ["doctor", "--symptom", "sad"], env={"COLUMNS": "200"})
    assert (done.exit_code, "goals-collide" in done.output) == (2, True)
