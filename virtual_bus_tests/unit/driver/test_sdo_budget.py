"""How many SDO requests a cycle has room for, beside the PDOs of the axes that run already, and for which node."""

from __future__ import annotations

import pytest

from canbase_config.robot import Bus
from canbase_driver.boot.sdo_budget import SdoBudget


def budget_of(interface: str = "socketcan", bitrate: int = 500_000, cycle_s: float = 0.01) -> SdoBudget:
    return SdoBudget(Bus(interface=interface, channel="c", bitrate=bitrate, extra={}), cycle_s)


def spend_all(budget: SdoBudget, node_id: int) -> int:
    """How many fit, at most 1000."""
    sent = 0
    while not budget.is_spent(node_id) and sent < 1000:
        budget.spend(node_id, 1)
        sent += 1
    return sent


@pytest.mark.parametrize(
    ("bitrate", "running_axes", "expected"),
    [
        (500_000, 0, 18),  # 5,000 bits in 10 ms; 92 % of them, two frames of 122 bits a request
        (500_000, 2, 14),
        (500_000, 7, 6),
        (500_000, 8, 5),
        (1_000_000, 8, 23),
        (125_000, 0, 4),
        (125_000, 8, 1),  # too much for this bus already; a boot goes on nevertheless
    ],
)
def test_requests_in_a_cycle_of_10_ms(bitrate: int, running_axes: int, expected: int) -> None:
    budget = budget_of(bitrate=bitrate)
    budget.refill(running_axes, {1: 0})
    assert spend_all(budget, 1) == expected


@pytest.mark.parametrize("interface", ["virtual", "udp_multicast"])
def test_a_bus_without_a_wire_has_no_end_of_them(interface: str) -> None:
    budget = budget_of(interface, 10_000)
    budget.refill(8, {1: 40, 2: 0})
    assert spend_all(budget, 1) == 1000


def test_a_longer_cycle_has_room_for_more() -> None:
    budget = budget_of(cycle_s=0.02)
    budget.refill(0, {1: 0})
    assert spend_all(budget, 1) == 37


def test_each_of_eight_nodes_gets_its_share_and_parts_of_a_request_are_kept() -> None:
    budget, sent = budget_of(), dict.fromkeys(range(1, 9), 0)
    for _ in range(100):
        budget.refill(0, sent)
        for node_id in sent:
            sent[node_id] += spend_all(budget, node_id)
    assert set(sent.values()) == {231}  # 18.5 of 18.9 in each cycle


def test_who_is_behind_makes_up_for_it() -> None:
    budget = budget_of()
    budget.refill(0, {1: 40, 2: 40, 3: 34})
    assert [spend_all(budget, node_id) for node_id in (1, 2, 3)] == [5, 5, 8]


def test_a_node_that_has_just_begun_gets_a_share_too() -> None:
    budget = budget_of()
    budget.refill(0, {1: 5})
    assert spend_all(budget, 2) == 18


def test_without_a_node_that_is_configured_nothing_is_divided_by_zero() -> None:
    budget = budget_of()
    budget.refill(4, {})
    assert not budget.is_spent(1)
