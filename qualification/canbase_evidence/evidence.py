"""All that is known about the stops of one robot, as one value: the page and evidence.json are made of it. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from canbase_evidence.commissioning_proof import StepProof
from canbase_evidence.drive_identities import NodeIdentity, words
from canbase_evidence.hazard_results import HazardResult
from canbase_evidence.recorded_stops import JudgedStop
from canbase_evidence.standing import Finding, Part, Standing

FORMAT: Final = 1
BOM: Final = "bom.cdx.json"
"""In the folder: the list of what is installed."""
DISCLAIMER: Final = (
    "This is no certificate and no safety rating. canbase is not a certified safety function: no performance level "
    "(ISO 13849-1) and no SIL (IEC 62061) can be claimed from it. People are protected by STO through a safety relay, "
    "and by the risk assessment of the machine, which this page does not replace.",
    "Simulation is not the robot: body, friction and drives are modelled. Tests show that canbase reacts as stated to "
    "the failures that are listed; they say nothing about failures that are not listed.",
    "The hashes show that files have changed by accident or without care. Whoever can write the folder can also write "
    "the list: keep the hash of SHA256SUMS elsewhere, or sign it.",
)


@dataclass(frozen=True, slots=True)
class Evidence:
    """`files`: name in the folder → SHA-256 in hex, without index.html, evidence.json and the list itself."""

    robot: str
    configuration_sha256: str
    made: str
    """The only value that differs between two runs with the same input: ISO 8601, UTC."""
    findings: tuple[Finding, ...]
    hazards: tuple[HazardResult, ...]
    steps: tuple[StepProof, ...]
    nodes: tuple[NodeIdentity, ...]
    stops: tuple[JudgedStop, ...]
    versions: Mapping[str, str]
    files: Mapping[str, str]

    def of(self, part: Part) -> tuple[Finding, ...]:
        """The findings of one part, what does not count first."""
        found = [each for each in self.findings if each.part is part]
        return tuple(sorted(found, key=lambda each: each.standing.counts))

    @property
    def open(self) -> tuple[Finding, ...]:
        """What is missing, failed or does not belong here, in the order of the page; failures first."""
        found = [each for part in Part for each in self.of(part) if not each.standing.counts]
        return tuple(sorted(found, key=lambda each: each.standing is not Standing.FAILED))

    @property
    def here(self) -> tuple[Finding, ...]:
        """What counts."""
        return tuple(each for part in Part for each in self.of(part) if each.standing.counts)

    @property
    def is_complete(self) -> bool:
        """Whether nothing is missing and nothing has failed."""
        return not self.open


def as_json(evidence: Evidence) -> dict[str, Any]:
    """Plain values for evidence.json."""
    return {
        "format": FORMAT,
        "what_this_is_not": list(DISCLAIMER),
        "robot": evidence.robot,
        "configuration_sha256": evidence.configuration_sha256,
        "made": evidence.made,
        "complete": evidence.is_complete,
        "open": [_finding(each) for each in evidence.open],
        "present": [_finding(each) for each in evidence.here],
        "hazards": [_hazard(each) for each in evidence.hazards],
        "commissioning": [{"step": each.step, "standing": each.standing.value} for each in evidence.steps],
        "drives": [_node(each) for each in evidence.nodes],
        "recordings": [_stop(each) for each in evidence.stops],
        "versions": dict(evidence.versions),
        "files": dict(sorted(evidence.files.items())),
    }


def _finding(finding: Finding) -> dict[str, str]:
    told = {"part": finding.part.value, "standing": finding.standing.value, "sentence": finding.sentence}
    return {**told, "cure": finding.cure} if finding.cure else told


def _hazard(found: HazardResult) -> dict[str, Any]:
    tests = [{"name": each.name, "result": each.result.value, "why": each.why} for each in found.proofs]
    return {"id": found.row.id, "result": found.result.value, "tests": tests}


def _node(node: NodeIdentity) -> dict[str, Any]:
    return {"node_id": node.node_id, "joints": node.joints, "profile": node.profile,
            "expected": words(node.expected), "read": words(node.read)}  # fmt: skip


def _stop(stop: JudgedStop) -> dict[str, Any]:
    told = stop.stop
    return {"file": told.file, "at_unix_s": told.at_unix_s, "stopped_by": told.stopped_by, "cause": told.cause,
            "standing": stop.standing.value, "why": stop.why}  # fmt: skip
