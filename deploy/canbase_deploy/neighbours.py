"""What the robots on one computer must not share: a CAN bus, a lease socket, a file with two contents. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import PurePosixPath

from canbase_config.robot import Robot
from canbase_deploy.owner import place


@dataclass(frozen=True, slots=True)
class Neighbour:
    """A robot that is installed: its name there, its robot.yaml, and the texts of the files that this one names."""

    name: str
    robot: Robot
    files: Mapping[str, str]


def clash(name: str, robot: Robot, files: Mapping[str, str], other: Neighbour) -> str:
    """Why `robot`, installed as `name` with these files, could not run beside `other`, and what to do; empty: it could.

    Both are started at boot: two drivers on one bus give the drives two masters.
    """
    renamed = (
        f"`sudo canbase uninstall {other.name}` first if it is this one under its old name, else give this one another"
    )
    has = f"the robot {other.name} is installed and has"
    theirs = other.robot
    if (theirs.bus.interface, theirs.bus.channel) == (robot.bus.interface, robot.bus.channel):
        return f"{has} {robot.bus.channel} too, two drivers on one bus after boot: {renamed} bus.channel"
    if PurePosixPath(theirs.lease.socket) == PurePosixPath(robot.lease.socket):
        return f"{has} the lease.socket {robot.lease.socket} too: {renamed} one, /run/canbase/{name}/lease.sock"
    placed = {place(reference): text for reference, text in other.files.items()}
    for reference, text in files.items():
        if placed.get(place(reference), text) != text:
            return f"{has} another file as {place(reference)}: {renamed} name for it, such as {name}/{reference}"
    return ""
