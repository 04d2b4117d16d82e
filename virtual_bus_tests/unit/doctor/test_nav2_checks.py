"""Doctor's rows about Nav2, from the velocities in the ROS graph: as it should be, and each mistake."""

from __future__ import annotations

import math
from typing import Any

import pytest

from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_doctor.check import Check, Verdict
from canbase_doctor.evidence import Endpoint, Evidence, VelocityTopic
from canbase_doctor.nav2_checks import nav2_checks
from canbase_doctor.nav2_speeds import SPEEDS

STAMPED, PLAIN = "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist"
VALUES = {
    ("velocity_smoother", "max_velocity"): (0.8, 0.0, 2.0),
    ("docking_server", "controller.v_linear_max"): (0.15,),
}
GOOD = {
    "cmd_vel_controller": (("controller_server", "behavior_server"), ("velocity_smoother",)),
    "cmd_vel_smoothed": (("velocity_smoother",), ("collision_monitor",)),
    "cmd_vel_nav": (("collision_monitor",), ("velocity_mux", "_motor_driver_black_box")),
    "cmd_vel_docking": (("docking_server",), ("velocity_mux",)),
    "cmd_vel_teleop": (("joystick",), ("behavior_server",)),
    "cmd_vel_mux": (("velocity_mux",), ()),
    "cmd_vel": (("safety_filter",), ("motor_driver",)),
}
"""Topic → nodes that publish, nodes that read. All of them with stamps."""
DOCKING = {"topic": "cmd_vel_docking", "priority": 55, "timeout_s": 0.5}
FIRST = load_robot(sample("bench")).robot


def robot(**sources: dict[str, Any]) -> Robot:
    values = FIRST.model_dump()
    values["mux"]["sources"] = {"docking": DOCKING, **values["mux"]["sources"], **sources}
    return Robot.model_validate(values)


ROBOT = robot()


def end(name: str, namespace: str = "") -> Endpoint:
    """`name`, or `name:Twist`."""
    node, _, kind = name.partition(":")
    return Endpoint(f"{namespace}/{node}", PLAIN if kind else STAMPED)


def rows(changes: dict[str, Any] | None = None, namespace: str = "", of: Robot = ROBOT) -> list[Check]:
    """Of GOOD with these topics instead; None: nobody."""
    topics = {name: ends for name, ends in {**GOOD, **(changes or {})}.items() if ends}
    velocities = {
        f"{namespace}/{name}": VelocityTopic(
            tuple(end(each, namespace) for each in publishers), tuple(end(each, namespace) for each in readers)
        )
        for name, (publishers, readers) in topics.items()
    }
    return nav2_checks(
        Evidence(
            robot=of,
            source="bench.yaml",
            now_s=10.0,
            namespace=namespace or "/",
            velocities=velocities,
            nav2_values=VALUES,
        )
    )


def failures(changes: dict[str, Any], of: Robot = ROBOT) -> list[tuple[str, str]]:
    return [(row.found, row.advice) for row in rows(changes, of=of) if row.verdict is Verdict.FAIL]


@pytest.mark.parametrize("namespace", ["", "/robot1"])
def test_all_is_well_and_the_way_of_the_velocities_is_shown(namespace: str) -> None:
    wiring, speeds = rows(namespace=namespace)
    assert wiring.verdict is Verdict.OK
    way = "controller_server → cmd_vel_controller → velocity_smoother → cmd_vel_smoothed → collision_monitor"
    assert wiring.found == f"{way} → cmd_vel_nav → velocity_mux; docking_server → {namespace}/cmd_vel_docking"
    assert speeds.verdict is Verdict.OK


def test_without_nav2_there_is_no_row() -> None:
    ours = {name: ends for name, ends in GOOD.items() if name in ("cmd_vel_mux", "cmd_vel")}
    assert rows({**dict.fromkeys(GOOD), **ours}) == []
    assert rows({**dict.fromkeys(GOOD), "cmd_vel_nav": (("my_planner",), ("velocity_mux",))}) == []


def test_nav2_of_another_robot_is_not_ours() -> None:
    theirs = {f"robot2/{name}": tuple(tuple(f"robot2/{node}" for node in nodes) for nodes in ends)
              for name, ends in GOOD.items()}  # fmt: skip
    assert rows({**dict.fromkeys(GOOD), **theirs}) == []


def test_nav2_as_it_comes_publishes_on_the_input_of_the_driver() -> None:
    nodes = ("safety_filter", "collision_monitor", "docking_server")
    [(found, advice)] = failures({"cmd_vel": (nodes, ("motor_driver",)), "cmd_vel_nav": None, "cmd_vel_docking": None})
    assert found.startswith("/cmd_vel, the input of motor_driver, has publishers beside safety_filter: collision_")
    assert "remap docking_server:cmd_vel:=cmd_vel_docking" in advice
    assert "collision_monitor: cmd_vel_out_topic: cmd_vel_nav" in advice


