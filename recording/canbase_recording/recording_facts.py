"""What is known of a recording apart from its contents: file, format, duration, what is wrong with it. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from canbase_recording.explanation import Explanation


@dataclass(frozen=True, slots=True)
class RecordingFacts:
    """`config`: the robot.yaml that it was read with, empty: none; `problems`: a sentence each."""

    file: str
    format: str
    began: str
    config: str
    problems: tuple[str, ...]

    def sentence(self, told: Explanation) -> str:
        """The first line for people."""
        began = f", begun {self.began}" if self.began else ""
        echoes = f", {told.echoes} echoes of sent frames left out" if told.echoes else ""
        known = f"read with {self.config}" if self.config else "without robot.yaml: raw numbers of the drives"
        return (
            f"{self.file}: {self.format}, {told.frames} frames and {told.notes} notes in {told.ended_s:.1f} s"
            f"{began}{echoes}; {known}"
        )
