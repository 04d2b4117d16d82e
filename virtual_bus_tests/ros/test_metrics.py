"""`canbase serve metrics` beside a running robot: its numbers are true, it writes nothing, and its clients stop
nothing."""

from __future__ import annotations

import json
import signal
import socket
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, closing, suppress
from typing import Any

import pytest
from geometry_msgs.msg import TwistStamped
from prometheus_client.openmetrics.parser import text_string_to_metric_families
from rclpy.node import NodeNameNonExistentError
from std_msgs.msg import Bool

from support import api_page
from support.browser import free_tcp_port
from support.running_robot import PATIENT, RunningRobot, own_domain, robot_on
from support.surroundings import World

pytestmark = [pytest.mark.ros, pytest.mark.timeout(180)]

PATIENCE_S = 30.0
STORM = 60
"""Requests."""


class Fleet:
    """canbase metrics of one robot, scraped by this process."""

    def __init__(self, robot: RunningRobot) -> None:
        self.robot = robot
        self.world = World(robot)
        self.port = free_tcp_port()
        self.process = robot.command("serve", "metrics", "--config", str(robot.config), "--port", str(self.port))

    def drive(self) -> None:
        """By the joystick, which is followed after a zero, until it goes 0.2 m/s."""
        self.world.joystick.message = TwistStamped()
        self.wait("canbase_source_followed joystick", 1.0)
        self.world.joystick.message.twist.linear.x = 0.2
        self.robot.wait_speed(0.19)

    def text(self) -> str:
        with urllib.request.urlopen(f"http://127.0.0.1:{self.port}/metrics", timeout=PATIENCE_S) as answer:
            return str(answer.read().decode())

    def values(self) -> dict[str, float]:
        """By the name of the sample, with its labels. Empty while the server is not there."""
        try:
            families = list(text_string_to_metric_families(self.text()))
        except urllib.error.URLError:
            return {}
        samples = [sample for family in families for sample in family.samples]
        return {" ".join([sample.name, *sample.labels.values()]): float(sample.value) for sample in samples}

    def state(self, page: str = "/vda5050/state") -> dict[str, Any]:
        """Of VDA 5050; empty while the server is not there."""
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{self.port}{page}", timeout=PATIENCE_S) as answer:
                return dict(json.loads(answer.read()))
        except urllib.error.URLError:
            return {}

    def errors(self) -> list[str]:
        return [error["errorType"] for error in self.state()["errors"]]

    def wait_estop(self, word: str) -> None:
        def is_so() -> bool:
            found = self.state()
            return bool(found) and found["safetyState"]["eStop"] == word

        self.robot.node.wait_for(is_so, PATIENCE_S, f"eStop {word}")

    def wait(self, name: str, least: float, most: float = float("inf")) -> None:
        found: dict[str, float] = {}

        def is_there() -> bool:
            found.clear()
            found.update(self.values())
            return name in found and least <= found[name] <= most

        try:
            self.robot.node.wait_for(is_there, PATIENCE_S, name)
        except AssertionError as error:
            raise AssertionError(
                f"{error}; it is {found.get(name)}, of {sorted(found)}; {self.process.log()}"
            ) from None


@pytest.fixture(scope="module")
def fleet() -> Iterator[Fleet]:
    with own_domain() as domain, robot_on(domain, changes=PATIENT) as robot:
        yield Fleet(robot)


def test_a_scrape_tells_what_the_robot_does(fleet: Fleet) -> None:
    fleet.wait("canbase_driver_state enabled", 1.0)
    fleet.drive()
    fleet.wait("canbase_source_followed joystick", 1.0)
    fleet.wait("canbase_ordered_linear_meters_per_second", 0.19, 0.21)
    fleet.wait("canbase_drive_velocity_radians_per_second left_wheel 1", 0.5)
    fleet.wait("canbase_data_age_seconds motor_driver/status", 0.0, 1.0)
    fleet.world.heal()
    fleet.robot.wait_standing()


