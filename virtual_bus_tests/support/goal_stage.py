"""The action server as a process before a `FakeBase`, in a ROS domain of its own: the stage of every test of goals."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from canbase_action_server.client import Drive, DriveClient, DriveResult, RejectedError
from support.fake_base import FakeBase, server_code
from support.ros_harness import Process, TestNode, clear_records, merged, python_argv, robot_values
from support.running_robot import CANBASE, own_domain

NOTHING: Mapping[str, Any] = {}
PATIENT: Mapping[str, Any] = {"timeouts": {"odometry_s": 0.5}}
"""A loaded computer may hold the base up for longer than the 0.2 s of a robot."""
PATIENT_S = 40.0
"""On a loaded computer a command takes seconds to start."""
FAREWELL_S = 0.3
"""Longer than the server orders zero after a goal, and than two control cycles."""


class GoalStage:
    """Processes in one domain; after `serve` the server, its base and a client."""

    def __init__(self, folder: Path, node: TestNode, domain: int) -> None:
        self.folder, self.node, self.domain = folder, node, domain
        self.env = {**clear_records(folder, "robot"), "ROS_DOMAIN_ID": str(domain)}
        self.processes: list[Process] = []
        self.base: FakeBase
        self.server: Process
        self.client: DriveClient

    def serve(
        self, changes: Mapping[str, Any], sabotage: str, env: Mapping[str, str], arguments: Sequence[str]
    ) -> None:
        """Starts the server, and waits until it hears the base."""
        self.base = FakeBase(self.node)
        path = self.folder / "robot.yaml"
        YAML(typ="safe").dump(merged(merged(robot_values(self.folder), PATIENT), changes), path)
        self.server = self.spawn([*python_argv(sabotage + server_code(path)), *arguments], env)
        self.client = DriveClient(self.node.node, self.node.executor)
        self.node.wait_for(lambda: self.base.heard, PATIENT_S, "the server to listen")
        self.node.spin_for(0.5)

    def spawn(self, command: str | Sequence[str], env: Mapping[str, str] = NOTHING) -> Process:
        """A process that ends with the stage at the latest."""
        argv = python_argv(command) if isinstance(command, str) else command
        log = self.folder / f"process{len(self.processes)}.log"
        self.processes.append(Process(argv, log, {**self.env, **env}))
        return self.processes[-1]

    def canbase(self, *words: str) -> Process:
        """`canbase words…`, started."""
        return self.spawn([*CANBASE, *words])

    def steps(self) -> list[dict[str, Any]]:
        """The structured lines of the server's log."""
        lines = (line for line in self.server.log().splitlines() if '{"uuid"' in line)
        return [json.loads(line[line.index("{") :]) for line in lines]

    def last_reason(self) -> str:
        """Why the server rejected the last goal, by its log."""
        return str([step for step in self.steps() if step["step"] == "rejected"][-1]["reason"])

    def rejection(self, distance_m: float, speed_mps: float) -> str:
        """The reason for the rejection of this goal: in the log, and with the client."""
        before = len(self.steps())
        with pytest.raises(RejectedError) as told:
            self.client.send(distance_m, speed_mps)
        self.node.wait_for(lambda: len(self.steps()) > before, 2.0, "the log line")
        assert told.value.reason == self.last_reason()
        return self.last_reason()

    def wait_until_moving(self, least_mps: float = 0.1) -> None:
        """The base is on its way."""
        self.node.wait_for(lambda: abs(self.base.speed_mps) > least_mps, 20.0, f"{least_mps} m/s: {self.server.log()}")

    def drive_until_moving(self, distance_m: float = 2.0, speed_mps: float = 0.3) -> Drive:
        """A goal whose base is on its way."""
        drive = self.client.send(distance_m, speed_mps)
        self.wait_until_moving(0.15)
        return drive

    def end_of(self, drive: Drive, timeout_s: float = 10.0) -> DriveResult:
        """Its result; the base stands by then, and neither moves nor gets an order to move afterwards."""
        result = drive.wait(timeout_s)
        assert result is not None
        stood_at_m, ended_s = self.base.x_m, time.monotonic()
        assert abs(self.base.speed_mps) < 0.02
        self.node.spin_for(FAREWELL_S)
        assert self.base.x_m == pytest.approx(stood_at_m, abs=0.0005)
        assert [mps for mps in self.base.orders_since(ended_s) if mps != 0.0] == []
        return result

    def recovered(self) -> GoalStage:
        """The same for the next test: the server runs, no goal orders anything, the base is well and at its origin."""
        self.base.heal()
        assert self.server.exit_code is None, self.server.log()
        self.node.wait_for(lambda: not self.base.fresh and self.base.speed_mps == 0.0, PATIENT_S, "the base to be free")
        with self.base.lock:
            self.base.x_m = self.base.y_m = self.base.yaw_rad = 0.0
        self.node.spin_for(0.2)  # the server hears that it is well
        return self


@contextmanager
def bare_stage() -> Iterator[GoalStage]:
    """Without server and base."""
    with (
        tempfile.TemporaryDirectory(prefix="canbase-", dir="/tmp") as name,
        own_domain() as domain,
        TestNode(domain_id=domain) as node,
    ):
        stage = GoalStage(Path(name), node, domain)
        try:
            yield stage
        finally:
            for process in stage.processes:
                process.close()
                print(f"--- {process.log_path.name}, exit code {process.exit_code} ---\n{process.log()}")


@contextmanager
def goal_stage(
    changes: Mapping[str, Any] = NOTHING,
    sabotage: str = "",
    env: Mapping[str, str] = NOTHING,
    arguments: Sequence[str] = (),
) -> Iterator[GoalStage]:
    """`changes` of robot.yaml; `sabotage`: Python code before the server's; `arguments`: --ros-args of it."""
    with bare_stage() as stage:
        stage.serve(changes, sabotage, env, arguments)
        yield stage
