"""What robots on one computer must not share: bus, lease socket, name, place in ROS, a file with two contents. Pure."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from typing import Final

from canbase_config.robot import Robot
from canbase_deploy.owner import owner_paths, place

DOMAIN: Final = "0"
"""ROS_DOMAIN_ID where nobody has chosen one: what ROS 2 takes then."""
_NAMESPACE: Final = re.compile(r"(?:^|\s)(?:--namespace|-n)[\s=]+(\S+)")
_REMAPPED: Final = re.compile(r"__ns:=(\S+)")


@dataclass(frozen=True, slots=True)
class Neighbour:
    """A robot on this computer: the name that it is installed by, its robot.yaml, the texts of the files that this one
    names, and what the environment file of its services sets."""

    name: str
    robot: Robot
    files: Mapping[str, str]
    environment: Mapping[str, str] = field(default_factory=dict)


def namespace(environment: Mapping[str, str]) -> str:
    """Where the services' nodes are by CANBASE_OPTIONS and CANBASE_ROS_ARGS, such as "/robot2"; "/": in none."""
    by_option = _NAMESPACE.search(environment.get("CANBASE_OPTIONS", ""))
    found = by_option or _REMAPPED.search(environment.get("CANBASE_ROS_ARGS", ""))
    return f"/{found[1].strip('/')}" if found else "/"


def clash(own: Neighbour, other: Neighbour) -> str:
    """Why `own` could not run beside `other`, and what to do; empty: it could.

    Both are started at boot: two drivers on one bus give the drives two masters, and two robots in one namespace follow
    the same commands.
    """
    name, robot, theirs = own.name, own.robot, other.robot
    renamed = (
        f"`sudo canbase setup uninstall {other.name}` first if it is this one under its old name, "
        f"else give this one another"
    )
    has = f"the robot {other.name} is installed and has"
    if (theirs.bus.interface, theirs.bus.channel) == (robot.bus.interface, robot.bus.channel):
        return f"{has} {robot.bus.channel} too, two drivers on one bus after boot: {renamed} bus.channel"
    if PurePosixPath(theirs.lease.socket) == PurePosixPath(robot.lease.socket):
        return f"{has} the lease.socket {robot.lease.socket} too: {renamed} one, /run/canbase/{name}/lease.sock"
    if theirs.name == robot.name:
        files = f"{owner_paths(other.name)[0]} and the one for {owner_paths(name)[0]}"
        return f"{has} name: {robot.name} too, in {files}, so their recordings would be mixed up: {renamed} name"
    if wrong := _same_place(own, other):
        return f"{has} {wrong}"
    placed = {place(reference): text for reference, text in other.files.items()}
    for reference, text in own.files.items():
        if placed.get(place(reference), text) != text:
            return f"{has} another file as {place(reference)}: {renamed} name for it, such as {name}/{reference}"
    return ""


def _same_place(own: Neighbour, other: Neighbour) -> str:
    domains = {each.environment.get("ROS_DOMAIN_ID") or DOMAIN for each in (own, other)}
    if len(domains) > 1 or namespace(own.environment) != namespace(other.environment):
        return ""
    return (
        f"ROS_DOMAIN_ID={domains.pop()} and the namespace {namespace(own.environment)} too, so both would follow the "
        f"same commands: give this one --namespace {own.name}, or CANBASE_OPTIONS=--namespace {own.name} in "
        f"{owner_paths(own.name)[1]} if that file is there"
    )
