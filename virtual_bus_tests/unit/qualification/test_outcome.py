"""Outcomes and their lines: what is written is read again, to the last bit; what is cut off is no outcome."""

from __future__ import annotations

import json
import math

import pytest

from canbase_qualification.outcome import (
    DRIVING,
    SCENARIO,
    STOP,
    Ages,
    BrokenLineError,
    MeasuredStop,
    Outcome,
    Violation,
)

STOPPED = Outcome(
    STOP, 7, "30 kg × 1.5", 1.5, -0.06, ("motor_driver: SIGKILL",), trips=("driver_silent",),
    stops=(MeasuredStop("motor_driver: SIGKILL", "watchdog: driver silent", 0.8, 0.1 + 0.2, 0.21, math.inf, 0.8),),
    virtual_s=3.2, moved_m=2.1,
)  # fmt: skip
FAILED = Outcome(
    SCENARIO, 3, "ä µ", 1.0, 0.0, ("driver_dies", "cable_cut"), (Violation("held", 1.25, "0.1 m/s while “x” latched"),)
)
DROVE = Outcome(DRIVING, 0, "", 1.0, 0.0, ages=(Ages("timeouts.lease_s", 0.06, 0.25),))


@pytest.mark.parametrize("outcome", [STOPPED, FAILED, DROVE])
def test_a_line_gives_the_same_outcome_to_the_last_bit(outcome: Outcome) -> None:
    line = outcome.line()
    assert "\n" not in line
    assert Outcome.of_line(line) == outcome
    assert Outcome.of_line(line).line() == line


def test_a_stop_that_never_came_is_null_which_every_reader_of_json_knows() -> None:
    assert json.loads(STOPPED.line())["stops"][0]["power_off_s"] is None
    assert "Infinity" not in STOPPED.line()


def test_every_part_of_a_line_is_no_outcome() -> None:
    line = STOPPED.line()
    for length in range(len(line)):
        with pytest.raises(BrokenLineError):
            Outcome.of_line(line[:length])


@pytest.mark.parametrize(
    "line", ["null", "[]", "{}", '{"kind": "stop"}', STOPPED.line().replace('"stop"', '"walk"', 1)]
)
def test_json_that_is_no_outcome_is_refused_with_its_begin(line: str) -> None:
    with pytest.raises(BrokenLineError, match="no outcome of a run"):
        Outcome.of_line(line)


def test_stops_come_before_scenarios_and_these_in_the_order_of_their_seeds() -> None:
    assert sorted([DROVE, FAILED, STOPPED], key=lambda each: each.key) == [STOPPED, FAILED, DROVE]
