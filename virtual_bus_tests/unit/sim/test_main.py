"""When the simulated drives end: with everybody else on Ctrl-C, but not before the driver that stops them."""

from __future__ import annotations

import signal

import pytest

from canbase_sim.main import IN_USE_S, is_over

INT, QUIT, TERM = signal.SIGINT, signal.SIGQUIT, signal.SIGTERM
LONG, JUST = IN_USE_S + 0.01, IN_USE_S - 0.01


@pytest.mark.parametrize(
    ("signals", "silent_s", "over"),
    [
        ([], LONG, False),
        ([INT], JUST, False),
        ([INT], LONG, True),
        ([INT, INT], JUST, False),
        ([INT, INT], LONG, True),
        ([INT, QUIT], 0.0, True),
        ([TERM], 0.0, True),
        ([INT, TERM], 0.0, True),
    ],
)
def test_interrupts_wait_for_the_driver_and_everything_else_ends_them(
    signals: list[int], silent_s: float, over: bool
) -> None:
    assert is_over(signals, silent_s) is over
