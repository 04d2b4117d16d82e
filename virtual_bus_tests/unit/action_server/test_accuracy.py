"""The accuracy of DriveDistance, on a few of the bases and goals of benchmarks/accuracy.py."""

from __future__ import annotations

import pytest

from accuracy import Measured, cases, drive, quantile, table
from canbase_config.load import load_robot, sample
from drive_ways import WAYS

ROBOT = load_robot(sample("bench")).robot
BUDGET_M = 0.003
TOO_FAST_MPS = 0.01
"""The servo's answer to friction: no controller of an outer loop takes it away."""


@pytest.mark.parametrize("number", range(12))
def test_our_goals_end_within_the_budget_and_do_not_move_after_the_result(number: int) -> None:
    measured = drive(ROBOT, cases(ROBOT, 12)[number], WAYS["canbase"])
    assert abs(measured.error_m) <= BUDGET_M
    assert measured.overshoot_m <= BUDGET_M
    assert measured.after_m <= 0.0002
    assert measured.too_fast_mps <= TOO_FAST_MPS


def test_a_loop_that_orders_zero_at_the_distance_goes_beyond_it_after_its_result() -> None:
    measured = drive(ROBOT, cases(ROBOT, 1)[0], WAYS["lecture"])
    assert measured.overshoot_m > 0.01
    assert measured.after_m > 0.01


def test_the_same_goals_are_driven_in_every_run() -> None:
    assert cases(ROBOT, 5) == cases(ROBOT, 50)[:5]


def test_the_table_is_in_millimetres() -> None:
    assert "| one | 2.0 | 2.0 | 2.0 |" in table({"one": [Measured(-0.002, 0.0, 0.0, 1.0, 0.0)]})


@pytest.mark.parametrize(("share", "value"), [(0.5, 2.0), (0.99, 4.0), (1.0, 4.0), (0.25, 1.0)])
def test_a_quantile_is_one_of_the_values(share: float, value: float) -> None:
    assert quantile([4.0, 2.0, 1.0, 3.0], share) == value
