"""Which drives the evidence is about: 1018h as robot.yaml expects it, and as a scan of the bus has read it. Pure.

The driver boots no drive whose identity differs from the one in robot.yaml.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from canbase_config.robot import Robot
from canbase_evidence.standing import Finding, Part, Standing

KEYS: Final = ("vendor_id", "product_code", "revision", "serial")
"""1018h:1 to 4."""
Numbers = tuple[int | None, int | None, int | None, int | None]
_CURE: Final = "canbase setup commission writes identity into robot.yaml"


class ScanError(ValueError):
    """The text is not what `canbase bus scan --json` prints."""


@dataclass(frozen=True, slots=True)
class NodeIdentity:
    """One CANopen node of robot.yaml."""

    node_id: int
    joints: str
    profile: str
    expected: Numbers
    read: Numbers | None
    """By a scan; None: there was none, or the node did not answer."""

    @property
    def differs(self) -> bool:
        """Whether a number that was read is not the expected one."""
        pairs = zip(self.expected, self.read or self.expected, strict=True)
        return any(expected is not None and expected != read for expected, read in pairs)


def node_identities(robot: Robot, scan: Sequence[Mapping[str, Any]] | None) -> tuple[NodeIdentity, ...]:
    """`scan`: the rows of `canbase bus scan --json`; None: no scan was given. Raises ScanError."""
    read = {} if scan is None else _read(scan)
    return tuple(
        NodeIdentity(
            node_id,
            ", ".join(drive.joint for drive in robot.drives if drive.node_id == node_id),
            next(drive.kind.title for drive in robot.drives if drive.node_id == node_id),
            expected_of(robot, node_id),
            read.get(node_id),
        )
        for node_id in sorted({drive.node_id for drive in robot.drives})
    )


def expected_of(robot: Robot, node_id: int) -> Numbers:
    """What `identity` of the node's axes in robot.yaml says; None: nothing."""
    identities = [drive.identity for drive in robot.drives if drive.node_id == node_id]
    a, b, c, d = (next((n for each in identities if (n := getattr(each, key)) is not None), None) for key in KEYS)
    return a, b, c, d


def findings(nodes: Iterable[NodeIdentity], scanned: bool) -> tuple[Finding, ...]:
    """One sentence for each node that is not fully known, and one for all others."""
    found = [_finding(node, scanned) for node in nodes]
    fine = [each.sentence for each in found if each.standing.counts]
    whole = [Finding(Part.DRIVES, Standing.PRESENT, " ".join(fine))] if fine else []
    return (*(each for each in found if not each.standing.counts), *whole)


def words(numbers: Numbers | None) -> str:
    """vendor:product:revision:serial, hexadecimal as in `canbase bus scan`."""
    return "–" if numbers is None else ":".join("–" if n is None else f"{n:X}" for n in numbers)


def _finding(node: NodeIdentity, scanned: bool) -> Finding:
    name = f"Node {node.node_id} ({node.joints})"
    if node.differs:
        told = f"{name} is {words(node.read)}, and robot.yaml expects {words(node.expected)}: another drive."
        return Finding(
            Part.DRIVES, Standing.OTHER, told, "the drive that was proven, or canbase setup commission again"
        )
    if scanned and node.read is None:
        return Finding(Part.DRIVES, Standing.INCOMPLETE, f"{name} did not answer the scan.", "power, cable, node id")
    missing = [key for key in KEYS if not _is_known(node, key)]
    if len(missing) == len(KEYS):
        return Finding(Part.DRIVES, Standing.MISSING, f"{name}: robot.yaml has no identity.", _CURE)
    if missing:
        told = f"{name}: robot.yaml has no {', '.join(missing)}."
        return Finding(Part.DRIVES, Standing.INCOMPLETE, told, _CURE)
    how = "expected and read from the bus" if scanned else "expected by robot.yaml, and checked at each boot"
    return Finding(Part.DRIVES, Standing.PRESENT, f"{name}: {words(node.expected)}, {how}.")


def _is_known(node: NodeIdentity, key: str) -> bool:
    """Whether robot.yaml has the number, or the drive has been read and has none."""
    at = KEYS.index(key)
    return node.expected[at] is not None or (node.read is not None and node.read[at] is None)


def _read(scan: Sequence[Mapping[str, Any]]) -> dict[int, Numbers]:
    try:
        rows = {int(row["node_id"]): tuple(row[key] for key in KEYS) for row in scan}
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ScanError("it is not what canbase bus scan --json prints") from error
    return {node_id: (a, b, c, d) for node_id, (a, b, c, d) in rows.items() if any(n is not None for n in (a, b, c, d))}
