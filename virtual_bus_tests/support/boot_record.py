"""What a boot writes to the first node of a kind of drive, in order: read from the frames between boot and drive.

Virtual time, the bench in memory, simulated drives as after power on.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from canbase_config.drive import Drive
from canbase_config.profile_file import load_profile
from canbase_config.robot import Robot
from canbase_driver.boot.node_boot import NodeBoot
from canbase_driver.boot.sequence import BootReport
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import NmtCommand
from canbase_sim.frame import Frame as BenchFrame
from canbase_sim.world.bench import Bench
from support.crews import robot_with

LIMIT_S, STEP_S = 10.0, 0.001
_NMT, _TO_DRIVE, _FROM_DRIVE = 0x000, 0x600, 0x580
_DOWNLOAD, _DONE = 0x20, 0x60
"""Command specifiers of expedited SDO transfers (CiA 301), in bits 7 to 5 of the first byte."""


@dataclass(frozen=True, slots=True)
class Written:
    """One SDO write that the drive confirmed. `value` is unsigned, `size` in bytes."""

    index: int
    sub: int
    value: int
    size: int


@dataclass(frozen=True, slots=True)
class BootRecord:
    """A boot that ended well, of the node with `drives`."""

    robot: Robot
    drives: tuple[Drive, ...]
    steps: tuple[Written | NmtCommand, ...]
    report: BootReport


def robot_of_kind(kind: str) -> Robot:
    """The robot of the bench with this kind of drive: two, or one for both motors where the kind is made for two."""
    robot, both = robot_with(kind), kind != "generic" and load_profile(kind).layout.axes == 2
    values = robot.model_dump()
    for number, drive in enumerate(values["drives"]):
        drive |= {"node_id": 1, "axis": number} if both else {}
    return Robot.model_validate(values)


def boot_record(kind: str) -> BootRecord:
    """Boots the first node of `robot_of_kind`. Raises AssertionError when the boot does not end well."""
    robot = robot_of_kind(kind)
    drives = tuple(drive for drive in robot.drives if drive.node_id == robot.drives[0].node_id)
    bench, boot = Bench(robot), NodeBoot(drives[0].node_id, drives, robot)
    frames: list[Frame] = []
    for step in range(round(LIMIT_S / STEP_S)):
        now_s = step * STEP_S
        for frame in bench.tick(now_s):
            frames.append(Frame(frame.cob_id, frame.data))
            boot.on_frame(frames[-1], now_s)
        for sent in boot.tick(now_s):
            frames.append(sent)
            bench.on_frame(BenchFrame(sent.cob_id, sent.data), now_s)
        if boot.done:
            break
    assert boot.report is not None, boot.error or boot.waiting_for
    return BootRecord(robot, drives, tuple(_steps(frames, boot.node_id)), boot.report)


def _steps(frames: list[Frame], node_id: int) -> Iterator[Written | NmtCommand]:
    """NMT commands to the node, and the writes that it confirmed: the boot repeats one without an answer."""
    request = b""
    for frame in frames:
        if frame.cob_id == _NMT and frame.data[1] == node_id:
            yield NmtCommand(frame.data[0])
        elif frame.cob_id == _TO_DRIVE + node_id:
            request = frame.data
        elif frame.cob_id == _FROM_DRIVE + node_id and _specifier(frame.data) == _DONE:
            assert _specifier(request) == _DOWNLOAD, "segmented writes are none of a boot's"
            size = 4 - (request[0] >> 2 & 3)
            value = int.from_bytes(request[4 : 4 + size], "little")
            yield Written(int.from_bytes(request[1:3], "little"), request[3], value, size)


def _specifier(data: bytes) -> int:
    return data[0] & 0xE0
