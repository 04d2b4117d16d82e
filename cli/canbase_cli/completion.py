"""Shell completion by Tab: names from the robot.yaml that is named earlier on the line, or of the robot that is meant.

A robot.yaml that cannot be read proposes nothing: the command itself reports what is wrong in it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from canbase_config.robot import Robot


def joints(ctx: typer.Context, incomplete: str) -> list[tuple[str, str]]:
    """Joint names of the drives, each with its node."""
    robot = _robot(ctx)
    drives = robot.drives if robot else ()
    return [(drive.joint, f"node {drive.node_id}") for drive in drives if drive.joint.startswith(incomplete)]


def node_ids(ctx: typer.Context, incomplete: str) -> list[tuple[str, str]]:
    """Node ids of the drives, each with its joints."""
    robot = _robot(ctx)
    found: dict[str, list[str]] = {}
    for drive in robot.drives if robot else ():
        found.setdefault(str(drive.node_id), []).append(drive.joint)
    return [(node_id, ", ".join(names)) for node_id, names in found.items() if node_id.startswith(incomplete)]


def objects(ctx: typer.Context, incomplete: str) -> list[tuple[str, str]]:
    """Indexes of the EDS that the line names, or of ours, each with the name of its object."""
    from importlib.resources import files

    from canbase_config.eds_file import EdsError, read_eds

    ours = str(files("canbase_config").joinpath("eds/canbase_cia402.eds"))
    try:
        names = read_eds(ctx.params.get("eds") or ours).names
    except EdsError:
        return []
    begun = incomplete.upper()
    return [(f"{index:04X}", name) for index, name in sorted(names.items()) if f"{index:04X}".startswith(begun)]


def node_ids_or_all(ctx: typer.Context, incomplete: str) -> list[tuple[str, str]]:
    """Node ids of the drives, and all of them."""
    found = node_ids(ctx, incomplete)
    return [*found, ("all", "every node")] if "all".startswith(incomplete) else found


def one_more_of(words: tuple[str, ...], incomplete: str) -> list[str]:
    """For a list that is joined by commas: what may follow, without what stands in it."""
    head, comma, begun = incomplete.rpartition(",")
    given = head.split(",")
    return [f"{head}{comma}{word}" for word in words if word.startswith(begun) and word not in given]


def _robot(ctx: typer.Context) -> Robot | None:
    from canbase_config.errors import ConfigError
    from canbase_config.load import load_robot
    from canbase_runtime.which_robot import NoRobotError, which_robot

    try:
        return load_robot(which_robot(ctx.params.get("config")).path).robot
    except (ConfigError, NoRobotError):
        return None
