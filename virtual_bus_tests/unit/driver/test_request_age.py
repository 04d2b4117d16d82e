"""Which requests are too old to be carried out."""

from __future__ import annotations

import pytest

from canbase_driver.ros.request_age import LONGEST_S, refusal

NOW_S = 1_800_000_000.0


@pytest.mark.parametrize("age_s", [0.0, 0.02, LONGEST_S - 0.01, LONGEST_S, -0.5, -LONGEST_S])
def test_a_request_that_was_just_sent_is_carried_out(age_s: float) -> None:
    assert refusal(False, NOW_S - age_s, NOW_S) == ""


def test_one_that_may_have_waited_while_the_process_stood_still_is_refused() -> None:
    assert "did not run before it" in refusal(True, NOW_S, NOW_S)


@pytest.mark.parametrize("age_s", [LONGEST_S + 0.01, 9.0, 1e9])
def test_one_that_was_sent_long_ago_is_refused_and_the_refusal_names_its_age(age_s: float) -> None:
    assert f"it was sent {age_s:.1f} s ago" in refusal(False, NOW_S - age_s, NOW_S)


def test_the_age_of_one_from_the_future_is_not_known() -> None:
    assert refusal(False, NOW_S + 300.0, NOW_S) == (
        "refused: by its sender's clock it comes from 300.0 s ahead; set the clocks of both computers"
    )


def test_a_middleware_that_does_not_say_when_it_was_sent_is_no_reason_to_refuse() -> None:
    assert refusal(False, 0.0, NOW_S) == ""
