"""What `report.json` of `canbase prove qualify` says, and whether it is about this robot and this canbase. Pure.

The files of a qualification are taken as they are: only verdict, number of violations, configuration and version of
report.json are read.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Final

from canbase_evidence.standing import Finding, Part, Standing

REPORT: Final = "report.json"
FILES: Final = (REPORT, "report.html", "report.md", "results.jsonl")
ALL_FILES: Final = (*FILES, "qualification.json", "robot.yaml")
"""Those that are copied where they are there; without one of FILES it is incomplete."""
PASSED, FAILED = "passed", "failed"
_GRADES: Final[Mapping[str, Standing]] = {PASSED: Standing.PRESENT, FAILED: Standing.FAILED}
"""`grade` of report.json; any other one has proven nothing."""
_CURE: Final = "canbase prove qualify robot.yaml --output FOLDER; then --qualification FOLDER"


@dataclass(frozen=True, slots=True)
class ThisRobot:
    """What a qualification must have been made with."""

    sha256: str
    """canbase_config.fingerprint."""
    version: str
    """Of canbase, with the mark of its sources, as report.json has it."""


def finding(report: Mapping[str, Any] | None, files: Collection[str] | None, this: ThisRobot) -> Finding:
    """`files`: those of FILES that are there; None: no folder was given. `report`: None where it cannot be read."""
    if files is None:
        return Finding(Part.QUALIFICATION, Standing.MISSING, "No qualification was given.", _CURE)
    missing = [name for name in FILES if name not in files]
    if report is None:
        why = f"has no {REPORT}" if REPORT in missing else f"has a {REPORT} that cannot be read"
        return Finding(Part.QUALIFICATION, Standing.INCOMPLETE, f"The qualification {why}.", _CURE)
    standing, sentence = _judged(report, this)
    if standing.counts and missing:
        return Finding(Part.QUALIFICATION, Standing.INCOMPLETE, f"{sentence} Missing: {', '.join(missing)}.", _CURE)
    return Finding(Part.QUALIFICATION, standing, sentence, "" if standing.counts else _CURE)


def _judged(report: Mapping[str, Any], this: ThisRobot) -> tuple[Standing, str]:
    sha256, version = report.get("configuration_sha256"), _version(report)
    if not isinstance(sha256, str) or not version:
        return Standing.INCOMPLETE, f"{REPORT} does not say which configuration and which canbase it is of."
    if sha256 != this.sha256:
        return Standing.OTHER, f"The qualification is of another configuration ({sha256[:12]}), not of this robot.yaml."
    if version != this.version:
        return Standing.OTHER, f"The qualification was made with canbase {version}; this is {this.version}."
    verdict, violations, grade = report.get("verdict"), report.get("violations"), str(report.get("grade"))
    if not isinstance(verdict, str) or isinstance(violations, bool) or not isinstance(violations, int):
        return Standing.INCOMPLETE, f"{REPORT} has no verdict, or does not state the number of violations."
    return _GRADES.get(grade if not violations else FAILED, Standing.INCOMPLETE), f"Its verdict: {verdict}"


def _version(report: Mapping[str, Any]) -> str:
    versions = report.get("versions")
    found = versions.get("canbase") if isinstance(versions, Mapping) else None
    return found if isinstance(found, str) else ""
