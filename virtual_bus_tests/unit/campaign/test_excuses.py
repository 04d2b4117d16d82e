"""What counts as excused, and for how long: at the limits of each use. Times in s, one step of the judge is 0.01 s."""

from __future__ import annotations

import math

import pytest

from canbase_campaign.allowance import Active, Allowance, is_late
from canbase_campaign.excuses import EXCUSES, STEP_S, Ledger

ROW = "late ramp"
"""One use of it may last for 1 s."""


def uses(ledger: Ledger, steps: range, moves: bool = True) -> list[bool]:
    """Whether each use in these steps is allowed."""
    allowed = []
    for step in steps:
        ledger.step(moves, step * STEP_S)
        allowed.append(ledger.excuse("held", ROW))
    return allowed


def test_a_use_is_allowed_for_as_long_as_its_row_says_and_no_longer() -> None:
    allowed = uses(Ledger(), range(103))
    assert EXCUSES[ROW].longest_s == 1.0
    assert allowed[:100] == [True] * 100
    assert allowed[102] is False


@pytest.mark.parametrize(("pause", "counts_on"), [(1, True), (2, True), (3, False), (10, False)])
def test_a_pause_of_more_than_two_steps_begins_a_use_anew(pause: int, counts_on: bool) -> None:
    ledger = Ledger()
    uses(ledger, range(90))
    assert all(uses(ledger, range(89 + pause, 130))) is not counts_on


def test_seconds_count_once_a_step_and_in_motion_alone() -> None:
    ledger = Ledger()
    for step in range(10):
        ledger.step(step < 6, step * STEP_S)
        ledger.excuse("held", ROW)
        ledger.excuse("held", ROW)
    assert ledger.moving_s == pytest.approx(0.06)
    assert ledger.excused_s == {("held", ROW): pytest.approx(0.06)}


def test_seconds_that_are_known_later_are_added() -> None:
    ledger = Ledger()
    ledger.add("odometry", "unread", 0.0)
    ledger.add("odometry", "unread", 0.25)
    ledger.add("odometry", "unread", 0.5)
    assert ledger.excused_s == {("odometry", "unread"): 0.75}


@pytest.mark.parametrize(("over_s", "late", "row"), [
    (-0.01, False, ""), (0.0, False, ""), (0.001, False, "one fault"), (0.3, False, "one fault"),
    (0.301, False, "rolls out"), (0.8, False, "rolls out"), (0.801, True, ""),
])  # fmt: skip
def test_what_is_late_needs_the_first_rows_that_give_enough(over_s: float, late: bool, row: str) -> None:
    ledger = Ledger()
    ledger.step(True, 1.0)
    assert is_late("short", ledger, over_s, [("one fault", 0.3), ("late ramp", 0.0), ("rolls out", 0.5)]) is late
    assert [name for _, name in ledger.excused_s] == ([row] if row else [])


@pytest.mark.parametrize(("lasts", "lost", "second_s", "row"), [
    (9, False, 0.0, ""), (10, False, 0.0, ""), (20, False, 0.1, "second fault"), (50, True, 0.0, "unreachable"),
])  # fmt: skip
def test_the_first_row_that_allows_a_speed_is_counted(lasts: int, lost: bool, second_s: float, row: str) -> None:
    """0.1 s of reaction; the base has τ = 0.5 s for so many steps, and nothing is ordered."""
    ledger, active = Ledger(), Active(lost=lost, second_fault_s=second_s)
    allowance = Allowance("envelope", ledger, 0.1, 0.0, 0.2)
    for step in range(lasts + 1):
        ledger.step(True, step * STEP_S)
        assert allowance.bound_s(0.5, step * STEP_S, active) >= 0.5
    assert {name for _, name in ledger.excused_s} == ({row} if row else set())


def test_without_an_excuse_the_speed_is_too_high_one_step_after_the_reaction() -> None:
    ledger = Ledger()
    allowance = Allowance("envelope", ledger, 0.1, 0.0, 0.2)
    broken = []
    for step in range(15):
        ledger.step(True, step * STEP_S)
        broken.append(allowance.bound_s(0.5, step * STEP_S, Active()) < 0.5)
    assert broken.index(True) == 11
    assert ledger.excused_s == {}


@pytest.mark.parametrize(("coasts", "tau_s", "holds"), [
    (True, 0.29, True), (True, 0.31, False), (False, 0.29, False),
])  # fmt: skip
def test_the_driven_side_turns_the_base_about_one_without_power(coasts: bool, tau_s: float, holds: bool) -> None:
    """0.2 s are ordered straight on for 0.5 s, of which the turn about one side takes 1.5 times as much."""
    ledger = Ledger()
    allowance = Allowance("envelope", ledger, 0.1, 0.0, 0.2, pivot=1.5)
    within = []
    for step in range(50):
        ledger.step(True, step * STEP_S)
        allowance.order(0.2, step * STEP_S)
        within.append(tau_s <= allowance.bound_s(tau_s, step * STEP_S, Active(coasting=coasts)))
    assert within[-1] is holds
    assert bool(ledger.excused_s) is coasts


def test_each_row_has_a_reason_and_a_duration() -> None:
    for excuse in EXCUSES.values():
        assert len(excuse.reason) > 30
        assert excuse.longest_s > 0.0
    endless = [name for name, excuse in EXCUSES.items() if math.isinf(excuse.longest_s)]
    assert len(endless) < len(EXCUSES) / 2
