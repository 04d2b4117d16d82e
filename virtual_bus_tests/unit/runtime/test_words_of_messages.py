"""A word of a message that no interface has is UNKNOWN, and UNKNOWN is never taken for well."""

from __future__ import annotations

import pytest
from canbase.msg import DriverStatus, SafetyState

from canbase_action_server.messages import driver_in, safety_in
from canbase_runtime.stop_cause import SCAN_LOST, StopCause, stop_cause
from canbase_runtime.watchdog_view import WatchdogView, watchdog_view


@pytest.mark.parametrize("word", ["", "OK", "ok ", "well"])
def test_an_unknown_word_about_the_watchdog_is_not_ok(word: str) -> None:
    assert watchdog_view(word) is WatchdogView.UNKNOWN
    assert driver_in(DriverStatus(watchdog=word)).watchdog is WatchdogView.UNKNOWN


@pytest.mark.parametrize("view", WatchdogView)
def test_each_word_about_the_watchdog_is_read_back(view: WatchdogView) -> None:
    assert watchdog_view(view.value) is view


@pytest.mark.parametrize("cause", StopCause)
def test_each_cause_is_read_back(cause: StopCause) -> None:
    assert safety_in(SafetyState(cause=cause.value)).cause is cause


def test_an_unknown_cause_is_neither_none_nor_one_of_the_known_groups() -> None:
    cause = stop_cause("estop_")
    assert cause is StopCause.UNKNOWN
    assert not cause.is_estop
    assert cause not in SCAN_LOST
