"""A whole robot as real processes on a bench of its own, seen from outside: over ROS, by commands, by ground truth."""

from __future__ import annotations

import itertools
import math
import os
import signal
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from canbase.msg import DriverStatus, SafetyState, StopEvent
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile
from ruamel.yaml import YAML
from std_srvs.srv import Trigger

from canbase_action_server.client import Drive, DriveClient, RejectedError
from canbase_action_server.outcome import Status
from canbase_cli.stack import Stack
from canbase_config.load import load_robot, sample
from canbase_sim.control import SimControl, control_path
from canbase_sim.world.bench import Truth
from support.ros_harness import Process, TestNode, merged, reserve_domain
from support.udp_port import free_udp_port

CANBASE = (sys.executable, "-m", "canbase_cli")
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
READY_S = 40.0
COMMAND_S = 40.0
RESTS_M = 0.0005
"""A base that goes less far than this stands: quantisation and settling of the simulated floor."""

PATIENT: Mapping[str, Any] = {
    "timeouts": {
        "command_s": 0.5,
        "lease_s": 0.5,
        "drive_heartbeat_s": 1.0,
        "feedback_s": 0.5,
        "watchdog_s": 0.5,
        "odometry_s": 1.0,
    },
    "safety": {"command_timeout_s": 0.5},
    "watchdog": {"loop_late_s": 0.5},
}
"""For tests that are not about timeouts: a loaded machine must not trip them."""


@dataclass(frozen=True, slots=True)
class Standstill:
    """How the base came to stand after some moment, by ground truth."""

    after_s: float
    """From that moment to the last time that a rim moved [s]."""
    way_m: float
    """Distance from where the base was at that moment to where it stands [m]."""


