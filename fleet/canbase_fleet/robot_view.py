"""What is known of the robot when somebody asks: the last message of each topic, with its age. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from canbase_runtime.last_message import NOT_RECEIVED, LastMessage

DRIVER, SAFETY, MUX = "motor_driver/status", "safety_filter/state", "velocity_mux/state"
STOPS: Final = "stop_events"
MOST_STOPS: Final = 100
"""Kinds of stops that are told apart; a stranger on the topic could invent more."""
OTHER: Final = ("other", "other")


@dataclass(frozen=True, slots=True)
class RobotView:
    """One robot at one moment."""

    driver: LastMessage = NOT_RECEIVED
    """canbase/msg/DriverStatus."""
    safety: LastMessage = NOT_RECEIVED
    """canbase/msg/SafetyState."""
    mux: LastMessage = NOT_RECEIVED
    """canbase/msg/MuxState."""
    stops: Mapping[tuple[str, str], int] = field(default_factory=dict)
    """Stops since this process began, by what stopped the base and why."""
    dropped: int = 0
    """Messages that are larger than a real one can be."""

    @property
    def topics(self) -> dict[str, LastMessage]:
        """By topic."""
        return {DRIVER: self.driver, SAFETY: self.safety, MUX: self.mux}


def counted(stops: Mapping[tuple[str, str], int], stopped_by: str, cause: str) -> dict[tuple[str, str], int]:
    """The same with one stop more."""
    kind = stopped_by, cause
    if kind not in stops and len(stops) >= MOST_STOPS:
        kind = OTHER
    return {**stops, kind: stops.get(kind, 0) + 1}
