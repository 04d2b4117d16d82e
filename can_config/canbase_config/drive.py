"""The keys of robot.yaml below `drives`: one axis of one motor drive."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from canbase_config.section import Name, Section

VelocityUnit = Literal["rpm", "0.1rpm", "0.001rpm", "rev/s", "0.001rev/s", "counts/s", "0.1counts/s"]
"""What one bit of 60FFh and 606Ch means, always at the motor shaft (before the gear)."""


class Identity(Section):
    """What object 1018h must say; a key that is not given is not compared."""

    vendor_id: Annotated[int, Field(ge=0, le=0xFFFF_FFFF, description="1018h:1")] | None = None
    product_code: Annotated[int, Field(ge=0, le=0xFFFF_FFFF, description="1018h:2")] | None = None
    revision: Annotated[int, Field(ge=0, le=0xFFFF_FFFF, description="1018h:3")] | None = None
    serial: Annotated[int, Field(ge=0, le=0xFFFF_FFFF, description="1018h:4")] | None = None


class Drive(Section):
    """One axis of one motor drive, and the wheel that it turns."""

    joint: Annotated[Name, Field(description="name in joint_states")]
    node_id: Annotated[int, Field(ge=1, le=125, description="CANopen node id; 126 and 127 are ours")]
    axis: Annotated[int, Field(ge=0, le=1, description="axis in the node; its objects are at 6000h + 800h × axis")] = 0
    side: Annotated[Literal["left", "right"], Field(description="side of the base")]
    direction: Annotated[
        Literal[1, -1], Field(description="+1: a positive motor velocity drives the base forward; -1: mounted mirrored")
    ] = 1
    gear_ratio: Annotated[float, Field(gt=0.0, le=10_000.0, description="motor revolutions per wheel revolution")]
    counts_per_motor_rev: Annotated[
        int, Field(ge=1, le=2**31 - 1, description="increments of 6064h per motor revolution")
    ]
    velocity_unit: Annotated[VelocityUnit, Field(description="one bit of 60FFh and 606Ch, at the motor shaft")] = "rpm"
    identity: Identity = Identity()
