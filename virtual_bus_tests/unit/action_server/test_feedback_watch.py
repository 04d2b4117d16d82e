"""When feedback counts as missing: a server that is silent, and a client that did not look."""

from __future__ import annotations

import math

import pytest

from canbase_action_server.feedback_watch import FEEDBACK_TIMEOUT_S, PAUSE_S, FeedbackWatch
from canbase_action_server.goal_queue import WAITING_FEEDBACK_HZ
from canbase_config.action import Action


def looks(watch: FeedbackWatch, begin_s: float, end_s: float) -> list[float]:
    """The times at which it finds feedback missing, of a client that looks every 0.1 s."""
    times = [begin_s + 0.1 * step for step in range(round((end_s - begin_s) / 0.1) + 1)]
    return [at_s for at_s in times if watch.missing(at_s)]


def test_feedback_is_missing_after_the_timeout_and_not_before() -> None:
    watch = FeedbackWatch(3.0)
    assert looks(watch, 100.0, 102.9) == []
    assert looks(watch, 103.0, 103.2)[0] == pytest.approx(103.1)


def test_feedback_once_a_second_is_enough() -> None:
    watch = FeedbackWatch(3.0)
    for second in range(60):
        watch.received(float(second))
        assert looks(watch, second + 0.1, second + 0.9) == []


def test_after_the_last_feedback_the_timeout_begins() -> None:
    watch = FeedbackWatch(3.0)
    looks(watch, 0.0, 2.0)
    watch.received(2.0)
    assert looks(watch, 2.1, 6.0)[0] == pytest.approx(5.1, abs=0.05)


def test_a_client_that_was_suspended_counts_anew_when_it_runs_again() -> None:
    watch = FeedbackWatch(3.0)
    looks(watch, 0.0, 1.0)
    assert not watch.missing(60.0)  # its messages are not read yet
    assert looks(watch, 60.1, 62.9) == []
    assert looks(watch, 63.0, 63.3) != []


def test_short_waits_in_a_loop_do_not_hide_a_silent_server() -> None:
    watch = FeedbackWatch(3.0)
    times = [0.5 * step for step in range(10)]  # the application does something else between two waits
    assert PAUSE_S > 0.5
    assert next(at_s for at_s in times if watch.missing(at_s)) == 3.5


@pytest.mark.parametrize("timeout_s", [0.0, -1.0, math.nan, math.inf, 1e9])
def test_a_timeout_that_would_be_none_is_refused(timeout_s: float) -> None:
    with pytest.raises(ValueError, match="more than 0 and up to 3600"):
        FeedbackWatch(timeout_s)


def test_the_default_bridges_two_messages_of_the_slowest_feedback() -> None:
    slowest_hz = min(WAITING_FEEDBACK_HZ, Action.model_fields["feedback_hz"].metadata[0].ge)
    assert FEEDBACK_TIMEOUT_S * slowest_hz >= 3.0
