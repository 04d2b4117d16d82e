"""Whether a drive still means by its numbers what it meant when `canbase commission` turned its wheel. CiA 402-2."""

from __future__ import annotations

from canbase_config.drive import Drive
from canbase_config.object_map import AXIS_OFFSET
from canbase_config.scale_objects import RATIOS, SCALE_OBJECTS, Expected
from canbase_driver.boot.steps import BootError, NodeAccess, Steps, unsigned
from canbase_driver.cia301.sdo_client import Read, SdoAborted


def check_expected(node: NodeAccess, drive: Drive) -> Steps[None]:
    """Compare each entry of `expects`. Raises BootError for one that differs, or that the drive does not show."""
    for expected in drive.expects:
        at = f"{expected.index:04X}h:{expected.sub}{_name(expected.index)} of {drive.joint}"
        try:
            data: bytes = yield Read(expected.index, expected.sub)
        except SdoAborted as refused:
            raise BootError(node.node_id, f"{at} cannot be read: {refused.text}", _cure(drive, expected)) from refused
        found = unsigned(data)
        if not data or found != expected.value % (1 << 8 * len(data)):
            problem = f"{at} is {found}, and was {expected.value} when its wheel was measured"
            raise BootError(node.node_id, problem, _cure(drive, expected))


def read_scale(drive: Drive) -> Steps[tuple[Expected, ...]]:
    """Those of SCALE_OBJECTS that the drive has, with their values. It is no defect to have none."""
    offset = AXIS_OFFSET * drive.axis if drive.kind.layout.second_axis == "offset" else 0
    found = []
    for index in SCALE_OBJECTS:
        for sub in (1, 2) if index in RATIOS else (0,):
            try:
                data: bytes = yield Read(index + offset, sub)
            except SdoAborted:
                break
            found.append(Expected(index=index + offset, sub=sub, value=unsigned(data[:4])))
    return tuple(found)


def _name(index: int) -> str:
    name = SCALE_OBJECTS.get(index, "") or SCALE_OBJECTS.get(index - AXIS_OFFSET, "")
    return f" ({name})" if name else ""


def _cure(drive: Drive, expected: Expected) -> str:
    return (
        "The drive has lost or changed its settings, and would turn its wheel otherwise than ordered: set them again "
        f"(canbase params restore, or the maker's tool). If the change is meant, take {expected.index:04X}h:"
        f"{expected.sub} out of `expects` of {drive.joint} in robot.yaml, and then, with the wheels up: canbase "
        "commission --steps directions,scale"
    )
