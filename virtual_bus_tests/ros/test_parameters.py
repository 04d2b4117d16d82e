"""Parameters of safety_filter over DDS, as `ros2 param` uses them: read robot.yaml, lower the speed while it drives."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
import rclpy
from canbase.msg import SafetyState
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.parameter import Parameter, parameter_value_to_python

from canbase_config.robot import Robot
from canbase_velocity.filter_node import FilterNode
from support.ros_harness import Process, TestNode, clear_records
from support.velocity_chain import Chain, drive

pytestmark = [pytest.mark.ros, pytest.mark.timeout(60)]
ANSWER_S = 10.0
LINEAR, ANGULAR = "speed_limit.linear_mps", "speed_limit.angular_radps"


@pytest.fixture
def chain(module_chain: Chain) -> Chain:
    """With the limits of robot.yaml."""
    module_chain.rest()
    assert put(module_chain, speed_limit__linear_mps=1.0).successful
    return module_chain


def call(chain: Chain, kind: Any, name: str, request: Any) -> Any:
    """The answer of a service of safety_filter."""
    client = chain.node.node.create_client(kind, f"safety_filter/{name}")
    chain.node.wait_for(client.service_is_ready, ANSWER_S, name)
    answer = client.call_async(request)
    chain.node.wait_for(answer.done, ANSWER_S, "an answer")
    chain.node.node.destroy_client(client)
    return answer.result()


def put(chain: Chain, **values: Any) -> SetParametersResult:
    """`ros2 param set`; dots are written __."""
    parameters = [Parameter(name.replace("__", "."), value=value).to_parameter_msg() for name, value in values.items()]
    return call(chain, SetParameters, "set_parameters", SetParameters.Request(parameters=parameters)).results[0]


def get(chain: Chain, *names: str) -> list[Any]:
    values = call(chain, GetParameters, "get_parameters", GetParameters.Request(names=names)).values
    return [parameter_value_to_python(value) for value in values]


def leased_mps(chain: Chain, since: int) -> set[float]:
    """What the watchdog was told from lease number `since` on."""
    chain.drain()
    return {lease[3] for lease in chain.leases[since:]}


def test_rates_frames_and_limits_of_robot_yaml_can_be_read_and_not_changed(chain: Chain) -> None:
    names = call(chain, ListParameters, "list_parameters", ListParameters.Request()).result.names
    assert {"rates.control_hz", "base.base_frame", "base.odom_frame", "limits.linear_mps", LINEAR} <= set(names)
    assert get(chain, "limits.linear_mps", "base.base_frame", "rates.control_hz") == [1.0, "base_link", 100.0]
    result = put(chain, limits__linear_mps=9.0)
    assert not result.successful
    assert "limits.linear_mps is a key of robot.yaml" in result.reason
    assert LINEAR in result.reason
    assert get(chain, "limits.linear_mps") == [1.0]


def test_the_speed_is_lowered_in_motion_and_the_watchdog_is_told_with_every_lease(chain: Chain) -> None:
    chain.joystick.message = drive(0.8, 0.4)
    chain.wait_for_order(0.8)
    assert put(chain, speed_limit__linear_mps=0.2).successful
    chain.wait_for_order(0.2)
    assert chain.ordered == pytest.approx((0.2, 0.1))
    chain.wait_for_cause(SafetyState.CAUSE_SPEED, "the parameters speed_limit of safety_filter: 0.80 m/s")
    chain.drain()
    told = len(chain.leases)
    chain.node.spin_for(0.5)
    assert leased_mps(chain, told) == {chain.ordered[0]}
    assert chain.ordered[0] <= 0.2
    assert "speed limit 0.2 m/s, 2 rad/s, set by a parameter" in chain.process.log()
    assert put(chain, speed_limit__linear_mps=1.0).successful
    chain.wait_for_order(0.8)


def test_a_limit_above_robot_yaml_or_none_at_all_is_refused_and_the_one_before_stays(chain: Chain) -> None:
    assert put(chain, speed_limit__linear_mps=0.2).successful
    for value in (1.01, -0.1, float("nan"), float("inf")):
        result = put(chain, speed_limit__linear_mps=value)
        assert not result.successful
        assert "expected 0 to 1" in result.reason
        assert get(chain, LINEAR) == [0.2]
    chain.joystick.message = drive(0.8)
    chain.wait_for_order(0.2)


def test_a_limit_of_another_type_is_refused(chain: Chain) -> None:
    assert not put(chain, speed_limit__linear_mps="slow").successful
    assert get(chain, LINEAR) == [1.0]


def test_a_whole_number_is_a_limit(chain: Chain) -> None:
    assert put(chain, speed_limit__linear_mps=0).successful
    assert get(chain, LINEAR) == [0]
    chain.joystick.message = drive(0.8)
    chain.wait_for_cause(SafetyState.CAUSE_SPEED, "the parameters speed_limit of safety_filter: 0.80 m/s")


LOOP = {"mux": {"sources": {"loop": {"topic": "/robot1/cmd_vel", "priority": 9, "timeout_s": 0.3}}}}
STARTS: tuple[tuple[list[str], Mapping[str, Any], int | None, str], ...] = (
    (["--ros-args", "-p", f"{LINEAR}:=0.2"], {}, None, "speed limit 0.2 m/s"),
    (["--ros-args", "-p", f"{LINEAR}:=3.0"], {}, 2, LINEAR),
    (["--ros-args", "-p", f"{LINEAR}:=fast"], {}, 2, LINEAR),
    (["--ros-args", "-p", "use_sim_time:=true"], {}, 2, "use_sim_time is refused"),
    (["--ros-args", "-p", "use_sim_time:=3"], {}, 2, "use_sim_time"),
    (
        ["--namespace", "robot1"],
        LOOP,
        2,
        "mux.sources.loop: its topic is /robot1/cmd_vel here, an output of this robot",
    ),
)
"""Words of the command, changes of robot.yaml, exit code (None: it runs), and what it reports."""


def test_a_limit_holds_from_the_start_and_wrong_arguments_end_it_with_their_reason(
    spawn: Callable[..., Process],
    make_robot: Callable[[Mapping[str, Any]], Path],
    test_node: TestNode,
    short_folder: Path,
) -> None:
    processes = []
    for number, (words, changes, _, _) in enumerate(STARTS):
        folder = short_folder / str(number)
        path = make_robot({**changes, "lease": {"socket": str(folder / "lease")}})
        argv = [sys.executable, "-m", "canbase_cli", "velocity", "--config", str(path), *words]
        processes.append(spawn(argv, env=clear_records(folder, "robot")))

    def codes() -> list[int | None]:
        return [process.exit_code for process in processes]

    def are_as_expected() -> bool:
        reported = all(text in process.log() for process, (*_, text) in zip(processes, STARTS, strict=True))
        return reported and codes() == [code for _, _, code, _ in STARTS]

    test_node.wait_for(are_as_expected, 30.0, "the lines and exit codes")
    assert not [process.log() for process in processes if "Traceback" in process.log()]


@pytest.mark.usefixtures("domain_id")
def test_a_change_and_what_is_decided_then_are_among_the_recorded_inputs(robot: Robot) -> None:
    """Otherwise a replay would be of a faster robot."""
    noted: list[tuple[Any, ...]] = []
    rclpy.init(args=[])
    try:
        node = FilterNode(robot, note=lambda *entry: noted.append(entry))
        noted.clear()
        node.set_parameters([Parameter(LINEAR, value=0.2), Parameter(LINEAR, value=0.2)])
    finally:
        rclpy.shutdown()
    assert [(entry[0], *entry[2:4]) for entry in noted if entry[0] != "decide"] == [("speed_limit", 0.2, 2.0)]
    assert [entry[0] for entry in noted] == ["speed_limit", "decide"], "what does not change decides nothing"


def test_nav2_lowers_the_speed_by_its_own_message(chain: Chain) -> None:
    kind = pytest.importorskip("nav2_msgs.msg", reason="nav2_msgs is not on PyPI").SpeedLimit
    publisher = chain.node.node.create_publisher(kind, "speed_limit", 10)
    chain.node.wait_for_subscriber(publisher)
    chain.joystick.message = drive(0.8)
    publisher.publish(kind(percentage=True, speed_limit=30.0))
    chain.wait_for_order(0.3)
    publisher.publish(kind(percentage=False, speed_limit=float("nan")))
    chain.node.spin_for(0.5)
    assert chain.ordered[0] == pytest.approx(0.3)
    publisher.publish(kind(percentage=False, speed_limit=0.0))
    chain.wait_for_order(0.8)
