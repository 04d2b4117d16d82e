"""What a piece of evidence is worth. Only what is present counts; everything else is named on the first page. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Standing(Enum):
    """The value is what the page shows."""

    PRESENT = "present"
    INCOMPLETE = "incomplete"
    MISSING = "missing"
    STALE = "out of date"
    """robot.yaml has changed since."""
    OTHER = "does not belong here"
    """Of another configuration, another robot or another version of canbase."""
    FAILED = "failed"

    @property
    def counts(self) -> bool:
        """Whether it is evidence for this robot."""
        return self is Standing.PRESENT


class Part(Enum):
    """The parts of the evidence, in the order of the page. The value is the heading."""

    CONFIGURATION = "Configuration"
    HAZARDS = "Hazards and tests"
    QUALIFICATION = "Qualification in simulation"
    COMMISSIONING = "Commissioning"
    DRIVES = "Drives"
    RECORDINGS = "Recorded stops"
    SOFTWARE = "Software"


@dataclass(frozen=True, slots=True)
class Finding:
    """One sentence about one part. `cure`: the command or option that adds what is missing."""

    part: Part
    standing: Standing
    sentence: str
    cure: str = ""
