"""What is due at a rate, in cycles that come a little late."""

from __future__ import annotations

import random

import pytest

from canbase_velocity.steady import next_turn


@pytest.mark.parametrize("command_hz", [10.0, 20.0, 30.0, 50.0, 100.0])
def test_late_cycles_do_not_make_a_state_rarer(command_hz: float) -> None:
    """100 s of cycles that come up to a millisecond late, a state each 0.1 s."""
    rng, due_s, sent = random.Random(3), 0.0, 0
    for cycle in range(int(100.0 * command_hz)):
        now_s = cycle / command_hz + rng.uniform(0.0, 0.001)
        if now_s >= due_s:
            due_s, sent = next_turn(due_s, now_s, 0.1), sent + 1
    assert 999 <= sent <= 1001


def test_what_is_published_in_between_delays_none() -> None:
    """5 s of changes in each cycle, each published, then none: the next one comes within its period."""
    due_s = 0.0
    for cycle in range(250):
        due_s = next_turn(due_s, cycle / 50.0, 0.1)
    assert due_s <= 249 / 50.0 + 0.1


def test_after_a_pause_nothing_is_made_up_for() -> None:
    assert next_turn(1.0, 5.0, 0.1) == 5.1
    assert next_turn(float("-inf"), 5.0, 0.1) == 5.1
