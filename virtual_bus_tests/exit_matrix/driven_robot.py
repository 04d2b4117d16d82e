"""A robot that can be broken: driven by a goal, a joystick or `canbase drive`, and everything that a row does to it."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any, Final

import can
from geometry_msgs.msg import TwistStamped

from canbase_campaign.twins import SPEED_MPS
from canbase_config.robot import Robot
from canbase_config.units import mps_per_bit
from exit_matrix.saboteur import sitecustomize as saboteur
from support.ros_harness import Process, Repeater
from support.running_robot import READY_S, RunningRobot
from support.surroundings import World

WAY_M: Final = 4.5
"""Of a goal: it takes longer than any row needs."""
CRUISING_MPS: Final = 0.97 * SPEED_MPS
STEADY_S: Final = 0.2
"""The base drives this long at its speed before anything happens [s]."""
CLIENT: Final = "client"
CHANGES: Final[Mapping[str, Any]] = {
    "safety": {"scan": {"required": True}, "estop": {"required": True}},
    "action": {"require_client_lease": True},
}
"""To the sample robot of the bench. All timeouts are at their defaults."""


class By(Enum):
    """The source that orders the motion."""

    GOAL = "a goal of this process"
    JOYSTICK = "the joystick"
    CLIENT = "a goal of `canbase drive`"


def sabotaged(folder: Path) -> dict[str, str]:
    """Environment of processes that obey `Scene.sabotage`."""
    here = Path(__file__).parent / "saboteur"
    return {"PYTHONPATH": str(here), saboteur.FILE: str(folder / "sabotage")}


class Scene(World):
    """What the rows see of the robot."""

    def __init__(self, robot: RunningRobot) -> None:
        super().__init__(robot)
        self.straight: Repeater[TwistStamped] = self.node.repeat(TwistStamped, "cmd_vel", 200.0)
        self.node.wait_for_subscriber(self.straight.publisher)
        self.client: Process | None = None
        self._second: SecondMaster | None = None

    def start_driving(self, by: By) -> None:
        """Until the base goes at SPEED_MPS. AssertionError: it does not."""
        if by is By.GOAL:
            self.robot.goal(WAY_M, SPEED_MPS)
        elif by is By.JOYSTICK:
            self.node.release(self.joystick)  # the mux follows no source that has not shown zero
            self.push(SPEED_MPS)
        else:
            self._start_client()
        self.robot.wait_speed(CRUISING_MPS)
        self.node.spin_for(STEADY_S)
        speed_mps = self.robot.truth().linear_mps
        assert speed_mps >= CRUISING_MPS, f"it goes at {speed_mps:.3f} m/s before anything was done to it"

    def _start_client(self) -> None:
        """One that drives: on a loaded computer it may take long to start, or be too late for its own goal."""
        deadline_s = time.monotonic() + READY_S
        while self.robot.truth().linear_mps < CRUISING_MPS:
            assert time.monotonic() < deadline_s, f"no client drives\n{self.robot.logs()}"
            if self.client is None or self.client.exit_code is not None:
                self.heal()  # where the computer starved scanner or stop button of this process, that is latched
                self.client = self.robot.command("drive", str(WAY_M), "--speed", str(SPEED_MPS))
            self.node.spin_for(0.05)

    def push(self, speed_mps: float) -> float:
        """The joystick orders that speed from now on (time.monotonic)."""
        self.joystick.message = forward(speed_mps)
        return time.monotonic()

    def push_straight(self, speed_mps: float) -> float:
        """Somebody orders that speed on cmd_vel from now on, past mux and filter (time.monotonic)."""
        self.straight.message = forward(speed_mps)
        return time.monotonic()

    def send_signal(self, part: str, number: signal.Signals) -> float:
        """A signal to a part or to the client; when it was sent (time.monotonic)."""
        os.kill(self._pid(part), number)
        return time.monotonic()

    def sabotage(self, part: str, order: str) -> float:
        """An order of the saboteur, to a part or to the client; when it was sent (time.monotonic)."""
        Path(self.robot.env[saboteur.FILE]).write_text(order)
        return self.send_signal(part, signal.SIGUSR1)

    def fault(self, kind: str, *nodes: int, **arguments: Any) -> float:
        """A fault of these simulated nodes, of all without any; when it began (time.monotonic)."""
        for node in nodes or self.nodes:
            self.robot.sim.fault(node, kind, **arguments)
        return time.monotonic()

    @property
    def nodes(self) -> tuple[int, ...]:
        """Node ids of the drives."""
        return tuple(dict.fromkeys(drive.node_id for drive in self.robot.robot.drives))

    def begin_second_master(self) -> float:
        """Another master begins to send setpoints (time.monotonic)."""
        self._second = SecondMaster(self.robot.robot)
        return time.monotonic()

    def end_second_master(self) -> None:
        """It is gone."""
        if self._second is not None:
            self._second.close()
            self._second = None

    def recover(self, restarted: bool) -> None:
        """All as it should be. `restarted`: a new process, which the others have to find. AssertionError: in vain."""
        self.close()
        self.straight.message = None
        self.heal()
        if restarted:
            self.robot.wait_whole()

    def close(self) -> None:
        """Ends what is no part of the robot."""
        self.end_second_master()
        if self.client is not None:
            self.client.close()
            self.client = None

    def _pid(self, part: str) -> int:
        if part != CLIENT:
            return self.robot.stack.pids[part]
        assert self.client is not None, "no client was started"
        return self.client.pid


def forward(speed_mps: float) -> TwistStamped:
    """A command straight on."""
    message = TwistStamped()
    message.twist.linear.x = speed_mps
    return message


class SecondMaster:
    """Sends setpoints of its own to every drive 100 times a second, slower than the driver's: any speed is allowed."""

    def __init__(self, robot: Robot) -> None:
        self._bus = can.Bus(**robot.bus.arguments())
        self._frames = [
            _setpoint(drive.node_id, mps_per_bit(drive, robot.base.wheel_radius_m)) for drive in robot.drives
        ]
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def close(self) -> None:
        """It is gone."""
        self._ended.set()
        self._thread.join()
        self._bus.shutdown()

    def _run(self) -> None:
        while not self._ended.wait(0.01):
            for frame in self._frames:
                self._bus.send(frame)


def _setpoint(node_id: int, mps_per_bit: float) -> can.Message:
    target = round(SPEED_MPS / 2.0 / mps_per_bit)
    data = (0x000F).to_bytes(2, "little") + target.to_bytes(4, "little", signed=True)
    return can.Message(arbitration_id=0x200 + node_id, data=data, is_extended_id=False)
