"""What is printed at the end: the longest stops, each violation with the command that tells it."""

from __future__ import annotations

import math

from canbase_qualification.job import Load
from canbase_qualification.outcome import DRIVING, SCENARIO, STOP, MeasuredStop, Outcome, Violation
from canbase_qualification.tally import Tally, command, lines


def stop(seed: int, fault: str, way_m: float, time_s: float = 0.5, cause: str = "") -> Outcome:
    measured = MeasuredStop(fault, cause, 0.8, time_s, way_m, math.inf)
    return Outcome(STOP, seed, "", 1.0, 0.0, (fault,), stops=(measured,))


def told(*outcomes: Outcome, load: Load | None = None) -> str:
    tally = Tally()
    tally.add(outcomes)
    return "\n".join(lines(tally, "robot.yaml", load or Load()))


def test_of_each_failure_the_longest_stop_counts_and_what_never_stops_is_the_worst() -> None:
    text = told(stop(1, "a", 0.3), stop(2, "a", 0.4, cause="watchdog: lease lost"), stop(3, "b", 0.1, math.inf))
    first, second = text.splitlines()[1:3]
    assert first == "  0.10 m, and it goes on, from 0.80 m/s: b; --stop 3"
    assert second == "  0.40 m, 0.50 s from 0.80 m/s: a (watchdog: lease lost); --stop 2"
    assert "--stop 1" not in text


def test_an_ordinary_stop_has_a_name() -> None:
    assert "from 0.80 m/s: ordinary stop; --stop 0" in told(stop(0, "", 0.3))


def test_without_a_violation_that_is_said_and_what_it_is_worth() -> None:
    assert "Every property held in every run. Simulation, no certificate." in told(stop(1, "a", 0.3))


def test_a_violation_has_the_sentence_of_its_property_and_the_command_that_tells_it() -> None:
    broken = Violation("held", 1.0, "0.2 m/s while watchdog latched")
    scenario = Outcome(SCENARIO, 637, "", 1.0, 0.0, ("driver_dies", "cable_cut"), (broken,))
    text = told(scenario, load=Load((1.0, 3.0), 0.05))
    assert "VIOLATED held, 1 times: after a latched stop" in text
    assert "scenario 637, driver_dies, cable_cut: held: 0.2 m/s while watchdog latched" in text
    assert "canbase prove qualify robot.yaml --scenario 637 --payload 1..3 --slope 0.05" in text
    assert "Every property held" not in text


def test_a_hundred_violations_are_counted_and_ten_are_printed() -> None:
    broken = Violation("stops", 0.0, "it goes on")
    text = told(*(Outcome(STOP, seed, "", 1.0, 0.0, ("x",), (broken,)) for seed in range(100)))
    assert "VIOLATED stops, 100 times: after each single failure the base comes to a stand" in text
    assert text.count("--stop") == 10
    assert "… and 90 more" in text


def test_a_drive_that_was_stopped_has_its_seed_and_its_body() -> None:
    outcome = Outcome(DRIVING, 4, "30 kg × 1", 1.0, 0.0)
    assert command(outcome, "robot.yaml", Load()) == "driving, seed 4: 30 kg × 1"
