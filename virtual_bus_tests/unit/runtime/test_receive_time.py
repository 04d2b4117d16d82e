"""A message that waited while the process stood still counts from before that.

looks    |||||||            pause             |||||||||||
at       0.00 … 0.10                          1.00   1.10
counts   as now                               0.10   as now
"""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_runtime.receive_time import GAP_S, SETTLE_S, ReceiveTimes


def looked(*times: float) -> ReceiveTimes:
    """One that has been asked at these times."""
    receive_times = ReceiveTimes()
    for now_s in times:
        receive_times.at(now_s)
    return receive_times


@pytest.mark.parametrize("gap_s", [0.0, 0.02, 0.05, GAP_S])
def test_without_a_pause_a_message_counts_from_now(gap_s: float) -> None:
    assert looked(0.0).at(gap_s) == gap_s


def test_the_first_message_counts_from_now() -> None:
    assert ReceiveTimes().at(12.3) == 12.3


@pytest.mark.parametrize("gap_s", [GAP_S + 1e-6, 0.3, 10.0, 1e6])
def test_after_a_pause_it_counts_from_before_it(gap_s: float) -> None:
    receive_times = looked(4.9, 5.0)
    assert receive_times.at(5.0 + gap_s) == 5.0
    assert receive_times.waited(5.0 + gap_s)


def test_so_do_the_other_ones_that_waited_until_the_queues_are_empty() -> None:
    receive_times = looked(5.0, 6.0)
    assert [receive_times.at(6.0 + ms / 1000.0) for ms in (0, 1, 50, 99)] == [5.0, 5.0, 5.0, 5.0]
    assert receive_times.at(6.0 + SETTLE_S) == 6.0 + SETTLE_S
    assert not receive_times.waited(6.15)


def test_a_second_pause_before_the_queues_are_empty_is_part_of_the_first() -> None:
    assert looked(5.0, 6.0, 6.09).at(6.3) == 5.0
    assert looked(5.0, 6.0, 6.09, 6.1).at(6.3) == 6.1


@given(st.lists(st.floats(0.0, 0.5), min_size=1, max_size=50))
def test_the_time_is_never_in_the_future_and_never_falls(steps_s: list[float]) -> None:
    receive_times, now_s, before = ReceiveTimes(), 0.0, 0.0
    for step_s in steps_s:
        now_s += step_s
        counts_from = receive_times.at(now_s)
        assert before <= counts_from <= now_s
        before = counts_from
