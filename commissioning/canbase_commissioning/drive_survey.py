"""What a drive reports of its axes: how many, encoder resolution, gear (CiA 402-2). SDO reads alone."""

from __future__ import annotations

from dataclasses import dataclass

from canbase_commissioning.identification import NodeCard
from canbase_config.object_map import AXIS_OFFSET, STATUSWORD, place
from canbase_config.profile import Profile, VelocityUnit
from canbase_config.profile_file import guess, load_profile
from canbase_config.reported_units import SI_VELOCITY, VELOCITY_DIMENSION, VELOCITY_NOTATION, reported_velocity_unit
from canbase_driver.boot.steps import Steps, unsigned
from canbase_driver.cia301.sdo_client import Read, SdoAborted

ENCODER_RESOLUTION, GEAR_RATIO = 0x608F, 0x6091
"""Increments for motor revolutions; motor revolutions for shaft revolutions (sub-indexes 1 and 2, CiA 402-2)."""
GENERIC = "generic"
LEAST_GEAR, MOST_GEAR = 1e-3, 10_000.0
MOST_COUNTS = 2**31 - 1
MOST_BYTES = 4
"""Both are numbers of 32 bits at most."""


@dataclass(frozen=True, slots=True)
class FoundAxis:
    """One axis of a drive on the bus. None: the drive does not report the value, or not a usable one."""

    node_id: int
    axis: int
    profile: str
    """For `profile` in robot.yaml."""
    counts_per_motor_rev: int | None = None
    gear_ratio: float | None = None
    velocity_unit: VelocityUnit | None = None

    @property
    def title(self) -> str:
        """What it is, for a person."""
        second = ", second axis" if self.axis else ""
        return f"node {self.node_id}{second} ({load_profile(self.profile).title})"

    @property
    def lacks_unit(self) -> bool:
        """Whether robot.yaml has to name the velocity unit: the profile cannot, or assumes one."""
        return self.profile == GENERIC or load_profile(self.profile).units.target_velocity is None


def profile_of(card: NodeCard) -> str:
    """The profile that knows this drive, or the generic one for a CiA 402 drive; empty: it is no motor drive."""
    return guess(card.vendor_id, card.product_code) or (GENERIC if card.profile_402 else "")


def survey(node_id: int, profile: str) -> Steps[tuple[FoundAxis, ...]]:
    """Reads one drive. Raises SdoTimeout when it stops answering."""
    kind = load_profile(profile)
    layout = kind.layout
    axes = []
    for axis in range(layout.axes):
        if axis and not (yield from _has(kind, axis)):
            break
        # Drives whose axes are sub-indexes have these objects once, or not at all.
        offset = AXIS_OFFSET * axis if layout.second_axis == "offset" else 0
        counts = yield from _ratio(ENCODER_RESOLUTION + offset)
        gear = yield from _ratio(GEAR_RATIO + offset)
        whole = int(counts) if counts is not None and 1 <= counts <= MOST_COUNTS and counts.is_integer() else None
        usable_gear = gear if gear is not None and LEAST_GEAR <= gear <= MOST_GEAR else None
        unit = yield from _velocity_unit(offset, whole or 1)
        axes.append(FoundAxis(node_id, axis, profile, whole, usable_gear, unit))
    return tuple(axes)


def _has(kind: Profile, axis: int) -> Steps[bool]:
    """Whether the axis has a statusword."""
    at = place(kind, STATUSWORD, axis)
    return (yield from _number(at.index, at.sub)) is not None


def _velocity_unit(offset: int, counts: int) -> Steps[VelocityUnit | None]:
    objects = {}
    for index in (SI_VELOCITY, VELOCITY_DIMENSION, VELOCITY_NOTATION):
        objects[index, 0] = (yield from _number(index + offset, 0)) or 0
    return reported_velocity_unit(objects, counts)


def _ratio(index: int) -> Steps[float | None]:
    """Sub-index 1 divided by sub-index 2, which counts as 1 where it is missing; None: not there, or a zero."""
    dividend = yield from _number(index, 1)
    divisor = yield from _number(index, 2)
    if not dividend or divisor == 0:
        return None
    return dividend / (divisor or 1)


def _number(index: int, sub: int) -> Steps[int | None]:
    try:
        data = yield Read(index, sub)
    except SdoAborted:
        return None
    return unsigned(data) if 0 < len(data) <= MOST_BYTES else None
