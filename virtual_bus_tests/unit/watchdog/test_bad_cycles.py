"""Bad cycles add up, good ones take back half of one."""

from __future__ import annotations

import pytest

from canbase_watchdog.bad_cycles import BadCycles


def count(pattern: str) -> float:
    cycles = BadCycles()
    for each in pattern:
        cycles.count(each == "x")
    return cycles.value


@pytest.mark.parametrize(
    ("pattern", "value"),
    [("", 0.0), ("x", 1.0), ("xx", 2.0), (".", 0.0), ("x.", 0.5), ("x..", 0.0), ("x...x", 1.0), ("x." * 40, 20.0)],
)
def test_a_bad_cycle_is_one_and_a_good_one_half_of_it_back(pattern: str, value: float) -> None:
    assert count(pattern) == value


# the first drive sends one frame a cycle, with a drift: none, then two; the second is two drives with one node id
@pytest.mark.parametrize(
    ("frames_a_cycle", "value"),
    [
        ([], 0.0),
        ([1], 0.0),
        ([0], 0.0),
        ([2], 1.0),
        ([2, 0], 0.0),
        ([2, 2, 0], 1.0),
        ([2, 1], 0.5),
        ([2, 1, 0], 0.0),
        ([3, 2], 2.0),
    ],
)
def test_two_frames_in_a_cycle_and_none_in_another_make_up_for_each_other(
    frames_a_cycle: list[int], value: float
) -> None:
    cycles = BadCycles()
    for frames in frames_a_cycle:
        cycles.balance(frames)
    assert cycles.value == value


@pytest.mark.parametrize(("pattern", "value"), [("xx.....", 0.0), ("x..x", 1.0)])
def test_good_cycles_leave_no_credit(pattern: str, value: float) -> None:
    assert count(pattern) == value


def test_one_bad_cycle_in_three_does_not_add_up() -> None:
    assert count("x.." * 1000) == 0.0


def test_cleared_it_begins_anew() -> None:
    cycles = BadCycles()
    cycles.count(True)
    cycles.clear()
    assert cycles.value == 0.0
