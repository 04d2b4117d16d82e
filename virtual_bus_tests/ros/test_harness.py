"""The helpers of the tests over DDS can themselves fail and say so."""

from __future__ import annotations

import signal
import socket
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from std_msgs.msg import Bool

from canbase_config.robot import Robot
from support.ros_harness import Process, TestNode, merged, reserve_domain

pytestmark = pytest.mark.ros


def test_a_process_that_runs_on_is_an_error_of_wait_and_can_be_killed(spawn: Callable[..., Process]) -> None:
    process = spawn("import time; time.sleep(60)")
    with pytest.raises(AssertionError, match=r"still running after 0\.05 s"):
        process.wait(0.05)
    process.kill()
    assert process.wait(5.0) == -signal.SIGKILL


def test_log_and_exit_code_of_a_process_that_ends(spawn: Callable[..., Process]) -> None:
    process = spawn("import sys; print('to stdout'); print('to stderr', file=sys.stderr); sys.exit(3)")
    assert process.wait(20.0) == 3
    assert "to stdout" in process.log()
    assert "to stderr" in process.log()


def test_a_process_that_hangs_leaves_the_stacks_of_its_threads_in_its_log(spawn: Callable[..., Process]) -> None:
    process = spawn("import time\ndef hang(): print('up', flush=True); time.sleep(60)\nhang()")
    while "up" not in process.log():
        time.sleep(0.01)
    process.close()
    assert process.exit_code == -signal.SIGABRT
    assert "in hang" in process.log()


def test_no_process_uses_shared_memory_in_dds_as_none_of_canbase_does(spawn: Callable[..., Process]) -> None:
    process = spawn("import rclpy; rclpy.init(); node = rclpy.create_node('a'); print(open('/proc/self/maps').read())")
    assert process.wait(30.0) == 0
    assert "librmw_fastrtps" in process.log()
    assert "/dev/shm/fastrtps" not in process.log()


def test_messages_are_repeated_recorded_and_waited_for(test_node: TestNode) -> None:
    heard = test_node.record(Bool, "pressed")
    pressed = test_node.repeat(Bool, "pressed", rate_hz=100.0)
    test_node.wait_for_subscriber(pressed.publisher)
    pressed.message = Bool(data=True)
    test_node.wait_for(lambda: len(heard.messages) >= 3, 5.0)
    pressed.message = None
    test_node.spin_for(0.1)
    heard.clear()
    test_node.spin_for(0.1)
    assert heard.last is None


def test_a_wait_in_vain_says_for_what(test_node: TestNode) -> None:
    with pytest.raises(AssertionError, match="in vain for rain"):
        test_node.wait_for(lambda: False, 0.1, "rain")


def test_a_held_domain_is_not_given_twice() -> None:
    first, holder = reserve_domain(40)
    second, other = reserve_domain(first - 1)
    other.close()
    holder.close()
    assert second != first


def test_each_robot_has_a_bus_and_a_lease_socket_of_its_own(robot: Robot, short_folder: Path) -> None:
    assert Path(robot.lease.socket).parent == short_folder
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", robot.bus.extra["port"]))


def test_changes_are_laid_over_mapping_by_mapping() -> None:
    assert merged({"a": {"b": 1, "c": 2}, "d": [1]}, {"a": {"c": 3}, "d": []}) == {"a": {"b": 1, "c": 3}, "d": []}
