"""`canbase doctor` as a command sees a system that really runs: goals, log, graph, processes and answers.

What it makes of that: unit/doctor/test_symptoms.py.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal
from ruamel.yaml import YAML

from support.fake_base import FakeBase, server_code
from support.ros_harness import Process, TestNode, merged, python_argv, robot_values
from support.running_robot import LATCHED, own_domain

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

CANBASE = (sys.executable, "-m", "canbase_cli")
DOCTOR = (
    "from canbase_doctor import observe\nobserve.load_per_core = lambda: 0.0\n"
    "from canbase_cli.main import app\napp(prog_name='canbase')\n"
)
"""`canbase` on a computer with nothing else to do, whatever this one has: a doctor on a busy one judges no times."""
LEAVES = (
    "import rclpy\nfrom canbase_action_server.client import DriveClient\n"
    "rclpy.init()\nnode = rclpy.create_node('leaves')\n"
    "DriveClient(node).send(4.0, 0.1)\nnode.destroy_node()\nrclpy.shutdown()\n"
)
"""A client that sends a goal and goes."""


class Clinic:
    """A server before a base, and doctors to look at them."""

    def __init__(self, node: TestNode, folder: Path, domain: int) -> None:
        self.node, self.folder = node, folder
        self.env = {"ROS_DOMAIN_ID": str(domain)}
        self.config = folder / "robot.yaml"
        YAML(typ="safe").dump(merged(robot_values(folder), {"timeouts": {"odometry_s": 1.0}}), self.config)
        self.processes: list[Process] = []
        self.base = FakeBase(node)
        self.status = node.record(GoalStatusArray, "drive_distance/_action/status", LATCHED)
        self.server = self.spawn(python_argv(server_code(self.config)))
        node.wait_for(lambda: self.base.heard, 20.0, "the server to listen")
        node.spin_for(0.5)

    def spawn(self, argv: list[str]) -> Process:
        log = self.folder / f"process{len(self.processes)}.log"
        self.processes.append(Process(argv, log, self.env))
        return self.processes[-1]

    def end(self, process: Process) -> int:
        """Exit code of a process that ends by itself."""
        self.node.wait_for(lambda: process.exit_code is not None, 30.0, f"its end:\n{process.log()}")
        return process.wait(1.0)

    def doctor(self, *words: str) -> list[dict[str, Any]]:
        """The rows; the exit code is 0 only if none of them failed."""
        process = self.spawn(
            [*python_argv(DOCTOR), "doctor", "--no-bus", "-c", str(self.config), "--json", "--seconds", "1", *words]
        )
        code = self.end(process)
        rows: list[dict[str, Any]] = json.loads(process.log())
        assert code == max(int(row["verdict"] == "fail") for row in rows), process.log()
        return rows

    def first_failure(self, symptom: str, *words: str) -> str:
        """Name of the check that fails."""
        return next(str(row["name"]) for row in self.doctor("--symptom", symptom, *words) if row["verdict"] == "fail")

    def statuses(self) -> list[int]:
        """Of all goals."""
        return [goal.status for goal in self.status.last.status_list] if self.status.last else []

    def cancel_all(self) -> None:
        """No goal runs any more."""
        client = self.node.node.create_client(CancelGoal, "drive_distance/_action/cancel_goal")
        self.node.wait_for(client.service_is_ready, 10.0, "the cancel service")
        client.call_async(CancelGoal.Request())
        self.node.wait_for(lambda: min(self.statuses(), default=4) >= 4, 10.0, "the end of all goals")
        self.node.node.destroy_client(client)


@pytest.fixture(scope="module")
def clinic(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Clinic]:
    folder = tmp_path_factory.mktemp("clinic")
    with own_domain() as domain, TestNode(domain_id=domain) as node:
        made = Clinic(node, folder, domain)
        yield made
        for process in made.processes:
            process.close()
            print(f"--- {process.log_path.name} ---\n{process.log()}")


@pytest.fixture
def healthy(clinic: Clinic) -> Iterator[Clinic]:
    """The clinic, and after the test no goal runs and nothing is wrong with it any more."""
    yield clinic
    clinic.base.heal()
    clinic.cancel_all()


def test_nothing_fails_on_a_robot_that_is_well_and_doctor_leaves_its_goal_alone(healthy: Clinic) -> None:
    goal = healthy.spawn([*CANBASE, "drive", "4", "--speed", "0.1"])
    healthy.node.wait_for(lambda: healthy.base.speed_mps > 0.08, 10.0, "the base to move")
    assert [row for row in healthy.doctor() if row["verdict"] != "ok"] == []
    assert [row["verdict"] for row in healthy.doctor("--symptom", "no-feedback")] == ["ok"] * 3
    assert goal.exit_code is None
    assert healthy.base.speed_mps == pytest.approx(0.1, abs=0.02)


def test_not_listed_a_doctor_in_another_domain_is_told_so(healthy: Clinic) -> None:
    with own_domain() as elsewhere:
        env = {"ROS_DOMAIN_ID": str(elsewhere)}
        process = Process(
            [*CANBASE, "doctor", "--symptom", "not-listed", "--seconds", "1"], healthy.folder / "elsewhere.log", env
        )
        healthy.processes.append(process)
        assert healthy.end(process) == 1
    assert "The first check that fails: domain and network" in process.log()


def test_rejected_the_range_of_the_goal(healthy: Clinic) -> None:
    assert healthy.end(healthy.spawn([*CANBASE, "drive", "100"])) == 5
    assert healthy.first_failure("rejected") == "range of the goal"


def test_no_feedback_the_client_has_gone(healthy: Clinic) -> None:
    assert healthy.end(healthy.spawn(python_argv(LEAVES))) == 0
    assert healthy.first_failure("no-feedback") == "a client listens"


def test_no_result_the_server_hangs(healthy: Clinic) -> None:
    healthy.server.stop()
    try:
        assert healthy.first_failure("no-result") == "the server answers"
        assert "whether a goal runs is unknown" in healthy.doctor("--symptom", "no-feedback")[-1]["found"]
    finally:
        healthy.server.resume()


def test_goals_collide_two_servers_for_one_base(healthy: Clinic) -> None:
    second = healthy.spawn(python_argv(server_code(healthy.config)))
    healthy.node.wait_for(lambda: healthy.node.node.count_publishers("cmd_vel_action") == 2, 20.0, "a second server")
    # The doctor waits until it has found one server; DDS may tell of another one seconds later.
    assert healthy.first_failure("goals-collide", "--seconds", "3") == "one server"
    second.terminate()
    assert second.wait(5.0) == 0
