"""Runs in virtual time: the same batch gives the same outcomes, and what is measured is what the plant did."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import pytest

from canbase_campaign.cruise import Cruise, Run, RunError
from canbase_campaign.twins import JOYSTICK
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_config.stopping import ramp
from canbase_qualification import runs
from canbase_qualification.job import FAILURES, Batch, Load
from canbase_qualification.outcome import DRIVING, SCENARIO, STOP, Outcome
from canbase_qualification.qualification import check_trial, job_of
from canbase_qualification.simulated_robot import UnfitError

pytestmark = pytest.mark.timeout(300)
ROBOT = load_robot(sample("bench")).robot
JOB, _ = job_of(ROBOT, Load())
PLACES = {failure.key: place for place, failure in enumerate(FAILURES)}


@cache
def stop(what: str, how: str, body: int = 0) -> Outcome:
    (outcome,) = runs.run(JOB, Batch(STOP, body, (body * len(FAILURES) + PLACES[what, how],)))
    return outcome


def test_an_ordinary_stop_takes_the_ramp_of_the_limits_and_a_little_more() -> None:
    (measured,) = stop("", "").stops
    assert (measured.fault, measured.cause) == ("", "")
    assert measured.speed_mps == pytest.approx(0.8, abs=0.01)
    ideal = ramp(ROBOT.limits, 0.8)
    assert ideal.time_s - 0.05 <= measured.time_s <= ideal.time_s + 0.2
    assert ideal.distance_m <= measured.way_m <= ideal.distance_m + 0.1


def test_a_failure_has_its_name_who_stopped_the_base_and_when_the_power_was_off() -> None:
    outcome = stop("motor_driver", "SIGKILL")
    (measured,) = outcome.stops
    assert outcome.faults == (measured.fault,) == ("motor_driver: SIGKILL",)
    assert measured.cause == "watchdog: driver silent"
    assert measured.power_off_s < 1.0
    assert outcome.violations == ()
    assert outcome.robot.startswith("16 kg × 0.50")


def test_a_goal_drives_where_a_joystick_would_not_be_stopped() -> None:
    (measured,) = stop("drive_distance_server", "SIGKILL").stops
    assert measured.speed_mps == pytest.approx(ROBOT.action.max_speed_mps, abs=0.01)


def test_a_stop_is_the_same_alone_and_in_a_row_and_another_one_with_another_body() -> None:
    row = (PLACES["drive", "in fault"], PLACES["motor_driver", "SIGKILL"])
    together = list(runs.run(JOB, Batch(STOP, 0, row)))
    assert together[1] == stop("motor_driver", "SIGKILL")
    assert stop("motor_driver", "SIGKILL", body=1).stops != together[1].stops


def test_scenarios_are_the_same_alone_and_in_a_row() -> None:
    row = list(runs.run(JOB, Batch(SCENARIO, 1, (25, 26, 27))))
    (alone,) = runs.run(JOB, Batch(SCENARIO, 1, (26,)))
    assert alone == row[1]
    assert [outcome.seed for outcome in row] == [25, 26, 27]
    assert all(outcome.faults and outcome.violations == () for outcome in row)
    assert not {name for outcome in row for name in outcome.faults} - set(JOB.faults)


def test_a_base_that_goes_on_is_a_violation_and_where_sto_alone_stops_it_that_is_said() -> None:
    cruise = Cruise(JOYSTICK, 0.8, runs.body(JOB, 0))
    going = Run(math.inf, 6.0, math.inf, 0.8, 0.8)
    cruise.fork = lambda twin, seed: going  # type: ignore[method-assign]
    (violation,) = runs._stop(cruise, FAILURES[3], stop("", "")).violations
    assert (violation.property, violation.detail) == ("stops", "it did not come to a stand from 0.80 m/s")
    drives = tuple(drive.model_copy(update={"profile": "tmcm1636"}) for drive in ROBOT.drives)
    cruise.world.robot = ROBOT.model_copy(update={"drives": drives})
    assert "STO" in runs._stop(cruise, FAILURES[3], stop("", "")).violations[0].detail


def test_a_run_that_raises_is_a_violation_with_its_traceback() -> None:
    def raises(*_: object) -> Run:
        raise RunError("Traceback …\nKeyError: 7")

    cruise = Cruise(JOYSTICK, 0.8, runs.body(JOB, 0))
    cruise.fork = raises  # type: ignore[method-assign, assignment]
    (violation,) = runs._stop(cruise, FAILURES[3], stop("", "")).violations
    assert violation.property == "exception"
    assert "KeyError: 7" in violation.detail


def test_a_drive_without_a_failure_has_the_ages_of_what_timeouts_watch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runs, "DRIVES_S", 8.0)
    (outcome,) = runs.run(JOB, Batch(DRIVING, 3, (3,)))
    assert outcome.violations == ()
    ages = {age.key.removeprefix("timeouts."): age for age in outcome.ages}
    assert set(ages) == {"lease_s", "command_s", "odometry_s", "feedback_s", "drive_heartbeat_s", "watchdog_s"}
    for key, age in ages.items():
        assert age.limit_s == getattr(ROBOT.timeouts, key)
        assert 0.0 < age.longest_s < age.limit_s
    assert outcome.virtual_s > 8.0


def test_timeouts_that_are_too_short_stop_a_robot_with_which_nothing_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runs, "DRIVES_S", 20.0)
    timeouts = ROBOT.timeouts.model_copy(update={"watchdog_s": 0.04})
    job, _ = job_of(ROBOT.model_copy(update={"timeouts": timeouts}), Load())
    (outcome,) = runs.run(job, Batch(DRIVING, 3, (3,)))
    assert [violation.property for violation in outcome.violations] == ["undisturbed"]
    assert "watchdog missing" in outcome.violations[0].detail


def test_the_trial_reports_the_speed_and_why_it_is_no_higher() -> None:
    speed_mps, why = runs.trial(JOB, 0)
    assert (round(speed_mps, 2), why) == (0.8, "")
    ceiling = {"linear_mps": 0.3, "angular_radps": 1.0, "acceleration_mps2": 1.0, "angular_acceleration_radps2": 4.0}
    values = ROBOT.model_dump(mode="json")
    values["safety"]["ceiling"] = ceiling
    job = replace(JOB, robot=Robot.model_validate(values))
    speed_mps, why = runs.trial(job, 0)
    assert round(speed_mps, 2) == 0.3
    (sentence,) = check_trial(job, speed_mps, why)
    assert "from 0.30 m/s" in sentence
    assert "ceiling" in sentence


def test_a_base_that_does_not_drive_cannot_be_measured() -> None:
    assert check_trial(JOB, 0.8, "") == ()
    with pytest.raises(UnfitError, match=r"does not drive when its joystick orders 0\.8 m/s"):
        check_trial(JOB, 0.0, "no scan")