class RunningRobot:
    """The bench robot with all of its processes. `robot_on` makes and ends it."""

    def __init__(
        self, folder: Path, domain: int, namespace: str, changes: Mapping[str, Any], env: Mapping[str, str]
    ) -> None:
        self.folder, self.namespace = folder, namespace
        self.env = {"XDG_STATE_HOME": str(folder / "state"), **env, "ROS_DOMAIN_ID": str(domain)}
        self.config = robot_file(folder, changes)
        self.robot = load_robot(self.config).robot
        # Nobody sends stop frames after the end of a process: what stops the base is what the tests are about.
        self.stack = Stack(
            self.config, namespace=namespace, sim=True, logs=folder, env=os.environ | self.env, stop_files=folder
        )
        self.node = TestNode(namespace=namespace, domain_id=domain)
        self.status = self.node.record(DriverStatus, "motor_driver/status")
        self.odom = self.node.record(Odometry, "odom")
        self.safety = self.node.record(SafetyState, "safety_filter/state", LATCHED)
        self.stop_events = self.node.record(StopEvent, "stop_events", LATCHED)
        self.client = DriveClient(self.node.node, self.node.executor)
        self._commands: list[Process] = []
        self._sim: SimControl | None = None

    @property
    def sim(self) -> SimControl:
        """The control socket of the simulator, which runs."""
        if self._sim is None:
            self._sim = SimControl(control_path(self.robot), timeout_s=10.0)
        return self._sim

    def truth(self) -> Truth:
        """What the robot really does."""
        return self.sim.truth()

    def wait_state(self, state: int, timeout_s: float = READY_S) -> DriverStatus:
        """Until motor_driver/status, received from now on, has that state."""
        asked_s = time.monotonic()

        def found() -> DriverStatus | None:
            return next((status for status in self.status.since(asked_s) if status.state == state), None)

        try:
            status = self.node.wait_for(found, timeout_s, f"state {state} of the driver")
        except AssertionError as error:
            raise AssertionError(f"{error}; last heard {self.status.last}\n{self.logs()}") from None
        assert status is not None
        return status

    def wait_any_state(self) -> DriverStatus:
        """The next motor_driver/status from now on."""
        asked_s = time.monotonic()
        return self.node.wait_for(lambda: self.status.since(asked_s), READY_S, "motor_driver/status")[-1]

    def wait_enabled(self) -> None:
        """Until the drives have power and odometry comes."""
        self.wait_state(DriverStatus.ENABLED)
        self.node.wait_for(lambda: self.odom.last is not None, READY_S, "odom")

    def goal(self, distance_m: float, speed_mps: float) -> Drive:
        """A goal that was accepted: a server that has not discovered all other nodes yet rejects it."""
        deadline_s = time.monotonic() + READY_S
        while True:
            try:
                return self.client.send(distance_m, speed_mps, discovery_timeout_s=READY_S)
            except RejectedError:
                assert time.monotonic() < deadline_s, f"no goal is accepted\n{self.logs()}"
                self.node.spin_for(0.2)

    def driven(self, distance_m: float, speed_mps: float = 0.3) -> bool:
        """It succeeds in driving that far."""
        result = self.goal(distance_m, speed_mps).wait(READY_S)
        return result is not None and result.status is Status.SUCCEEDED

    def wait_whole(self) -> None:
        """Until every node has found every other: it drives 2 cm."""
        self.wait_enabled()
        deadline_s = time.monotonic() + READY_S
        while not self.driven(0.02):
            assert time.monotonic() < deadline_s, f"it does not drive\n{self.logs()}"
            self.make_ready()

    def wait_speed(self, least_mps: float, timeout_s: float = 20.0) -> None:
        """Until the base really goes that fast, forward or backward."""
        self.node.wait_for(lambda: abs(self.truth().linear_mps) >= least_mps, timeout_s, f"{least_mps} m/s")

    def wait_standing(self, for_s: float = 0.3, timeout_s: float = 20.0) -> None:
        """Until the base has really been standing for that long."""
        self.node.wait_for(lambda: self.truth().standing_s >= for_s, timeout_s, "standstill")

    def moved_since(self, since_s: float, for_s: float) -> float:
        """How far the base goes [m] from since_s (time.monotonic) until for_s later, for which this waits."""
        self.node.spin_for(max(0.0, since_s + for_s - time.monotonic()))
        rows = self.sim.trace(since_s)
        return max(math.dist(rows[0][1:3], row[1:3]) for row in rows)

    def standstill_after(self, moment_s: float) -> Standstill:
        """How the base, which stands now, came to stand after moment_s (time.monotonic)."""
        rows = self.sim.trace(moment_s)
        limit_mps = self.robot.base.standstill_mps
        moving = [row[0] for row in rows if max(abs(row[4]), abs(row[5])) > limit_mps]
        return Standstill(max(moving, default=moment_s) - moment_s, math.dist(rows[0][1:3], rows[-1][1:3]))

    def odometry(self) -> tuple[float, float]:
        """A fresh position by the encoders [m]."""
        asked_s = time.monotonic()
        fresh = self.node.wait_for(lambda: self.odom.since(asked_s), 10.0, "odom")
        return fresh[-1].pose.pose.position.x, fresh[-1].pose.pose.position.y

    def command(self, *words: str) -> Process:
        """`canbase words…` for this robot, started."""
        own = ("--namespace", self.namespace) if self.namespace and "--namespace" not in words else ()
        log = self.folder / f"command{len(self._commands)}.log"
        self._commands.append(Process([*CANBASE, *words, *own], log, self.env))
        return self._commands[-1]

    def exit_code(self, process: Process, timeout_s: float = COMMAND_S) -> int:
        """Of a command that ends by itself."""
        self.node.wait_for(lambda: process.exit_code is not None, timeout_s, f"its end:\n{process.log()}")
        return process.wait(1.0)

    def run(self, *words: str) -> int:
        """Exit code of `canbase words…`, run to its end."""
        return self.exit_code(self.command(*words))

    def send(self, part: str, number: signal.Signals) -> float:
        """A signal to a part; when it was sent (time.monotonic)."""
        os.kill(self.stack.pids[part], number)
        return time.monotonic()

    def make_ready(self) -> None:
        """Until the drives have power, with a reset where one is needed."""
        deadline_s = time.monotonic() + READY_S
        while (status := self.wait_any_state()).state != DriverStatus.ENABLED:
            assert time.monotonic() < deadline_s, f"not ready: {status}\n{self.logs()}"
            if status.state == DriverStatus.LATCHED:
                self.reset()
        self.wait_enabled()

    def reset(self, service: str = "motor_driver/reset") -> None:
        """Calls once; the state shows whether it was done."""
        client = self.node.node.create_client(Trigger, service)
        self.node.wait_for(client.service_is_ready, READY_S, service)
        answer = client.call_async(Trigger.Request())
        self.node.wait_for(answer.done, READY_S, "the answer to a reset")
        self.node.node.destroy_client(client)

    def logs(self) -> str:
        """The end of what every process has written."""
        files = sorted(self.folder.glob("*.log"))
        return "\n".join(f"--- {file.name} ---\n{file.read_text(errors='replace')[-3000:]}" for file in files)

    def close(self) -> dict[str, int]:
        """Ends everything; the exit codes of the parts."""
        if self._sim is not None:
            self._sim.close()
        for process in self._commands:
            process.close()
        codes = self.stack.stop()
        self.node.close()
        return codes


def robot_file(folder: Path, changes: Mapping[str, Any]) -> Path:
    """The bench sample with a bus and a lease socket of its own, and with `changes`."""
    yaml = YAML(typ="safe")
    own = {"bus": {"extra": {"port": free_udp_port()}}, "lease": {"socket": str(folder / "lease.sock")}}
    path = folder / "robot.yaml"
    yaml.dump(merged(merged(yaml.load(sample("bench")), own), changes), path)
    return path


_starts = itertools.count(7 * os.getpid())
NO_MORE: Mapping[str, str] = {}


@contextmanager
def own_domain() -> Iterator[int]:
    """A ROS domain that no other test holds."""
    domain, holder = reserve_domain(next(_starts))
    with holder:
        yield domain


@contextmanager
def robot_on(
    domain: int,
    *,
    namespace: str = "",
    changes: Mapping[str, Any] = PATIENT,
    start: bool = True,
    env: Mapping[str, str] = NO_MORE,
) -> Iterator[RunningRobot]:
    """A robot in that ROS domain that has driven. `start` False: nothing runs yet. `env`: more for its processes."""
    with tempfile.TemporaryDirectory(prefix="canbase-", dir="/tmp") as folder, ExitStack() as after:
        robot = RunningRobot(Path(folder), domain, namespace, changes, env)
        after.callback(_end, robot)
        if start:
            robot.stack.start()
            robot.wait_whole()
        yield robot


def _end(robot: RunningRobot) -> None:
    robot.close()
    print(robot.logs())  # shown by pytest when a test fails
