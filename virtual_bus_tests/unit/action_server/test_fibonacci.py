"""The numbers of the example without a robot."""

from __future__ import annotations

from canbase_action_server.fibonacci import next_number, refusal


def test_orders_and_numbers_have_their_limits() -> None:
    assert [order for order in (-1, 0, 1, 1000, 1001) if refusal(order) is None] == [1, 1000]
    assert next_number([0, 1]) == 1
    assert next_number([2**30, 2**30 - 1]) == 2**31 - 1
    assert next_number([2**30, 2**30]) is None
