"""A running robot and what is around it: a joystick, a laser scanner, an emergency stop button."""

from __future__ import annotations

import math
import time

from canbase.msg import MuxState, SafetyState, StopEvent
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool

from canbase_action_server.client import Drive
from support.ros_harness import Repeater
from support.running_robot import LATCHED, RunningRobot
from support.scanner import BEAMS, all_around, scanner

BLOCKED_M = 0.35
"""5 cm before the front of the footprint: inside the stop distance."""

CALM_S = 20.0


def scan(ahead_m: float = math.inf) -> LaserScan:
    """Beams all around, all free but for the one ahead, from base_link."""
    return all_around([ahead_m] + [math.inf] * (BEAMS - 1))


class World:
    """A robot, and around it a joystick, a laser scanner and an emergency stop button."""

    def __init__(self, robot: RunningRobot) -> None:
        self.robot = robot
        self.node = robot.node
        self.joystick: Repeater[TwistStamped] = self.node.repeat(TwistStamped, "cmd_vel_joy", 50.0)
        self.scan = scanner(self.node)
        self.estop: Repeater[Bool] = self.node.repeat(Bool, "estop_state", 20.0)
        for repeater in (self.joystick, self.scan, self.estop):
            self.node.wait_for_subscriber(repeater.publisher)
        self.mux = self.node.record(MuxState, "velocity_mux/state", LATCHED)

    def heal(self) -> None:
        """All as it should be, and the robot stands ready."""
        self.scan.message, self.estop.message = scan(), Bool(data=False)
        self.node.release(self.joystick)
        self.robot.wait_standing()
        self.robot.make_ready()
        deadline_s = time.monotonic() + CALM_S
        while (cause := self._cause()) != SafetyState.CAUSE_NONE:
            assert time.monotonic() < deadline_s, f"the safety filter goes on to stop: {cause}"
            if cause == SafetyState.CAUSE_ESTOP:
                self.robot.reset("safety_filter/reset")
        self.node.release(self.joystick)  # a zero from before the reset does not count

    def _cause(self) -> str:
        """The states of the safety filter from now on."""
        asked_s = time.monotonic()
        return self.node.wait_for(lambda: self.causes_since(asked_s), CALM_S, "safety_filter/state")[-1]

    def causes_since(self, since_s: float) -> list[str]:
        """The states of the safety filter since then (time.monotonic)."""
        return [state.cause for state in self.robot.safety.since(since_s)]

    def joystick_refused(self) -> int:
        """Messages of the joystick that the mux has refused since its start."""
        sources = self.mux.messages[-1].sources
        return next(int(source.refused) for source in sources if source.name == "joystick")

    def drive(self) -> Drive:
        """A goal that has the robot at 0.3 m/s."""
        goal = self.robot.goal(4.0, 0.3)
        self.robot.wait_speed(0.28)
        return goal

    def wait_event(self, since_s: float, by: str, cause: str) -> StopEvent:
        """The stop event of that origin and cause that came since then (time.monotonic)."""

        def found() -> StopEvent | None:
            events = self.robot.stop_events.since(since_s)
            return next((event for event in events if (event.stopped_by, event.cause) == (by, cause)), None)

        event = self.node.wait_for(found, 10.0, f"{by}: {cause}")
        assert event is not None
        return event
