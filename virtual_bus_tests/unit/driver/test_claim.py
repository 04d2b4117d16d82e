"""When a bus was listened to for long enough before the first frame: 0.3 s, of which the last 0.1 s without a gap."""

from __future__ import annotations

from collections.abc import Iterable

from canbase_driver.runtime.claim import Attention


def suffices_at(turns_s: Iterable[float], listen_s: float = 0.3) -> float | None:
    """The bus is open at 0 s and read empty at these times."""
    attention = Attention(0.0, listen_s)
    return next((at for at in turns_s if attention.suffices(at)), None)


def every(step_s: float, begin_s: float, end_s: float) -> list[float]:
    return [begin_s + i * step_s for i in range(round((end_s - begin_s) / step_s) + 1)]


def test_a_thread_that_is_always_in_time_listens_for_the_timeout_of_a_heartbeat() -> None:
    assert suffices_at(every(0.01, 0.01, 1.0)) == 0.3


def test_a_gap_at_the_begin_costs_nothing() -> None:
    assert suffices_at(every(0.01, 0.15, 1.0)) == 0.3


# 0.01 s ── in time ── 0.2 s ── a library is loaded, frames may be lost ── 0.28 s ── in time ── 0.38 s
def test_after_a_gap_one_period_of_the_heartbeat_is_listened_to_without_another() -> None:
    at = suffices_at([*every(0.01, 0.01, 0.2), *every(0.01, 0.28, 1.0)])
    assert at is not None
    assert 0.38 - 1e-9 <= at <= 0.39 + 1e-9


def test_a_thread_that_always_comes_late_never_suffices() -> None:
    assert suffices_at(every(0.04, 0.04, 10.0)) is None


def test_a_thread_that_slept_through_all_of_it_listens_for_a_period() -> None:
    at = suffices_at([2.0, *every(0.01, 2.01, 3.0)])
    assert at is not None
    assert 2.1 - 1e-9 <= at <= 2.11 + 1e-9
