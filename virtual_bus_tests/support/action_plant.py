"""A base in virtual time for the tests of the action server: ramp, dead time, lag, late and uneven odometry."""

from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from canbase_action_server.along_track import BasePose
from canbase_action_server.goal import GoalRun
from canbase_action_server.goal_request import DriveRequest, Request, RotateRequest
from canbase_action_server.inputs import Driver, Inputs, Mux, Odometry, Safety
from canbase_action_server.motion import STOP, BaseTwist
from canbase_action_server.outcome import GoalOutcome
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_runtime.driver_state import DriverState
from canbase_runtime.received import NEVER, Received
from canbase_runtime.stop_cause import StopCause
from canbase_runtime.watchdog_view import WatchdogView

T = TypeVar("T")
STEP_S = 0.001
COUNT_M = 2 * math.pi * 0.1 / (20 * 4096)
"""One encoder count at the rim of the bench robot's wheels."""


def bench_robot() -> Robot:
    """The robot of the bench sample."""
    return load_robot(sample("bench")).robot


@dataclass
class Plant:
    """A velocity-controlled base. Times in s, speeds at the ground."""

    acceleration_mps2: float = 0.8
    deceleration_mps2: float = 1.0
    angular_acceleration_radps2: float = 4.0
    angular_deceleration_radps2: float = 5.0
    dead_time_s: float = 0.02
    lag_s: float = 0.03
    slip: float = 0.0
    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.3
    speed_mps: float = 0.0
    turn_radps: float = 0.0
    stuck: bool = False
    _ramped_mps: float = 0.0
    _ramped_radps: float = 0.0
    _pipe: deque[tuple[float, BaseTwist]] = field(default_factory=lambda: deque([(-1.0, STOP)]))

    def order(self, twist: BaseTwist, now_s: float) -> None:
        """A velocity order enters the chain."""
        self._pipe.append((now_s + self.dead_time_s, twist))

    def step(self, now_s: float) -> None:
        """One step of STEP_S."""
        while len(self._pipe) > 1 and self._pipe[1][0] <= now_s:
            self._pipe.popleft()
        wanted = self._pipe[0][1]
        speeding_up = abs(wanted.linear_mps) > abs(self._ramped_mps)
        most = (self.acceleration_mps2 if speeding_up else self.deceleration_mps2) * STEP_S
        self._ramped_mps += max(-most, min(most, wanted.linear_mps - self._ramped_mps))
        share = 0.0 if self.stuck else STEP_S / (self.lag_s + STEP_S)
        self.speed_mps += (self._ramped_mps - self.speed_mps) * share
        speeding_up = abs(wanted.angular_radps) > abs(self._ramped_radps)
        most = (self.angular_acceleration_radps2 if speeding_up else self.angular_deceleration_radps2) * STEP_S
        self._ramped_radps += max(-most, min(most, wanted.angular_radps - self._ramped_radps))
        self.turn_radps += (self._ramped_radps + self.slip * self.speed_mps - self.turn_radps) * share
        if self.stuck:
            self.speed_mps = self.turn_radps = 0.0
        self.yaw_rad += self.turn_radps * STEP_S
        self.x_m += self.speed_mps * math.cos(self.yaw_rad) * STEP_S
        self.y_m += self.speed_mps * math.sin(self.yaw_rad) * STEP_S

    def odometry(self, received: float) -> Odometry:
        """The odometry, in whole encoder counts."""
        x, y = (COUNT_M * round(value / COUNT_M) for value in (self.x_m, self.y_m))
        yaw_rad = math.remainder(self.yaw_rad, 2.0 * math.pi)
        return Odometry(received, BasePose(x, y, yaw_rad), self.speed_mps, self.turn_radps)


GOOD_SAFETY = Safety(stops=False, cause=StopCause.NONE, detail="", estop=False)
GOOD_DRIVER = Driver(
    state=DriverState.ENABLED,
    cause="none",
    detail="",
    watchdog=WatchdogView.OK,
    watchdog_cause="none",
    standstill=True,
    hears_command=True,
)
GOOD_MUX = Mux(active="")


def good_inputs(odometry: Odometry) -> Inputs:
    """A healthy robot, everything received together with `odometry`."""
    return replaced(
        Inputs(), odometry.received, odometry=odometry, safety=GOOD_SAFETY, driver=GOOD_DRIVER, mux=GOOD_MUX
    )