def test_it_reads_what_the_documentation_lists_and_writes_nothing(fleet: Fleet) -> None:
    fleet.wait("canbase_driver_state enabled", 1.0)
    written = api_page.documented("canbase_metrics")
    assert {row.way for row in written} == {"in"}

    def is_whole() -> bool:
        with suppress(NodeNameNonExistentError):  # not discovered yet
            return api_page.present(fleet.robot.node.node, "canbase_metrics") == written
        return False

    fleet.robot.node.wait_for(is_whole, PATIENCE_S, "what the page lists, in the graph")


def test_a_storm_of_scrapes_slow_clients_and_huge_requests_while_it_drives(fleet: Fleet) -> None:
    """Nothing of the robot latches a stop, it drives afterwards, and each honest scrape is answered."""
    fleet.drive()
    stops = len(fleet.robot.stop_events.messages)
    answered: list[str] = []
    with ExitStack() as stack:
        for _ in range(40):  # more than it has room for
            slow = stack.enter_context(closing(socket.create_connection(("127.0.0.1", fleet.port), PATIENCE_S)))
            slow.sendall(b"GET /metrics HTTP/1.1\r\nX-Slow: ")
        huge = stack.enter_context(closing(socket.create_connection(("127.0.0.1", fleet.port), PATIENCE_S)))
        threading.Thread(target=_flood, args=(huge,), daemon=True).start()
        storm = threading.Thread(target=lambda: answered.extend(fleet.text() for _ in range(STORM)), daemon=True)
        storm.start()
        fleet.robot.node.wait_for(lambda: not storm.is_alive(), PATIENCE_S * 2, "the end of the storm")
    assert len(answered) == STORM
    fleet.robot.wait_speed(0.19)
    assert [event for event in fleet.robot.stop_events.messages[stops:] if event.latched] == []
    fleet.world.heal()
    fleet.robot.wait_standing()


def _flood(client: socket.socket) -> None:
    """A header without end, until it is cut off."""
    try:
        client.sendall(b"GET /metrics HTTP/1.1\r\nX-Huge: ")
        while True:
            client.sendall(b"x" * 65_536)
    except OSError:
        return


def test_the_state_for_vda_5050_follows_the_stop_button(fleet: Fleet) -> None:
    fleet.world.heal()
    fleet.wait_estop("NONE")
    fleet.world.estop.message = Bool(data=True)
    fleet.wait_estop("MANUAL")
    fleet.wait("canbase_estop", 1.0)
    assert "emergency_stop" in fleet.errors()
    fleet.world.estop.message = Bool(data=False)  # released, and no reset yet
    fleet.robot.node.spin_for(0.5)
    assert fleet.state()["safetyState"]["eStop"] == "MANUAL"
    assert fleet.state("/vda5050/v3/state")["safetyState"]["activeEmergencyStop"] == "MANUAL"
    fleet.world.heal()
    fleet.wait_estop("NONE")


def test_a_driver_that_dies_leaves_no_number_behind(fleet: Fleet) -> None:
    """Last: this ends the robot."""
    fleet.wait("canbase_driver_state enabled", 1.0)
    lines = fleet.robot.command("serve", "vda5050", "--config", str(fleet.robot.config))
    fleet.robot.node.wait_for(lambda: '"eStop":"NONE"' in lines.log(), PATIENCE_S, "a line of canbase vda5050")
    fleet.robot.send("driver", signal.SIGKILL)
    fleet.wait("canbase_data_age_seconds motor_driver/status", 1.5)
    left = [name for name in fleet.values() if name.startswith(("canbase_driver", "canbase_drive_", "canbase_bus"))]
    assert left == []
    fleet.wait("canbase_filter_action stop", 0.0)
    fleet.wait_estop("MANUAL")
    assert "state_unknown" in fleet.errors()

    def last() -> dict[str, Any]:
        return dict(json.loads(lines.log().splitlines()[-2]))  # the last one may be half written

    fleet.robot.node.wait_for(lambda: last()["safetyState"]["eStop"] == "MANUAL", PATIENCE_S, "its last line")
    silent = [error["errorDescription"] for error in last()["errors"] if error["errorType"] == "state_unknown"]
    assert any("motor_driver/status" in text for text in silent)
