"""The topics that a goal depends on: how old the last message may be, and what it means when there is none. A table.

Rule. What is missing counts as the worst that it could report: the goal ends, the base stops, and nothing starts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from canbase_action_server.inputs import Driver, Inputs, Mux, Odometry, Safety
from canbase_action_server.outcome import ErrorCode
from canbase_config.robot import Robot
from canbase_config.state_age import state_timeout_s
from canbase_runtime.received import Received


@dataclass(frozen=True, slots=True)
class StateTopic:
    """One topic, and what the server cannot know without it."""

    topic: str
    node: str
    code: ErrorCode
    """Of a goal that is running when it is lost."""
    unknown: str
    received: Callable[[Inputs], Received[Any]]
    timeout_s: Callable[[Robot], float]

    def silence(self, robot: Robot, inputs: Inputs, now_s: float) -> str | None:
        """Why its last message does not count, with its age and its timeout; None: it counts."""
        received, timeout_s = self.received(inputs), self.timeout_s(robot)
        if received.within(timeout_s, now_s) is not None:
            return None
        if received.never:
            return f"nothing received on {self.topic} yet; is {self.node} running?"
        age_s = received.age_s(now_s)
        return f"no message on {self.topic} for {age_s:.2f} s (timeout {timeout_s:.4g} s); is {self.node} running?"


ODOMETRY = StateTopic(
    "odom",
    "motor_driver",
    ErrorCode.ODOMETRY_LOST,
    "how far the base is",
    lambda inputs: inputs.odometry,
    lambda robot: robot.timeouts.odometry_s,
)
DRIVER = StateTopic(
    "motor_driver/status",
    "motor_driver",
    ErrorCode.DRIVE_FAULT,
    "whether the drives are enabled and the watchdog runs",
    lambda inputs: inputs.driver,
    lambda robot: state_timeout_s(1.0 / robot.rates.status_hz),
)
SAFETY = StateTopic(
    "safety_filter/state",
    "safety_filter",
    ErrorCode.ESTOP,
    "whether an emergency stop is pressed",
    lambda inputs: inputs.safety,
    lambda robot: state_timeout_s(),
)
MUX = StateTopic(
    "velocity_mux/state",
    "velocity_mux",
    ErrorCode.TAKEN_OVER,
    "whether another source has the base, or a lock holds",
    lambda inputs: inputs.mux,
    lambda robot: state_timeout_s(),
)
STATE_TOPICS = (ODOMETRY, DRIVER, SAFETY, MUX)


@dataclass(frozen=True, slots=True)
class States:
    """What counts of the inputs at one moment. None: nothing was received, or it is too old."""

    odometry: Odometry | None
    driver: Driver | None
    safety: Safety | None
    mux: Mux | None

    @classmethod
    def at(cls, robot: Robot, inputs: Inputs, now_s: float) -> States:
        """At `now_s` [s, monotonic]."""
        return cls(
            odometry=inputs.odometry.within(ODOMETRY.timeout_s(robot), now_s),
            driver=inputs.driver.within(DRIVER.timeout_s(robot), now_s),
            safety=inputs.safety.within(SAFETY.timeout_s(robot), now_s),
            mux=inputs.mux.within(MUX.timeout_s(robot), now_s),
        )
