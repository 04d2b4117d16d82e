"""What `canbase doctor` has seen of a running robot, before anything is concluded from it. Filled by observe.py.

Messages are kept as they came, with their local monotonic receive times [s]. None and empty: nothing came.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from canbase_action_server.goal_step import GoalStep
from canbase_action_server.inputs import Inputs
from canbase_config.action import BEHAVIORS
from canbase_config.robot import Robot
from canbase_doctor.overload import Overload

ACTIONS = ("drive_distance", "rotate_angle")
"""Of every robot; `served_actions` has those of one robot."""
DOCTOR = "canbase_doctor"
"""Name of doctor's own node; what belongs to it is not seen."""


def served_actions(robot: Robot) -> tuple[str, ...]:
    """Names of the actions that the action server of this robot has."""
    return (*ACTIONS, *BEHAVIORS) if robot.action.nav2_behaviors else ACTIONS


@dataclass(frozen=True, slots=True)
class Heard:
    """The messages of one topic while doctor listened, oldest first."""

    messages: tuple[Any, ...] = ()
    times_s: tuple[float, ...] = ()

    @property
    def last(self) -> Any:
        """The newest message; None before the first."""
        return self.messages[-1] if self.messages else None

    @property
    def first(self) -> Any:
        """The oldest message; None before the first."""
        return self.messages[0] if self.messages else None

    @property
    def rate_hz(self) -> float:
        """Messages per second between the first and the last; 0 of fewer than two."""
        return (len(self.times_s) - 1) / (self.times_s[-1] - self.times_s[0]) if len(self.times_s) > 1 else 0.0

    @property
    def longest_gap_s(self) -> float:
        """Longest time between two messages; 0 of fewer than two."""
        return max((b - a for a, b in zip(self.times_s, self.times_s[1:], strict=False)), default=0.0)


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A publisher or subscriber: its node with its namespace, and the type of its messages."""

    node: str
    type: str


@dataclass(frozen=True, slots=True)
class VelocityTopic:
    """Who publishes and who reads a topic of Twist or TwistStamped."""

    publishers: tuple[Endpoint, ...] = ()
    subscribers: tuple[Endpoint, ...] = ()


@dataclass(frozen=True, slots=True)
class Goal:
    """A goal as the server's status topic reports it; `status` as in action_msgs/GoalStatus."""

    action: str
    uuid: str
    status: int

    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3

    @property
    def runs(self) -> bool:
        """It is being executed, or stopped."""
        return self.status in (self.EXECUTING, self.CANCELING)

    @property
    def ended(self) -> bool:
        """It has a result."""
        return self.status > self.CANCELING


@dataclass(frozen=True, slots=True)
class LoggedStep:
    """One log line of the action server: what happened to which goal (None: it was rejected), and the line's values.

    `at_s`: when, by the server's clock [s].
    """

    step: GoalStep
    uuid: str | None
    at_s: float
    values: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ServerProcess:
    """A process of the action server on this computer, and what of its environment decides which peers it reaches.

    `robot`: the name in its robot.yaml; empty: unknown.
    """

    pid: int
    environment: Mapping[str, str]
    robot: str = ""


@dataclass(frozen=True, slots=True)
class Answers:
    """How long the server took to answer harmless questions [s]; infinite: not at all."""

    question_s: tuple[float, ...] = ()
    """list_parameters."""
    cancel_s: tuple[float, ...] = ()
    """The cancel of a goal that does not exist."""
    results: Mapping[str, bool] = field(default_factory=dict)
    """UUID of an ended goal → whether the server still gives its result."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """Everything that was seen, until `now_s`."""

    robot: Robot
    source: str
    """Where `robot` comes from: the path of its file."""
    now_s: float
    namespace: str = "/"
    wall_s: float = 0.0
    """`now_s` by the computer's clock."""
    heard: Mapping[str, Heard] = field(default_factory=dict)
    """By topic, relative to the robot's namespace."""
    inputs: Inputs = field(default_factory=Inputs)
    """The same as the action server sees it."""
    steps: tuple[LoggedStep, ...] = ()
    """The server's log lines of the last ten seconds."""
    servers: Mapping[str, tuple[Endpoint, ...]] = field(default_factory=dict)
    """The servers of an action, by its whole name; in every namespace."""
    publishers: Mapping[str, tuple[Endpoint, ...]] = field(default_factory=dict)
    subscribers: Mapping[str, tuple[Endpoint, ...]] = field(default_factory=dict)
    velocities: Mapping[str, VelocityTopic] = field(default_factory=dict)
    """By whole name, in every namespace."""
    nav2_values: Mapping[tuple[str, str], tuple[float, ...]] = field(default_factory=dict)
    """Parameters that Nav2's nodes answered, by node and name; the numbers of a list, or one."""
    goals: tuple[Goal, ...] = ()
    processes: tuple[ServerProcess, ...] = ()
    environment: Mapping[str, str] = field(default_factory=dict)
    """Of doctor itself."""
    answers: Answers = Answers()
    metrics_unit: str = ""
    """The unit that starts `canbase serve metrics` with the robot; empty: none is enabled on this computer."""
    overload: Overload = field(default_factory=Overload)
    """Of this computer, while doctor listened."""

    def on(self, topic: str) -> Heard:
        """What came on `topic`."""
        return self.heard.get(topic, Heard())

    def whole_name(self, name: str) -> str:
        """`name` with the robot's namespace."""
        return f"{self.namespace.rstrip('/')}/{name}"

    @property
    def own_processes(self) -> tuple[ServerProcess, ...]:
        """Without those of other robots."""
        return tuple(process for process in self.processes if process.robot in ("", self.robot.name))

    @property
    def running(self) -> tuple[Goal, ...]:
        """The goals that run."""
        return tuple(goal for goal in self.goals if goal.runs)