def test_a_loop_is_shown_from_node_to_node() -> None:
    """The parameters of this page before it was corrected: the monitor feeds the smoother again."""
    told = failures({"cmd_vel_controller": None,
                     "cmd_vel_nav": (("controller_server", "collision_monitor"),
                                     ("velocity_smoother", "velocity_mux"))})  # fmt: skip
    loop = "collision_monitor → cmd_vel_nav → velocity_smoother → cmd_vel_smoothed → collision_monitor"
    assert told[0][0] == f"a loop: {loop}"
    assert "canbase print nav2 --launch" in told[0][1]
    assert told[1][0] == "velocity_mux reads /cmd_vel_nav before velocity_smoother has smoothed or checked it"
    assert told[2][0].endswith("has 2 publishers: controller_server and collision_monitor")


def test_the_mux_before_the_monitor_is_no_loop_but_unchecked() -> None:
    smoothed = {"topic": "cmd_vel_smoothed", "priority": 51, "timeout_s": 0.5}
    topics = {"cmd_vel_smoothed": (("velocity_smoother",), ("collision_monitor", "velocity_mux"))}
    [(found, _)] = failures(topics, of=robot(smoothed=smoothed))
    assert found == "velocity_mux reads /cmd_vel_smoothed before collision_monitor has smoothed or checked it"


def test_controllers_without_smoother_and_monitor_may_share_a_source() -> None:
    """As in the lecture: the filter of canbase limits and checks alone."""
    lecture = {"cmd_vel_controller": None, "cmd_vel_smoothed": None,
               "cmd_vel_nav": (("controller_server", "behavior_server"), ("velocity_mux",))}  # fmt: skip
    assert failures(lecture) == []


def test_two_publishers_of_one_source() -> None:
    [(found, advice)] = failures({"cmd_vel_nav": (("collision_monitor", "docking_server"), ("velocity_mux",))})
    assert found == "/cmd_vel_nav, the topic of one source, has 2 publishers: collision_monitor and docking_server"
    assert "docking_server:cmd_vel:=cmd_vel_docking" in advice
    [(found, _)] = failures({"cmd_vel_nav": (("collision_monitor", "keyboard"), ("velocity_mux",))})
    assert "keyboard" in found


def test_types_that_do_not_meet() -> None:
    [(found, advice)] = failures({"cmd_vel_nav": (("collision_monitor:Twist",), ("velocity_mux", "black_box"))})
    assert found == (
        "collision_monitor publishes Twist on /cmd_vel_nav, velocity_mux reads TwistStamped: nothing arrives"
    )
    assert "collision_monitor: enable_stamped_cmd_vel: true" in advice
    [(found, advice)] = failures({"cmd_vel_controller": (("controller_server:Twist",), ("velocity_smoother",))})
    assert "controller_server publishes Twist" in found
    assert "enable_stamped_cmd_vel of all nodes of Nav2" in advice
    [(found, _)] = failures({"cmd_vel_teleop": (("joystick:Twist",), ("behavior_server",))})
    assert "joystick publishes Twist on /cmd_vel_teleop" in found


def test_a_robot_that_wants_twist_is_told_so() -> None:
    navigation = {"topic": "cmd_vel_nav", "priority": 50, "timeout_s": 0.5, "stamped": False}
    [(_, advice)] = failures(
        {"cmd_vel_nav": (("collision_monitor",), ("velocity_mux:Twist",))}, of=robot(navigation=navigation)
    )
    assert "enable_stamped_cmd_vel: false" in advice


@pytest.mark.parametrize(
    ("topic", "ends", "cure"),
    [
        ("out", (("collision_monitor",), ("rviz",)), "cmd_vel_out_topic: cmd_vel_nav"),
        ("cmd_vel_smoothed", (("velocity_smoother",), ()), "running and configured"),
    ],
)
def test_nobody_reads(topic: str, ends: Any, cure: str) -> None:
    [(found, advice)] = failures({"cmd_vel_nav": None, topic: ends})
    assert found == f"nobody reads /{topic} of {ends[0][0]}"
    assert cure in advice


def test_a_docking_server_that_no_source_reads_is_a_warning() -> None:
    """Nav2's launch file starts it whether one docks or not."""
    wiring, docking, _ = rows({"cmd_vel_docking": (("docking_server",), ())})
    assert (wiring.verdict, docking.verdict) == (Verdict.OK, Verdict.WARN)
    assert "add the source docking" in docking.advice


def speed_row(values: dict[tuple[str, str], tuple[float, ...]]) -> Check:
    topics = {"/cmd_vel_nav": VelocityTopic((end("collision_monitor"),), (end("velocity_mux"),))}
    return nav2_checks(Evidence(robot=ROBOT, source="", now_s=0.0, velocities=topics, nav2_values=values))[-1]


@pytest.mark.parametrize("speed", SPEEDS, ids=lambda speed: f"{speed.node} {speed.parameter}")
@pytest.mark.parametrize("value", [-2.5, 2.5, math.nan, math.inf])
def test_a_speed_above_ours_is_named(speed: Any, value: float) -> None:
    row = speed_row({speed.key: (value,) * len(speed.units)})
    assert row.verdict is Verdict.WARN
    assert row.found.count(f"{speed.node} {speed.parameter} is {value:g}") == sum(map(bool, speed.units))
    assert "canbase print nav2" in row.advice


def test_a_speed_like_ours_is_good_and_no_answer_is_no_evidence() -> None:
    assert speed_row({("velocity_smoother", "min_velocity"): (-0.8, 0.0, -2.0)}).verdict is Verdict.OK
    assert speed_row({}).verdict is Verdict.WARN
