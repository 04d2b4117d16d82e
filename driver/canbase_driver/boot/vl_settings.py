"""What the boot sets for mode 2 (vl, velocity mode of inverters): ramps, limits and the unit of 6042h. CiA 402-2.

It has ramps and limits of its own, in the unit of 6042h: modes 3 and 9 have 6083h to 6085h in their place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_config.drive import Drive
from canbase_config.object_map import AXIS_OFFSET
from canbase_config.robot import Robot
from canbase_config.stopping import max_wheel_mps
from canbase_driver.boot.steps import BootError, NodeAccess, Steps
from canbase_driver.cia301.sdo_client import Write
from canbase_driver.drive_units import AxisUnits

MIN_MAX, FACTOR = 0x6046, 0x604C
MIN, MAX = 1, 2
"""Sub-indexes of 6046h: the least and the greatest amount of the speed."""
RAMPS = {0x6083: 0x6048, 0x6084: 0x6049, 0x6085: 0x604A}
"""Acceleration, deceleration and quick stop of modes 3 and 9 → those of mode 2: so much speed in so many seconds."""
SPEED, SECONDS = 1, 2
"""Their sub-indexes."""


@dataclass(frozen=True, slots=True)
class KeptRamp:
    """A ramp that a drive does not let others set. `what`: the object and its value, a sentence without its end."""

    what: str = ""
    mps2: float | None = None
    """At the rim of the wheel; None: the drive does not show it, and `what` has the unit of its value."""


def configure_vl(node: NodeAccess, drive: Drive, robot: Robot) -> Steps[None]:
    """The unit of 6042h, and its limits.

    Raises BootError when the drive keeps a unit that its profile does not have, a least speed above 0 (it would turn
    the wheel faster than ordered), or a greatest one below what the limits of robot.yaml need.
    """
    yield from _set_unit(node, drive)
    units, offset = AxisUnits(drive, robot.base), AXIS_OFFSET * drive.axis
    least = Write(MIN_MAX + offset, MIN, 0, 4)
    if not (yield from node.set_if_present(least)):
        kept = yield from node.read_if_present(least.index, least.sub)
        if kept:
            problem = (
                f"{least} stays at {kept}: {drive.joint} turns at {_mps(units, kept):.3g} m/s where less is ordered"
            )
            raise BootError(node.node_id, problem, "Set it to 0 with the manufacturer's tool")
    needed = abs(units.velocity_raw(max_wheel_mps(robot)))
    kept = yield from node.read_if_present(least.index, MAX)
    if kept is None or kept >= needed or (yield from node.set_if_present(Write(least.index, MAX, needed, 4))):
        return
    problem = f"{least.index:04X}h:{MAX} stays at {kept}: {drive.joint} turns at {_mps(units, kept):.3g} m/s at most"
    slower = f"lower limits.linear_mps and limits.angular_radps: they need {max_wheel_mps(robot):.3g} m/s"
    raise BootError(node.node_id, problem, f"Set it to {needed} with the manufacturer's tool, or {slower}")


def set_vl_ramp(node: NodeAccess, drive: Drive, robot: Robot, index: int, mps2: float) -> Steps[KeptRamp | None]:
    """The ramp that mode 2 has in place of `index` (6083h to 6085h). Returns what the drive keeps where it does not
    take it; None: it took it, or its profile says it has none."""
    units, presence = AxisUnits(drive, robot.base), drive.kind.options.ramps
    at = RAMPS[index] + AXIS_OFFSET * drive.axis
    seconds: int | None = 1
    if not (yield from node.set_if_present(Write(at, SECONDS, 1, 2), presence)):
        if presence == "no":
            return None
        seconds = yield from node.read_if_present(at, SECONDS)
    if seconds is None:
        return KeptRamp(f" in 1 s in {at:04X}h")
    speed = units.acceleration_raw(mps2 * max(seconds, 1))
    if (yield from node.set_if_present(Write(at, SPEED, speed, 4), presence)):
        return None
    kept = yield from node.read_if_present(at, SPEED)
    if kept is None:
        return KeptRamp(f" in {seconds} s in {at:04X}h")
    has = units.acceleration_mps2(kept) / seconds if seconds else math.inf
    return KeptRamp(f"{at:04X}h stays at {kept} in {seconds} s", has)


def _set_unit(node: NodeAccess, drive: Drive) -> Steps[None]:
    """604Ch of 1/1 is rpm. For another unit of the profile the drive's own setting counts."""
    if drive.target_unit != "rpm":
        return
    index = FACTOR + AXIS_OFFSET * drive.axis
    for sub in (1, 2):
        if (yield from node.set_if_present(Write(index, sub, 1, 4))):
            continue
        kept = yield from node.read_if_present(index, sub)
        if kept not in (None, 1):
            problem = f"{index:04X}h:{sub} stays at {kept}: one bit of 6042h is not 1 rpm"
            cure = (
                "Set 604Ch to 1/1 with the manufacturer's tool, or `units.target_velocity` and `units.actual_velocity`"
            )
            raise BootError(node.node_id, problem, f"{cure} of its drive profile to what it is")


def _mps(units: AxisUnits, raw: int) -> float:
    return abs(units.velocity_mps(raw))
