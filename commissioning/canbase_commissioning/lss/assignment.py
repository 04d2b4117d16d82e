"""Which drive gets which node id: what robot.yaml says, then what was, then the lowest that is free. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from canbase_commissioning.lss.protocol import Identity
from canbase_config.robot import DRIVER_NODE_ID, WATCHDOG_NODE_ID, Robot

MAX_DRIVE_ID = min(DRIVER_NODE_ID, WATCHDOG_NODE_ID) - 1
"""Higher node ids are canbase's own."""


def proposals(found: Sequence[Identity], before: Mapping[int, Identity], robot: Robot | None) -> dict[Identity, int]:
    """A node id for each drive, all different; the drives in the order of their identities.

    1. The drive's serial number is in robot.yaml (`identity.serial`): the node id there.
    2. It had a node id for itself before, `before`, that is one of robot.yaml (or there is no robot.yaml): the same.
    3. The others, by serial number: the lowest node ids of robot.yaml that are free, then the lowest free ones.
    """
    wanted = {drive.node_id for drive in robot.drives} if robot else set()
    node_ids: dict[Identity, int] = {}
    for drive in robot.drives if robot else ():
        named = [one for one in found if drive.identity.serial == one.serial and one not in node_ids]
        if named and drive.node_id not in node_ids.values():
            node_ids[named[0]] = drive.node_id
    for node_id, one in sorted(before.items()):
        fits = (not wanted or node_id in wanted) and 1 <= node_id <= MAX_DRIVE_ID
        if one in found and one not in node_ids and node_id not in node_ids.values() and fits:
            node_ids[one] = node_id
    free = [*sorted(wanted), *range(1, MAX_DRIVE_ID + 1)]
    for one in sorted(found, key=lambda one: one.parts):
        if one not in node_ids:
            node_ids[one] = next(node_id for node_id in free if node_id not in node_ids.values())
    return {one: node_ids[one] for one in sorted(found)}


def check_node_id(taken: Sequence[int]) -> Callable[[str], int]:
    """A check for the answer of a person: a node id that is not `taken` yet."""

    def check(text: str) -> int:
        try:
            node_id = int(text)
        except ValueError as error:
            raise ValueError(f"{text!r} is no whole number") from error
        if not 1 <= node_id <= MAX_DRIVE_ID:
            raise ValueError(
                f"{node_id} is outside 1 to {MAX_DRIVE_ID}; {MAX_DRIVE_ID + 1} and above are canbase's own"
            )
        if node_id in taken:
            raise ValueError(f"another drive has node id {node_id}")
        return node_id

    return check


def too_many(found: Sequence[Identity], robot: Robot | None) -> str:
    """Why not all that was found may get a node id, as a sentence; empty: all may. LSS does not tell a drive from an
    encoder, and what has no node id yet answers nothing else."""
    wanted = len({drive.node_id for drive in robot.drives}) if robot else len(found)
    if len(found) <= wanted:
        return ""
    names = ", ".join(map(str, found))
    return f"robot.yaml has {wanted} nodes, {len(found)} found: {names}. Disconnect what is no drive of this robot"


def too_few(found: Sequence[Identity], robot: Robot | None) -> str:
    """What is missing for the robot, as a sentence; empty: nothing."""
    wanted = len({drive.node_id for drive in robot.drives}) if robot else 0
    if len(found) >= wanted:
        return ""
    return (
        f"robot.yaml has {wanted} nodes, {len(found)} found: power, cable? Two drives whose maker gives them no serial "
        "number look like one: connect one at a time"
    )
