"""What commissioning, drives, qualification and recordings are worth for one robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from canbase_config.commissioned import STEPS, mark
from canbase_config.fingerprint import configuration_sha256
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_evidence import commissioning_proof, drive_identities, qualification_report, recorded_stops
from canbase_evidence.drive_identities import ScanError, node_identities
from canbase_evidence.qualification_report import FILES, ThisRobot
from canbase_evidence.recorded_stops import RecordedStop, judged
from canbase_evidence.standing import Standing

BENCH = load_robot(sample("bench")).robot
WIRED = load_robot(sample("example_can0")).robot
IDENTITY = {"vendor_id": 0xFB, "product_code": 0x60500000, "revision": 0x16, "serial": 0x2A}


def with_values(robot: Robot, **values: Any) -> Robot:
    return Robot.model_validate({**robot.model_dump(), **values})


def with_identity(robot: Robot, identity: Mapping[str, int | None]) -> Robot:
    drives = [{**drive, "identity": identity} for drive in robot.model_dump()["drives"]]
    return with_values(robot, drives=drives)


def commissioned(robot: Robot) -> Robot:
    return with_values(robot, commissioned={step: mark(robot, step) for step in STEPS})


def standings(found: tuple[Any, ...]) -> list[Standing]:
    return [each.standing for each in found]


# ---- commissioning


def test_a_robot_that_was_commissioned_as_it_is() -> None:
    (found,) = commissioning_proof.findings(commissioned(WIRED))
    assert found.standing is Standing.PRESENT


def test_a_value_that_was_changed_after_its_step_makes_the_proof_out_of_date() -> None:
    robot = commissioned(WIRED)
    changed = with_values(robot, base={**robot.model_dump()["base"], "track_m": 0.59})
    stale, fine = commissioning_proof.findings(changed)
    assert (stale.standing, fine.standing) == (Standing.STALE, Standing.PRESENT)
    assert "floor" in stale.sentence
    assert "floor" not in fine.sentence
    assert stale.cure == "canbase setup commission --config robot.yaml --steps floor"


def test_steps_that_were_not_done_are_named() -> None:
    robot = with_values(WIRED, commissioned={"directions": mark(WIRED, "directions")})
    missing, fine = commissioning_proof.findings(robot)
    assert missing.standing is Standing.MISSING
    assert missing.cure.endswith("--steps scale,proof,floor")
    assert "directions" in fine.sentence


def test_on_a_bus_without_a_wire_nothing_was_proven() -> None:
    (found,) = commissioning_proof.findings(commissioned(BENCH))
    assert found.standing is Standing.MISSING
    assert {step.standing for step in commissioning_proof.step_proofs(commissioned(BENCH))} == {Standing.MISSING}


# ---- drives


def scan(**changes: int | None) -> list[dict[str, Any]]:
    return [{"node_id": drive.node_id, **IDENTITY, **changes} for drive in WIRED.drives]


def test_identities_in_robot_yaml_are_evidence() -> None:
    nodes = node_identities(with_identity(WIRED, IDENTITY), None)
    (found,) = drive_identities.findings(nodes, scanned=False)
    assert found.standing is Standing.PRESENT
    assert "FB:60500000:16:2A, expected by robot.yaml, and checked at each boot" in found.sentence


def test_without_them_each_node_is_named() -> None:
    found = drive_identities.findings(node_identities(WIRED, None), scanned=False)
    assert standings(found) == [Standing.MISSING] * len({drive.node_id for drive in WIRED.drives})


def test_another_drive_on_the_bus_is_not_the_one_that_was_proven() -> None:
    nodes = node_identities(with_identity(WIRED, IDENTITY), scan(serial=7))
    found = drive_identities.findings(nodes, scanned=True)
    assert set(standings(found)) == {Standing.OTHER}
    assert "is FB:60500000:16:7, and robot.yaml expects FB:60500000:16:2A" in found[0].sentence


def test_a_number_that_the_drive_does_not_have_is_not_missing() -> None:
    robot = with_identity(WIRED, {**IDENTITY, "serial": None})
    unknown = drive_identities.findings(node_identities(robot, None), scanned=False)
    assert set(standings(unknown)) == {Standing.INCOMPLETE}
    read = drive_identities.findings(node_identities(robot, scan(serial=None)), scanned=True)
    assert standings(read) == [Standing.PRESENT]
    unwritten = drive_identities.findings(node_identities(robot, scan()), scanned=True)
    assert set(standings(unwritten)) == {Standing.INCOMPLETE}


def test_a_drive_that_did_not_answer_the_scan() -> None:
    found = drive_identities.findings(node_identities(with_identity(WIRED, IDENTITY), scan()[:1]), scanned=True)
    assert standings(found) == [Standing.INCOMPLETE, Standing.PRESENT]


@pytest.mark.parametrize("row", [{}, {"node_id": 1}, {"node_id": "x", **IDENTITY}])
def test_what_is_no_scan(row: dict[str, Any]) -> None:
    with pytest.raises(ScanError):
        node_identities(WIRED, [row])


# ---- qualification

THIS = ThisRobot("a" * 64, "0.1.0, sources faf80f59bbd2")
REPORT = {
    "configuration_sha256": THIS.sha256,
    "verdict": "No violation in 1000 scenarios.",
    "violations": 0,
    "grade": "passed",
    "versions": {"canbase": THIS.version},
}


@pytest.mark.parametrize(
    ("changes", "standing", "said"),
    [
        ({}, Standing.PRESENT, "Its verdict: No violation in 1000 scenarios."),
        ({"versions": {"canbase": "0.1.0, sources 0123456789ab"}}, Standing.OTHER, "sources 0123456789ab; this is"),
        ({"violations": 3}, Standing.FAILED, "Its verdict"),
        ({"grade": "failed"}, Standing.FAILED, "Its verdict"),
        ({"grade": "incomplete"}, Standing.INCOMPLETE, "Its verdict"),
        ({"grade": None}, Standing.INCOMPLETE, "Its verdict"),
        ({"grade": ["passed"]}, Standing.INCOMPLETE, "Its verdict"),
        ({"violations": None}, Standing.INCOMPLETE, "does not state the number of violations"),
        ({"violations": True}, Standing.INCOMPLETE, "does not state the number of violations"),
        ({"verdict": None}, Standing.INCOMPLETE, "no verdict"),
        ({"configuration_sha256": "b" * 64}, Standing.OTHER, "of another configuration (bbbbbbbbbbbb)"),
        ({"configuration_sha256": None}, Standing.INCOMPLETE, "does not say which configuration"),
        ({"versions": {"canbase": "0.0.9"}}, Standing.OTHER, "made with canbase 0.0.9; this is 0.1.0, sources"),
        ({"versions": []}, Standing.INCOMPLETE, "does not say which configuration"),
    ],
)
def test_a_qualification(changes: dict[str, Any], standing: Standing, said: str) -> None:
    found = qualification_report.finding({**REPORT, **changes}, FILES, THIS)
    assert found.standing is standing
    assert said in found.sentence


def test_a_qualification_that_lacks_files_or_is_not_there() -> None:
    lacks = qualification_report.finding(REPORT, ["report.json", "results.jsonl"], THIS)
    assert lacks.standing is Standing.INCOMPLETE
    assert "Missing: report.html, report.md." in lacks.sentence
    assert qualification_report.finding(None, None, THIS).standing is Standing.MISSING
    assert "has no report.json" in qualification_report.finding(None, [], THIS).sentence
    assert "cannot be read" in qualification_report.finding(None, ["report.json"], THIS).sentence


# ---- recorded stops

STOP = RecordedStop("recordings/stop.asc", 1.0, "watchdog", "watchdog tripped", "", "0.1.0", WIRED)


@pytest.mark.parametrize(
    ("stop", "standing", "why"),
    [
        (STOP, Standing.PRESENT, ""),
        (replace(STOP, robot=commissioned(WIRED)), Standing.PRESENT, ""),
        (replace(STOP, robot=None, problem="without its .json file"), Standing.INCOMPLETE, "without its .json file"),
        (replace(STOP, robot=with_values(WIRED, name="other")), Standing.OTHER, "of the robot other"),
        (
            replace(STOP, robot=with_values(WIRED, limits={**WIRED.model_dump()["limits"], "linear_mps": 0.31})),
            Standing.OTHER,
            "of another configuration",
        ),
        (replace(STOP, version="0.0.9"), Standing.OTHER, "of canbase 0.0.9; this is 0.1.0"),
        (replace(STOP, version=""), Standing.OTHER, "of canbase unknown; this is 0.1.0"),
    ],
)
def test_a_recorded_stop(stop: RecordedStop, standing: Standing, why: str) -> None:
    found = judged(stop, WIRED, "0.1.0")
    assert (found.standing, found.why) == (standing, why)


def test_a_stop_with_another_drive_does_not_count() -> None:
    robot = with_identity(WIRED, IDENTITY)
    then = with_identity(WIRED, {**IDENTITY, "serial": 7})
    assert configuration_sha256(then) == configuration_sha256(robot)
    found = judged(replace(STOP, robot=then), robot, "0.1.0")
    assert found.standing is Standing.OTHER
    assert "with another drive as node" in found.why


def test_the_sentences_about_recordings() -> None:
    stops = [judged(STOP, WIRED, "0.1.0"), judged(STOP, WIRED, "0.2.0")]
    other, counts = recorded_stops.findings(stops)
    assert (other.standing, counts.standing) == (Standing.OTHER, Standing.PRESENT)
    assert counts.sentence == "1 recordings of this robot: 1 watchdog tripped."
    (none,) = recorded_stops.findings([])
    assert none.standing is Standing.MISSING
