"""The driver's main thread tells a control thread that hangs from a process that was stopped and goes on."""

from __future__ import annotations

from canbase_driver.runtime.main import HangWatch

TIMEOUT_S, LOOK_S = 0.5, 0.1


def looks(watch: HangWatch, cycle_at: float, times: list[float]) -> list[bool]:
    return [watch.check_cycle(cycle_at, now_s) is not None for now_s in times]


def test_a_control_thread_without_a_cycle_hangs_after_the_timeout() -> None:
    watch = HangWatch(TIMEOUT_S, LOOK_S)
    assert looks(watch, 10.0, [10.0, 10.1, 10.2, 10.3, 10.4, 10.5]) == [False] * 6
    failure = watch.check_cycle(10.0, 10.61)
    assert failure is not None
    assert "no cycle for 0.6 s" in str(failure)


def test_a_process_that_was_stopped_as_a_whole_gets_its_time_again() -> None:
    # SIGSTOP at 10.1, SIGCONT at 14.0: this thread may look before the other one has made a cycle.
    watch = HangWatch(TIMEOUT_S, LOOK_S)
    assert looks(watch, 10.1, [10.1, 14.0, 14.02]) == [False] * 3
    assert looks(watch, 14.03, [14.1, 14.2, 14.6]) == [False] * 3


def test_many_short_looks_count_as_much_as_few_long_ones() -> None:
    # Commands arrive at 100 Hz and wake this thread early.
    watch = HangWatch(TIMEOUT_S, LOOK_S)
    found = looks(watch, 10.0, [10.0 + 0.01 * number for number in range(61)])
    assert found.index(True) in (51, 52)


def test_before_the_first_cycle_the_time_runs_too() -> None:
    watch = HangWatch(TIMEOUT_S, LOOK_S)
    assert looks(watch, float("inf"), [1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.7])[-1]