@dataclass
class Story:
    """One goal on one plant. `at` holds what happens when: a function that changes the inputs, or the plant."""

    plant: Plant
    request: Request
    robot: Robot = field(default_factory=bench_robot)
    odometry_hz: float = 50.0
    jitter: random.Random = field(default_factory=lambda: random.Random(1))
    inputs: Inputs = field(default_factory=lambda: good_inputs(Plant().odometry(0.0)))
    silent: set[str] = field(default_factory=set)
    """Of safety, driver and mux: those whose state does not arrive."""
    at: dict[float, Callable[[Story], None]] = field(default_factory=dict)
    odometry_alive: bool = True
    fastest_mps: float = 0.0
    fastest_radps: float = 0.0
    now_s: float = 0.0
    ended_at: float = 0.0
    orders: list[tuple[float, BaseTwist]] = field(default_factory=list)

    def run(self, limit_s: float = 120.0) -> GoalOutcome:
        """From the acceptance to the outcome, then half a second more to see whether something still moves."""
        self.inputs = replaced(self.inputs, 0.0, odometry=self.plant.odometry(0.0))
        start = self.plant.odometry(0.0)
        goal = GoalRun(self.robot, self.request.motion(self.robot, start), start, 0.0)
        control_s, pending = 1.0 / self.robot.action.control_hz, sorted(self.at)
        next_control = next_odometry = 0.0
        transit: deque[tuple[float, Odometry]] = deque()
        for tick in range(round(limit_s / STEP_S)):
            now_s = tick * STEP_S
            self.now_s = now_s
            while pending and pending[0] <= now_s:
                self.at[pending.pop(0)](self)
            if now_s >= next_odometry and self.odometry_alive:
                next_odometry += 1.0 / self.odometry_hz
                arrives = now_s + self.jitter.uniform(0.0, 0.4) / self.odometry_hz
                transit.append((arrives, self.plant.odometry(arrives)))
            while transit and transit[0][0] <= now_s:
                self.inputs = replaced(self.inputs, now_s, odometry=transit.popleft()[1])
            if tick % 100 == 0:
                self.inputs = again(self.inputs, now_s, but=self.silent)
            if now_s >= next_control:
                next_control += control_s
                order = goal.tick(self.inputs, now_s)
                self.orders.append((now_s, order.twist))
                self.plant.order(order.twist, now_s)
                if order.end:
                    self.ended_at = now_s
                    return order.end
            self.plant.step(now_s)
            self.fastest_mps = max(self.fastest_mps, abs(self.plant.speed_mps))
            self.fastest_radps = max(self.fastest_radps, abs(self.plant.turn_radps))
        raise AssertionError(f"no end after {limit_s} s of virtual time")

    def coast(self) -> float:
        """How far the base still moves in the second after the end [m]."""
        before = (self.plant.x_m, self.plant.y_m)
        for tick in range(1000):
            self.plant.step(self.ended_at + tick * STEP_S)
        return math.dist(before, (self.plant.x_m, self.plant.y_m))


def drive(plant: Plant, distance_m: float, speed_mps: float, **others: Any) -> Story:
    """A straight one."""
    return Story(plant, DriveRequest(distance_m, speed_mps), **others)


def rotate(plant: Plant, angle_rad: float, speed_radps: float, **others: Any) -> Story:
    """A turn in place."""
    return Story(plant, RotateRequest(angle_rad, speed_radps), **others)


def goal_run(robot: Robot, distance_m: float, speed_mps: float, start: Odometry) -> GoalRun:
    """A straight one that begins at 0.0 s."""
    return GoalRun(robot, DriveRequest(distance_m, speed_mps).motion(robot, start), start, 0.0)


STATES = ("safety", "driver", "mux")


def replaced(inputs: Inputs, now_s: float, **changes: object) -> Inputs:
    """`inputs` with other values, each received at `now_s` [s]; None: it was never received."""
    received = {
        name: value if isinstance(value, bool | Received) else NEVER if value is None else Received(value, now_s)
        for name, value in changes.items()
    }
    return replace(inputs, **received)  # type: ignore[arg-type]


def again(inputs: Inputs, now_s: float, but: Collection[str] = ()) -> Inputs:
    """Each state was published once more with the same values, except those of `but`."""
    return replace(
        inputs, **{name: replace(getattr(inputs, name), received_at_s=now_s) for name in STATES if name not in but}
    )


def value(received: Received[T]) -> T:
    """The value, whatever its age."""
    found = received.within(math.inf, 0.0)
    assert found is not None
    return found
