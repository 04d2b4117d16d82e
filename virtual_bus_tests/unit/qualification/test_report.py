"""The verdict of a qualification: one sentence that never says more than was measured."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest

from canbase_qualification.outcome import Violation
from canbase_qualification.report import Report
from canbase_qualification.report_first import NO_CERTIFICATE
from canbase_qualification.report_json import as_json
from canbase_qualification.report_sections import sections
from canbase_qualification.report_words import told_by
from canbase_qualification.sections import Section, Table
from canbase_qualification.verdict import Grade
from support.made_results import (
    ALL_KILLED,
    CATALOGUE,
    KILLED,
    STRANGE,
    driving,
    made,
    never,
    passed,
    scenario,
    setup,
    stops,
)

HELD = Violation("held", 0.71, "0.1 m/s while watchdog latched")


def section(report: Report, key: str) -> Section:
    return next(each for each in sections(report) if each.key == key)


def table(report: Report, key: str, number: int = 0) -> Table:
    return section(report, key).tables[number]


def test_all_is_well() -> None:
    report = made(passed(), asked={"stop": 1135, "scenario": 30, "driving": 2})
    assert report.grade is Grade.PASSED
    assert report.verdict == (
        "No violation in 1,135 stops, 30 scenarios and 2 runs without a failure of bench: every measured stop ended in "
        "standstill, at most 1.00 s and 0.10 m after the failure."
    )


def test_without_a_stop_none_is_said_to_have_ended() -> None:
    report = made([scenario(0, "driver_dies")], asked={"scenario": 1})
    assert report.verdict == "No violation in 1 scenario of bench: no stop was measured."


def test_one_violation_is_enough() -> None:
    report = made([*passed(), scenario(7, "driver_dies", violations=(HELD,))])
    assert report.grade is Grade.FAILED
    assert "NOT PASSED: properties did not hold (held 1)" in report.verdict


def test_one_base_that_never_stood_is_enough() -> None:
    report = made([*passed(), never(ALL_KILLED, 9)])
    assert report.grade is Grade.FAILED
    assert f"1 of 1,136 stops did not end in standstill ({ALL_KILLED})" in report.verdict


def test_nothing_is_not_passed() -> None:
    report = made([])
    assert (report.grade, report.verdict) == (Grade.INCOMPLETE, "Nothing was measured: there is no result of any run.")
    assert sections(report)


@pytest.mark.parametrize("kind", ["stop", "scenario", "driving"])
def test_a_campaign_that_was_broken_off_is_incomplete(kind: str) -> None:
    report = made(passed(), asked={"stop": 1135, "scenario": 30, "driving": 2} | {kind: 5000})
    assert report.grade is Grade.INCOMPLETE
    assert "of 5,000" in report.verdict


def test_a_problem_of_the_results_is_not_passed() -> None:
    report = made(passed(), problems=("results.jsonl ends in the middle of a line",))
    assert report.grade is Grade.INCOMPLETE
    assert "middle of a line" in report.verdict


def test_the_first_screen_says_what_it_is_not() -> None:
    first = sections(made(passed()))[0]
    assert NO_CERTIFICATE in first.paragraphs
    assert any(f"{len(CATALOGUE.rows)} rows" in item for item in first.items)
    assert any("more_scans" in item for item in first.items)
    assert any("stop button" in fact for fact in first.facts)
    assert ("payload", "0.5 to 1.5 × the empty robot's mass") in first.tables[1].rows


def test_few_runs_are_told_on_the_first_screen() -> None:
    few = sections(made(stops(KILLED, 20)))[0].paragraphs[1]
    assert "with 20 drawn bodies only" in few
    assert "values cover 86.0 %" in few
    assert "`--stops 299`" in few
    assert not any("Few runs" in text for text in sections(made(stops(KILLED, 299)))[0].paragraphs)


def test_each_hazard_with_stops_has_its_line_and_its_command() -> None:
    rows = {row[0]: row for row in table(made(passed()), "stops").rows}
    killed = rows["driver killed or hung: motor_driver is killed or hangs."]
    assert killed[1:7] == ("1,000", "0.30 s", "0.50 s", "0.99 s", "1.00 s", "1.00 s")
    assert killed[11] == "99.7 %"
    assert killed[-1] == "`canbase prove qualify robot.yaml --stop 1000`"
    assert rows[f"{STRANGE} (no row of the catalogue)"][1] == "5"
    assert rows["Ordinary stop: zero is commanded, nothing fails."][1] == "10"


def test_few_runs_say_how_many_a_quantile_needs() -> None:
    row = table(made(stops(KILLED, 100)), "stops").rows[0]
    assert row[3:6] == ("0.50 s", "0.99 s", "— (needs 1,000)")


def test_never_is_a_word() -> None:
    row = table(made([*stops(KILLED, 9), never(KILLED, 77)]), "stops").rows[0]
    assert row[1] == "10, 1 never"
    assert (row[6], row[10]) == ("never", "never")


def test_rows_without_a_run_are_listed_with_their_part() -> None:
    report = made(passed())
    rows = table(report, "uncovered").rows
    assert len(rows) == len(report.uncovered)
    assert {row[0] for row in rows} == {"A process", "Bus and drives", "The computer", "ROS", "Operators", "Access"}


def test_a_violation_has_its_command() -> None:
    report = made([scenario(7, "driver_dies", violations=(HELD,))])
    row = table(report, "violations", 1).rows[0]
    assert row[:5] == ("held", "1", "0.71 s", HELD.detail, "driver dies")
    assert row[-1] == "`canbase prove qualify robot.yaml --scenario 7`"


def test_a_file_name_with_spaces_is_quoted() -> None:
    assert (
        told_by(setup(robot_file="my robot.yaml"), scenario(7))
        == "`canbase prove qualify 'my robot.yaml' --scenario 7`"
    )


def test_a_robot_that_needs_no_scan_has_no_bound() -> None:
    assert not any(scan.required for scan in setup().robot.safety.scans)
    assert any("No scanner is required" in text for text in section(made(passed()), "distance").paragraphs)


def test_stops_that_never_ended_are_told_beside_the_sums() -> None:
    report = made([*passed(), never(ALL_KILLED, 9)])
    assert any("1 stops never ended" in text for text in section(report, "distance").paragraphs)
    assert any("1 stops never ended" in value for _, value in table(report, "verdict").rows)


def test_no_false_stop_in_a_short_time_is_little() -> None:
    assert "fewer than 90 false stops an hour" in section(made(passed()), "timeouts").paragraphs[0]
    trip = replace(driving(5, lease_s=0.05), violations=(Violation("undisturbed", 3.0, "driver: latched"),))
    assert "1 of these runs were stopped" in section(made([*passed(), trip]), "timeouts").paragraphs[0]


def test_timeouts_the_tightest_first() -> None:
    rows = table(made(passed()), "timeouts").rows
    assert [row[0] for row in rows] == ["`timeouts.lease_s`", "`timeouts.feedback_s`"]
    assert rows[0][1:] == ("0.25 s", "0.081 s", "0.169 s", "0.10 s")


def test_json_has_what_programs_need() -> None:
    found: dict[str, Any] = as_json(made([*passed(), never(ALL_KILLED, 9)]))
    json.dumps(found, allow_nan=False)
    assert (found["passed"], found["violations"], found["scenarios"], found["certificate"]) == (False, 0, 30, False)
    assert found["configuration_sha256"] == "ab" * 32
    killed = next(row for row in found["hazards"] if row["id"] == "driver_killed_or_hung")
    assert killed["stops"]["time_s"] == {"p50": 0.5, "p99": 0.99, "p99.9": 0.999, "max": 1.0, "runs_needed": {}}
    assert found["masters_die"][ALL_KILLED]["distance_m"]["max"] is None
    assert found["without_a_row"][STRANGE]["time_s"]["runs_needed"] == {"p99": 100, "p99.9": 1000}
