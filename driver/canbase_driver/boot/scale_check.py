"""Whether a drive counts as robot.yaml says, and as it did when its wheel was measured. CiA 402-2."""

from __future__ import annotations

from collections.abc import Iterable

from canbase_config.drive import Drive
from canbase_config.object_map import AXIS_OFFSET
from canbase_config.reported_units import REPORTED, Misfit, misfits, undecided
from canbase_config.scale_objects import RATIOS, SCALE_OBJECTS, Expected
from canbase_driver.boot.steps import BootError, NodeAccess, Steps, unsigned
from canbase_driver.cia301.sdo_client import Read, SdoAborted

POSITION_RANGE = 0x607B
LEAST_TURNS = 1000.0
"""A range of 6064h of fewer revolutions of the wheel is refused: some hundred metres."""


def check_scale(node: NodeAccess, drive: Drive, *, identify: bool) -> Steps[tuple[Expected, ...]]:
    """The units that the drive reports. Raises BootError for one that contradicts `expects`, or else robot.yaml.

    `identify`: read all of SCALE_OBJECTS, not just those that can contradict robot.yaml.
    """
    yield from _check_range(node, drive)
    scale = yield from read_scale(drive, SCALE_OBJECTS if identify else REPORTED)
    yield from check_expected(node, drive)
    offset = _offset(drive)
    objects = {(each.index - offset, each.sub): each.value for each in scale}
    measured = {each.index - offset for each in drive.expects}
    for misfit in misfits(drive, objects, measured):
        problem = (
            f"{_at(drive, misfit)}: {misfit.meaning}, and robot.yaml has {misfit.key}: {misfit.has}, so {misfit.effect}"
        )
        raise BootError(node.node_id, problem, _unit_cure(drive, misfit, offset))
    if unclear := undecided(objects, measured):
        node.notes.append(
            f"{', '.join(unclear)} of {drive.joint}: it cannot be decided whether velocity_unit and "
            "counts_per_motor_rev fit; canbase setup commission --steps directions,scale shows it"
        )
    return scale


def _check_range(node: NodeAccess, drive: Drive) -> Steps[None]:
    """607Bh: a position that wraps there looks like a jump. Raises BootError for so short a way that goals fail by it;
    a longer one is a note."""
    index, limits = POSITION_RANGE + _offset(drive), []
    for sub in (1, 2):
        try:
            limits.append(int.from_bytes((yield Read(index, sub)), "little", signed=True))
        except SdoAborted:
            return
    width = limits[1] - limits[0] + 1
    if not 1 < width < 1 << 32:
        return
    turns = float(f"{width / drive.counts_per_motor_rev / drive.gear_ratio:.3g}")
    problem = (
        f"{index:04X}h lets 6064h of {drive.joint} wrap between {limits[0]} and {limits[1]}, each {turns:g} "
        "revolutions of the wheel, where the pose of the odometry is reset, and the base stops at the second time"
    )
    tool = whole_range(drive)
    if turns < LEAST_TURNS:
        raise BootError(node.node_id, problem, f"The whole range of 6064h: {tool}")
    node.notes.append(f"{problem}: {tool}")


def whole_range(drive: Drive) -> str:
    """What to do about a position that wraps."""
    at = f"{POSITION_RANGE + _offset(drive):04X}h"
    return f"set {at}:1 to -2147483648 and {at}:2 to 2147483647 with the manufacturer's tool"


def check_expected(node: NodeAccess, drive: Drive) -> Steps[None]:
    """Compare each entry of `expects`. Raises BootError for one that differs, or that the drive does not show."""
    for expected in drive.expects:
        at = f"{expected.index:04X}h:{expected.sub}{_name(expected.index)} of {drive.joint}"
        try:
            data: bytes = yield Read(expected.index, expected.sub)
        except SdoAborted as refused:
            raise BootError(node.node_id, f"{at} cannot be read: {refused.text}", _cure(drive, expected)) from refused
        value = unsigned(data)
        if not data or value != expected.value % (1 << 8 * len(data)):
            problem = f"{at} is {value}, and was {expected.value} when its wheel was measured"
            raise BootError(node.node_id, problem, _cure(drive, expected))


def read_scale(drive: Drive, indexes: Iterable[int]) -> Steps[tuple[Expected, ...]]:
    """Those of SCALE_OBJECTS that the drive has, with their values. It is no defect to have none."""
    offset, values = _offset(drive), []
    for index in indexes:
        for sub in (1, 2) if index in RATIOS else (0,):
            try:
                data: bytes = yield Read(index + offset, sub)
            except SdoAborted:
                break
            values.append(Expected(index=index + offset, sub=sub, value=unsigned(data[:4])))
    return tuple(values)


def _offset(drive: Drive) -> int:
    return AXIS_OFFSET * drive.axis if drive.kind.layout.second_axis == "offset" else 0


def _at(drive: Drive, misfit: Misfit) -> str:
    return f"{misfit.at}{_name(misfit.index)} of {drive.joint}"


def _unit_cure(drive: Drive, misfit: Misfit, offset: int) -> str:
    entry = f"{{index: 0x{misfit.index + offset:04X}, sub: {misfit.sub}, value: {misfit.value}}}"
    fits = f"set `{misfit.key}: {misfit.fits}`" if misfit.fits else f"no {misfit.key} means this"
    return (
        f"In robot.yaml, {fits} for {drive.joint}, or set {misfit.index + offset:04X}h with the manufacturer's tool to "
        f"what robot.yaml has. Where its wheel was measured and robot.yaml is right, add {entry} to its `expects`"
    )


def _name(index: int) -> str:
    name = SCALE_OBJECTS.get(index, "") or SCALE_OBJECTS.get(index - AXIS_OFFSET, "")
    return f" ({name})" if name else ""


def _cure(drive: Drive, expected: Expected) -> str:
    return (
        "The drive has lost or changed its settings, and would turn its wheel otherwise than ordered: set them again "
        f"(canbase bus params restore, or the manufacturer's tool). If the change is meant, take {expected.index:04X}h:"
        f"{expected.sub} out of `expects` of {drive.joint} in robot.yaml, and then, with the wheels up: "
        "canbase setup commission --steps directions,scale"
    )
