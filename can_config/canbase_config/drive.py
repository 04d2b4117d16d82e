"""The keys of robot.yaml below `drives`: one axis of one motor drive."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from canbase_config.drive_values import DriveValue
from canbase_config.errors import ConfigError
from canbase_config.profile import Profile, VelocityUnit
from canbase_config.profile_file import load_profile
from canbase_config.scale_objects import Expected
from canbase_config.section import MisfitError, Name, Section


class Identity(Section):
    """What the objects 1018h and 100Ah must contain; a key that is not given is not compared."""

    vendor_id: Annotated[int, Field(ge=0, le=0xFFFF_FFFF, description="1018h:1")] | None = None
    product_code: Annotated[int, Field(ge=0, le=0xFFFF_FFFF, description="1018h:2")] | None = None
    revision: Annotated[int, Field(ge=0, le=0xFFFF_FFFF, description="1018h:3")] | None = None
    serial: Annotated[int, Field(ge=0, le=0xFFFF_FFFF, description="1018h:4")] | None = None
    software: Annotated[str, Field(min_length=1, max_length=64, description="firmware, 100Ah")] | None = None


class Drive(Section):
    """One axis of one motor drive, and the wheel that it turns."""

    joint: Annotated[Name, Field(description="name in joint_states")]
    node_id: Annotated[int, Field(ge=1, le=125, description="CANopen node id; 126 and 127 are used by canbase")]
    axis: Annotated[int, Field(ge=0, le=1, description="axis in the node; its objects are at 6000h + 800h × axis")] = 0
    side: Annotated[Literal["left", "right"], Field(description="side of the base")]
    direction: Annotated[
        Literal[1, -1], Field(description="+1: a positive motor velocity drives the base forward; -1: mounted mirrored")
    ] = 1
    gear_ratio: Annotated[float, Field(gt=0.0, le=10_000.0, description="motor revolutions per wheel revolution")]
    counts_per_motor_rev: Annotated[
        int, Field(ge=1, le=2**31 - 1, description="increments of 6064h per motor revolution")
    ]
    rated_torque_nm: (
        Annotated[
            float,
            Field(
                gt=0.0,
                le=1000.0,
                description="of the motor, 100 % of 6077h; for effort in joint_states [N·m]",
            ),
        ]
        | None
    ) = None
    profile: Annotated[
        str,
        Field(min_length=1, description="drive profile (docs/drives.md), or a .yaml file in the folder of robot.yaml"),
    ] = "generic"
    mode: (
        Annotated[
            int,
            Field(
                ge=-128,
                le=127,
                description="6060h: 3 profile velocity, 9 cyclic, 2 vl (inverters); default: the profile's first",
            ),
        ]
        | None
    ) = None
    velocity_unit: (
        Annotated[
            VelocityUnit, Field(description="one bit of 60FFh and 606Ch, at the motor shaft; default: the profile's")
        ]
        | None
    ) = None
    identity: Identity = Identity()
    expects: Annotated[
        tuple[Expected, ...],
        Field(
            strict=False,
            max_length=64,
            description="objects that each boot compares; `canbase setup commission` notes here what "
            "units and polarity the "
            "drive has",
        ),
    ] = ()
    values: Annotated[
        tuple[DriveValue, ...],
        Field(strict=False, description="objects that are published as named values, in spare TPDOs"),
    ] = ()

    @property
    def kind(self) -> Profile:
        """The profile of this kind of drive."""
        return load_profile(self.profile)

    @property
    def target_unit(self) -> VelocityUnit:
        """One bit of 60FFh."""
        return self._unit(self.kind.units.target_velocity)

    @property
    def actual_unit(self) -> VelocityUnit:
        """One bit of 606Ch."""
        return self._unit(self.kind.units.actual_velocity)

    @property
    def used_mode(self) -> int:
        """The value of 6060h."""
        return self.kind.modes[0] if self.mode is None else self.mode

    def _unit(self, of_profile: VelocityUnit | None) -> VelocityUnit:
        unit = self.velocity_unit or of_profile
        if unit is None:
            message = f"velocity_unit is missing: with {self.kind.title} it depends on the drive's own settings"
            raise MisfitError(message, ("velocity_unit",), ("profile",))
        return unit

    @field_validator("profile")
    @classmethod
    def _profile_exists(cls, name: str, info: ValidationInfo) -> str:
        """A file is looked for beside robot.yaml, and kept with its whole path."""
        if name.endswith((".yaml", ".yml")):
            folder = (info.context or {}).get("folder", Path())
            name = str((folder / name).absolute())
        try:
            load_profile(name)
        except ConfigError as error:
            raise ValueError(f"the profile cannot be used:\n{error}") from error
        return name

    @model_validator(mode="after")
    def _fits_the_profile(self) -> Drive:
        kind = self.kind
        if self.axis >= kind.layout.axes:
            raise MisfitError(f"a {kind.title} turns {kind.layout.axes} motor(s); axis 0 is the first", ("axis",))
        if self.used_mode not in kind.modes:
            known = ", ".join(map(str, kind.modes))
            raise MisfitError(f"a {kind.title} takes velocities in mode {known}, not in {self.used_mode}", ("mode",))
        differ = kind.units.target_velocity != kind.units.actual_velocity
        if self.velocity_unit is not None and differ:
            raise MisfitError("60FFh and 606Ch of this profile have different units; leave it out", ("velocity_unit",))
        self._unit(kind.units.target_velocity)
        return self
