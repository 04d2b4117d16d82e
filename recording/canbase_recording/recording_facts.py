"""What is known of a recording apart from its contents: file, format, duration, what is wrong with it. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from canbase_recording.explanation import Explanation


@dataclass(frozen=True, slots=True)
class OwnTrip:
    """What the watchdog itself recorded of the stop for which a black box was written.

    `at_s`: of its trip, in seconds of the black box; below 0 the driver hung before it begins, and `told` has what the
    watchdog recorded until then.
    """

    path: str
    detail: str
    at_s: float
    told: Explanation | None

    @property
    def sentence(self) -> str:
        """That there is such a file."""
        if self.told is None:
            return f"The watchdog recorded a trip of its own: {self.detail}."
        return (
            f"{-self.at_s:.1f} s before this recording begins, the watchdog tripped: {self.detail}. "
            f"The driver did not run until then. The watchdog recorded this:"
        )


@dataclass(frozen=True, slots=True)
class RecordingFacts:
    """`config`: the robot.yaml that it was read with, empty: none; `problems`: a sentence each."""

    file: str
    format: str
    began: str
    config: str
    problems: tuple[str, ...]
    trip: OwnTrip | None = None

    def sentence(self, told: Explanation) -> str:
        """The first line for people."""
        began = f", begun {self.began}" if self.began else ""
        echoes = f", {told.echoes} echoes of sent frames left out" if told.echoes else ""
        known = f"read with {self.config}" if self.config else "without robot.yaml: raw numbers of the drives"
        return (
            f"{self.file}: {self.format}, {told.frames} frames and {told.notes} notes in {told.ended_s:.1f} s"
            f"{began}{echoes}; {known}"
        )
