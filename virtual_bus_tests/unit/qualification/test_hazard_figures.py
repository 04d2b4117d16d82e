"""What runs measured is put to the rows of the catalogue of hazards; nothing is left out, and nothing counted twice."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from canbase_qualification.hazard_figures import MOST_VIOLATIONS, HazardFigures, faults_of
from canbase_qualification.outcome import Violation
from support.made_results import (
    ALL_KILLED,
    CATALOGUE,
    KILLED,
    PRESSED,
    STRANGE,
    collected,
    driving,
    made,
    never,
    passed,
    scenario,
    stop,
    stops,
)

ROWS = {row.id: row for row in CATALOGUE.rows}


def row(name: str, figures: tuple[HazardFigures, ...]) -> HazardFigures:
    return next(each for each in figures if each.row.id == name)


def test_a_row_has_its_faults_and_its_rows_of_the_exit_matrix() -> None:
    names = faults_of(ROWS["driver_killed_or_hung"])
    assert {"driver_dies", "motor_driver: SIGKILL", "motor_driver: SIGSTOP"} <= set(names)
    assert len(names) == len(set(names))


def test_known_quantiles_arrive_at_their_row() -> None:
    found = row("driver_killed_or_hung", made(stops(KILLED, 1000)).hazards).stops
    assert found is not None
    assert found.runs == 1000
    assert [found.time_s.quantile(name) for name in ("p50", "p99", "p99.9")] == [0.5, 0.99, 0.999]
    assert found.distance_m.quantile("p99") == pytest.approx(0.099)
    assert (found.slowest.outcome.seed, found.farthest.outcome.seed) == (1000, 1000)


def test_the_worst_time_and_the_worst_distance_may_be_two_runs() -> None:
    found = collected([stop(KILLED, 1, 0.9, 0.1), stop(KILLED, 2, 0.5, 0.3)]).figures([KILLED])
    assert found is not None
    assert (found.slowest.outcome.seed, found.farthest.outcome.seed) == (1, 2)


def test_a_base_that_never_stood_has_no_distance() -> None:
    found = collected([*stops(KILLED, 9), never(KILLED, 77)]).figures([KILLED])
    assert found is not None
    assert (found.never, found.farthest.outcome.seed) == (1, 77)
    assert math.isinf(found.distance_m.greatest)
    assert found.farthest_ended is not None
    assert found.farthest_ended.stop.time_s == 1.0


def test_stops_of_several_failures_are_one_row() -> None:
    found = collected([stop(KILLED, 1, 0.2, 0.1), stop(PRESSED, 2, 0.4, 0.05)]).figures([KILLED, PRESSED, "no such"])
    assert found is not None
    assert found.time_s.values == (0.2, 0.4)
    assert found.farthest.outcome.seed == 1
    assert collected([]).figures([KILLED]) is None


def test_runs_of_one_body_are_one_draw() -> None:
    alike = [replace(outcome, robot="60 kg") for outcome in stops(KILLED, 50)]
    found = collected([*alike, *stops(PRESSED, 4, 100)]).figures([KILLED, PRESSED])
    assert found is not None
    assert (found.runs, found.bodies) == (54, 5)
    assert found.covered_share == pytest.approx(0.05 ** (1 / 5))


def test_a_scenario_counts_once_for_a_row_that_two_of_its_failures_are() -> None:
    outcomes = [scenario(1, "driver_dies", "driver_hangs"), scenario(2, "driver_dies")]
    assert row("driver_killed_or_hung", made(outcomes).hazards).scenarios == 2


def test_a_violation_is_counted_for_every_failure_that_took_part() -> None:
    held = Violation("held", 0.71, "0.1 m/s while watchdog latched")
    report = made([scenario(7, "driver_dies", "cable_cut", violations=(held,)), scenario(8, "driver_dies")])
    assert row("driver_killed_or_hung", report.hazards).violated == 1
    assert row("cable_cut", report.hazards).violated == 1
    assert row("drive_fault", report.hazards).violated == 0
    assert report.collected.properties == {"held": 1}
    assert report.collected.violations[0].outcome.seed == 7


def test_all_violations_are_counted_and_some_are_kept() -> None:
    held = Violation("held", 0.71, "too fast")
    found = collected(scenario(seed, f"fault {seed}", violations=(held,)) for seed in range(MOST_VIOLATIONS + 5))
    assert found.properties["held"] == MOST_VIOLATIONS + 5
    assert (len(found.violations), found.violated) == (MOST_VIOLATIONS, MOST_VIOLATIONS + 5)


def test_many_alike_hide_no_other_one() -> None:
    held, stopped = Violation("held", 0.71, "too fast"), Violation("stops", 0.0, "goes on")
    many = [replace(never(KILLED, seed), violations=(stopped,)) for seed in range(3 * MOST_VIOLATIONS)]
    found = collected([*many, scenario(7, "driver_dies", violations=(held,))])
    assert [(each.violation.property, each.runs) for each in found.violations] == [("stops", 300), ("held", 1)]
    assert found.violations[0].outcome.seed == 0
    assert found.never_stood == [KILLED]


def test_rows_without_a_run_are_kept() -> None:
    report = made(passed())
    assert len(report.hazards) == len(ROWS)
    names = {figures.row.id for figures in report.uncovered}
    assert "text_from_outside" in names
    assert not names & {"driver_killed_or_hung", "estop_pressed", "cable_cut"}


UNLISTED = "of a later version"


def test_failures_that_no_row_names_are_told() -> None:
    report = made([stop(STRANGE, 1, 0.5, 0.1), scenario(2, UNLISTED), stop("", 3, 0.4, 0.1)])
    assert [name for name, _ in report.unlisted] == [STRANGE, UNLISTED]
    assert dict(report.unlisted)[UNLISTED] is None


def test_the_longest_age_of_all_runs_counts() -> None:
    found = collected([driving(0, lease_s=0.05), driving(1, lease_s=0.08), driving(2, lease_s=0.06)])
    assert found.ages["timeouts.lease_s"].longest_s == 0.08
    assert found.driving_s == 180.0


def test_spans_of_payload_slope_and_seeds() -> None:
    found = collected([scenario(9), scenario(4), driving(3), stop(ALL_KILLED, 12, 0.5, 0.1)])
    assert (found.payloads, found.slopes) == ((0.5, 1.5), (-0.03, 0.03))
    assert found.seeds == {"scenario": (4, 9), "driving": (3, 3), "stop": (12, 12)}
