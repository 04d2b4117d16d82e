"""The recorded stops of a robot: whether each is of this configuration, of these drives and of this version. Pure.

`canbase explain` and `canbase record replay` read the files themselves.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from canbase_config.fingerprint import configuration_sha256
from canbase_config.robot import Robot
from canbase_evidence.drive_identities import expected_of, words
from canbase_evidence.standing import Finding, Part, Standing

_CURE: Final = "--recordings FOLDER: the folder of the black box, or single .asc files"


@dataclass(frozen=True, slots=True)
class RecordedStop:
    """One stop as its .json file has it. `robot`: None where it has none that can be read."""

    file: str
    at_unix_s: float
    stopped_by: str
    cause: str
    detail: str
    version: str
    """Of canbase."""
    robot: Robot | None
    problem: str = ""
    """Why it cannot be used; empty: it can."""


@dataclass(frozen=True, slots=True)
class JudgedStop:
    """A recorded stop, and what it is worth for this robot. `why`: empty where it counts."""

    stop: RecordedStop
    standing: Standing
    why: str = ""


def judged(stop: RecordedStop, robot: Robot, version: str) -> JudgedStop:
    """`robot`: the one that the evidence is about. `version`: of the canbase that is installed here."""
    if stop.robot is None:
        return JudgedStop(stop, Standing.INCOMPLETE, stop.problem)
    if stop.robot.name != robot.name:
        return JudgedStop(stop, Standing.OTHER, f"of the robot {stop.robot.name}")
    if configuration_sha256(stop.robot) != configuration_sha256(robot):
        return JudgedStop(stop, Standing.OTHER, "of another configuration")
    if other := _other_drive(stop.robot, robot):
        return JudgedStop(stop, Standing.OTHER, other)
    if stop.version != version:
        return JudgedStop(stop, Standing.OTHER, f"of canbase {stop.version or 'unknown'}; this is {version}")
    return JudgedStop(stop, Standing.PRESENT)


def findings(stops: Sequence[JudgedStop]) -> tuple[Finding, ...]:
    """One sentence for each standing."""
    if not stops:
        return (Finding(Part.RECORDINGS, Standing.MISSING, "No recorded stop was given.", _CURE),)
    return tuple(
        _finding(standing, [stop for stop in stops if stop.standing is standing])
        for standing in (Standing.INCOMPLETE, Standing.OTHER, Standing.PRESENT)
        if any(stop.standing is standing for stop in stops)
    )


def _finding(standing: Standing, stops: Sequence[JudgedStop]) -> Finding:
    if standing.counts:
        causes = Counter(stop.stop.cause for stop in stops)
        told = ", ".join(f"{count} {cause}" for cause, count in sorted(causes.items()))
        return Finding(Part.RECORDINGS, standing, f"{len(stops)} recordings of this robot: {told}.")
    reasons = Counter(stop.why for stop in stops)
    told = "; ".join(f"{count} {why}" for why, count in sorted(reasons.items()))
    return Finding(Part.RECORDINGS, standing, f"{len(stops)} recordings do not count: {told}.")


def _other_drive(recorded: Robot, robot: Robot) -> str:
    for node_id in sorted({drive.node_id for drive in robot.drives}):
        then, now = expected_of(recorded, node_id), expected_of(robot, node_id)
        if any(a is not None and b is not None and a != b for a, b in zip(then, now, strict=True)):
            return f"with another drive as node {node_id} ({words(then)})"
    return ""
