"""What `canbase drive` and `canbase rotate` make of the end of a goal."""

from __future__ import annotations

import pytest

from canbase_action_server.outcome import Status
from canbase_cli.goal import ABORTED, CANCELED, NO_FEEDBACK, exit_code


@pytest.mark.parametrize(
    ("status", "code"), [(Status.SUCCEEDED, 0), (Status.CANCELED, CANCELED), (Status.ABORTED, ABORTED)]
)
def test_only_a_goal_that_succeeded_exits_with_0(status: Status, code: int) -> None:
    assert exit_code(status) == code


def test_a_goal_that_was_canceled_for_missing_feedback_has_a_code_of_its_own_and_no_other_end_has_it() -> None:
    assert [exit_code(status, feedback_lost=True) for status in Status] == [0, NO_FEEDBACK, ABORTED]


def test_every_final_status_has_its_own_exit_code() -> None:
    assert len({exit_code(status) for status in Status}) == len(Status)
