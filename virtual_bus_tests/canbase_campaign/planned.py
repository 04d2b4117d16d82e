"""The plan of one scenario: what is given from outside. Only data."""

from __future__ import annotations

from dataclasses import dataclass

from canbase_campaign.fault import PlannedFault


@dataclass(frozen=True, slots=True)
class Segment:
    """A source publishes at `rate_hz` for a while; not before, not after. Times from the scenario's start [s]."""

    source: str
    start_s: float
    duration_s: float
    kind: str
    linear_mps: float
    angular_radps: float
    rate_hz: float

    def __str__(self) -> str:
        speed = f"{self.linear_mps:+.2f} m/s {self.angular_radps:+.2f} rad/s"
        return (
            f"{self.start_s:5.2f} s  {self.source} {self.kind} {speed}, {self.rate_hz:.0f} Hz, {self.duration_s:.2f} s"
        )


@dataclass(frozen=True, slots=True)
class GoalRequest:
    """A client sends a goal, and may cancel it."""

    start_s: float
    distance_m: float
    speed_mps: float
    cancel_after_s: float | None

    def __str__(self) -> str:
        cancel = "" if self.cancel_after_s is None else f", cancelled after {self.cancel_after_s:.2f} s"
        return f"{self.start_s:5.2f} s  goal {self.distance_m:+.3f} m at {self.speed_mps:.2f} m/s{cancel}"


@dataclass(frozen=True, slots=True)
class Plan:
    """Everything that is given from outside."""

    seed: int
    duration_s: float
    bitrate: int
    segments: tuple[Segment, ...]
    goals: tuple[GoalRequest, ...]
    resets_s: tuple[float, ...]
    faults: tuple[PlannedFault, ...]
    boots: bool = False
    """It begins with everything off; else with the driver enabled and the base at rest."""

    def lines(self, robot: str) -> list[str]:
        """The plan in words, after those about its `robot`."""
        resets = [f"{at_s:5.2f} s  operator resets" for at_s in self.resets_s]
        parts = [str(part) for part in (*self.segments, *self.goals, *self.faults)]
        head = f"seed {self.seed}: {self.duration_s:.2f} s at {self.bitrate} bit/s"
        return [head, robot, *sorted(parts + resets)]
