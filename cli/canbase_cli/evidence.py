"""What `canbase doctor` has seen of a running robot, before anything is concluded from it. Filled by observe.py.

Messages are kept as they came, with their local monotonic receive times [s]. None and empty: nothing came.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from canbase_config.robot import Robot


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


@dataclass(frozen=True, slots=True)
class Evidence:
    """Everything that was seen, until `now`."""

    robot: Robot
    source: str
    """Where `robot` comes from: the path of its file."""
    now: float
    heard: dict[str, Heard] = field(default_factory=dict)
    """By topic, relative to the robot's namespace."""

    def on(self, topic: str) -> Heard:
        """What came on `topic`."""
        return self.heard.get(topic, Heard())
