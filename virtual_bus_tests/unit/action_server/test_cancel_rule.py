"""The rule of action_msgs/srv/CancelGoal, row by row."""

from __future__ import annotations

import pytest

from canbase_action_server.cancel_rule import NO_UUID, meant

FIRST, SECOND, THIRD, STRANGER = ("a" * 32, "b" * 32, "c" * 32, "d" * 32)
OPEN = {FIRST: 1_000, SECOND: 2_000, THIRD: 3_000}


@pytest.mark.parametrize(
    ("uuid", "stamp_ns", "expected"),
    [
        (NO_UUID, 0, (FIRST, SECOND, THIRD)),
        (NO_UUID, 999, ()),
        (NO_UUID, 1_000, (FIRST,)),
        (NO_UUID, 2_500, (FIRST, SECOND)),
        (SECOND, 0, (SECOND,)),
        (THIRD, 1_000, (FIRST, THIRD)),
        (FIRST, 2_000, (FIRST, SECOND)),
        (STRANGER, 0, ()),
        (STRANGER, 2_000, (FIRST, SECOND)),
    ],
)
def test_a_request_means_these_goals(uuid: str, stamp_ns: int, expected: tuple[str, ...]) -> None:
    assert meant(OPEN, uuid, stamp_ns) == expected


def test_without_open_goals_none_is_meant() -> None:
    assert meant({}, NO_UUID, 0) == ()
