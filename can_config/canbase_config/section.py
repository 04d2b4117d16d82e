"""What sections of robot.yaml are made of: their base class, names, topics, the error of values that do not fit."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Name = Annotated[
    str,
    Field(
        pattern=r"^[A-Za-z][A-Za-z0-9_]*$",
        max_length=64,
        json_schema_extra={"form": "letters, digits and _, first a letter"},
    ),
]
Topic = Annotated[
    str,
    Field(
        pattern=r"^/?[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*$",
        max_length=128,
        json_schema_extra={"form": "letters, digits and _, joined by /, each part first a letter"},
    ),
]
NodeName = Annotated[
    str,
    Field(
        pattern=r"^/?[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*$",
        max_length=128,
        json_schema_extra={"form": "a node's name, with its namespace or relative to the robot's"},
    ),
]


class MisfitError(ValueError):
    """Values that are each allowed do not fit together. `at`: where the offender may be, below the raising section."""

    def __init__(self, message: str, *at: tuple[str | int, ...]) -> None:
        super().__init__(message)
        self.at = at


class Section(BaseModel):
    """Base of all sections: immutable, no unknown keys, no implicit conversion of types."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, ser_json_inf_nan="constants")
