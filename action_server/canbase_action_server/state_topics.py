"""The topics that a goal depends on: how old the last message may be, and what it means when there is none. A table.

Rules. What is missing counts as the worst that it could report: the goal ends, the base stops, and nothing starts. A
topic with a second publisher is missing: the last message does not contain its publisher (`without_contested`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from canbase_action_server.inputs import Driver, Inputs, Mux, Odometry, Safety
from canbase_action_server.outcome import ErrorCode
from canbase_config.robot import Robot
from canbase_config.state_age import state_timeout_s, status_period_s
from canbase_runtime import chain_topics
from canbase_runtime.chain_topics import ChainTopic
from canbase_runtime.received import NEVER, Received


@dataclass(frozen=True, slots=True)
class StateTopic:
    """One topic, and what the server cannot know without it."""

    row: ChainTopic
    field: str
    """Of `Inputs`."""
    code: ErrorCode
    """Of a goal that is running when it is lost."""
    unknown: str
    timeout_s: Callable[[Robot], float]

    @property
    def topic(self) -> str:
        """Its relative name."""
        return self.row.topic

    def received(self, inputs: Inputs) -> Received[Any]:
        """Its last message."""
        received: Received[Any] = getattr(inputs, self.field)
        return received

    def second_sender(self, inputs: Inputs, now_s: float) -> str | None:
        """The sentence about its second publisher; None: it has one alone."""
        found = contested(inputs, now_s).get(self.topic)
        return found and f"{found}; end it (a node that was killed is listed for about 20 s)."

    def silence(self, robot: Robot, inputs: Inputs, now_s: float) -> str | None:
        """Why its last message does not count, with its age and its timeout; None: it counts."""
        second = self.second_sender(inputs, now_s)
        if second is not None:
            return second
        received, timeout_s = self.received(inputs), self.timeout_s(robot)
        if received.within(timeout_s, now_s) is not None:
            return None
        if received.never:
            return f"nothing received on {self.topic} yet; is {self.row.node} running?"
        age_s = received.age_s(now_s)
        return f"no message on {self.topic} for {age_s:.2f} s (timeout {timeout_s:.4g} s); is {self.row.node} running?"


ODOMETRY = StateTopic(
    chain_topics.ODOM,
    "odometry",
    ErrorCode.ODOMETRY_LOST,
    "how far the base is",
    lambda robot: robot.timeouts.odometry_s,
)
DRIVER = StateTopic(
    chain_topics.DRIVER_STATUS,
    "driver",
    ErrorCode.DRIVE_FAULT,
    "whether the drives are enabled and the watchdog runs",
    lambda robot: state_timeout_s(status_period_s(robot.rates)),
)
SAFETY = StateTopic(
    chain_topics.SAFETY_STATE,
    "safety",
    ErrorCode.ESTOP,
    "whether an emergency stop is pressed",
    lambda robot: state_timeout_s(),
)
MUX = StateTopic(
    chain_topics.MUX_STATE,
    "mux",
    ErrorCode.TAKEN_OVER,
    "whether another source has the base, or a lock holds",
    lambda robot: state_timeout_s(),
)
STATE_TOPICS = (ODOMETRY, DRIVER, SAFETY, MUX)


def contested(inputs: Inputs, now_s: float) -> Mapping[str, str]:
    """The topics that have a second publisher at `now_s` [s, monotonic]. A report counts as long as a state of the mux:
    a second publisher of velocity_mux/state that reports none does not hide it."""
    return inputs.contested.within(state_timeout_s(), now_s) or {}


def without_contested(inputs: Inputs, now_s: float) -> Inputs:
    """`inputs` in which nothing was received on a topic with a second publisher."""
    fields = {topic.field: NEVER for topic in STATE_TOPICS if topic.topic in contested(inputs, now_s)}
    return replace(inputs, **fields)  # type: ignore[arg-type]  # the names are those of Inputs


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
