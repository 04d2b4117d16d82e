"""hazards.yaml as validated rows. The form is that of STPA: unsafe control action, hazard, constraint, layer."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, model_validator
from ruamel.yaml import YAML

FILE = Path(__file__).with_name("hazards.yaml")
"""The catalogue that canbase is installed with."""

Sentence = Annotated[str, Field(min_length=3)]


class Part(Enum):
    """What fails; one heading of docs/hazards.md each."""

    PROCESS = "process"
    BUS_AND_DRIVES = "bus_and_drives"
    COMPUTER = "computer"
    ROS = "ros"
    OPERATOR = "operator"
    ACCESS = "access"

    @property
    def heading(self) -> str:
        """Of its hazards."""
        return _HEADINGS[self]


_HEADINGS = {
    Part.PROCESS: "A process",
    Part.BUS_AND_DRIVES: "Bus and drives",
    Part.COMPUTER: "The computer",
    Part.ROS: "ROS",
    Part.OPERATOR: "Operators",
    Part.ACCESS: "Access",
}


class Hazard(Enum):
    """What the base must not do to people and things."""

    COLLISION = "collision"
    RUNAWAY = "runaway"
    UNEXPECTED_START = "unexpected_start"
    UNEXPECTED_PATH = "unexpected_path"
    LOSS_OF_STOP = "loss_of_stop"
    INTRUSION = "intrusion"


class Braking(Enum):
    """How the base loses its speed once a component has acted."""

    RAMP = "ramp"
    """The driver's ramp: limits.deceleration_mps2."""
    QUICK_STOP = "quick_stop"
    """The drives' quick stop: limits.emergency_deceleration_mps2."""
    COAST = "coast"
    """Power is off: friction alone. No formula; a distance is measured, not promised."""
    NONE = "none"
    """Nothing moves, or nothing that moves is stopped by this row."""


class Row(BaseModel):
    """One failure: what must hold, which component holds it, within what time, and the tests that prove it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    id: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
    part: Part
    failure: Sentence
    unsafe_control_action: Sentence
    hazard: Hazard
    constraint: Sentence
    layer: Sentence
    within_s: str = ""
    """Formula: from the failure until the component acts [s]. Empty where time is no part of the constraint."""
    distance_m: str = ""
    """Formula: distance until the component acts and the base has braked [m], where the usual one does not hold."""
    braking: Braking = Braking.NONE
    reaction: Sentence
    stop_category: Annotated[str, Field(pattern="^(0|1|2|none)$")]
    """The stop category of IEC 60204-1 that the reaction resembles. Described, never claimed."""
    tests: Annotated[tuple[str, ...], Field(min_length=1)]
    faults: tuple[str, ...] = ()
    """Failures of the campaign that are this one: names of faults, or of twins as `what: how`. `canbase prove qualify`
    measures them, and the twins of the rows `matrix: …` of `tests`."""
    safeguard: str = ""
    """Name in campaign/removed_safeguards.py: `make teeth` takes it out and must find it missing."""
    not_covered: str = ""


class Catalogue(BaseModel):
    """The whole file."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    rows: Annotated[tuple[Row, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _ids_are_unique(self) -> Catalogue:
        ids = [row.id for row in self.rows]
        twice = sorted({each for each in ids if ids.count(each) > 1})
        if twice:
            raise ValueError(f"two rows have the id {', '.join(twice)}")
        return self


def load(path: Path = FILE) -> Catalogue:
    """The catalogue. Raises pydantic.ValidationError, whose message names row and key."""
    return Catalogue.model_validate(YAML(typ="safe").load(path.read_text(encoding="utf-8")))
