"""How many SDO requests a cycle has room for, beside the PDOs of the axes that run already."""

from __future__ import annotations

import pytest

from canbase_config.robot import Bus
from canbase_driver.boot.sdo_budget import SdoBudget


def requests(interface: str, bitrate: int, running_axes: int, cycle_s: float = 0.01) -> int:
    """How many fit, at most 1000."""
    budget = SdoBudget(Bus(interface=interface, channel="c", bitrate=bitrate, extra={}), cycle_s)
    budget.refill(running_axes)
    sent = 0
    while not budget.is_spent and sent < 1000:
        budget.spend(1)
        sent += 1
    return sent


@pytest.mark.parametrize(
    ("bitrate", "running_axes", "expected"),
    [
        (500_000, 0, 16),  # 37 frames in 10 ms; 90 % of them, two a request
        (500_000, 2, 13),
        (500_000, 7, 5),
        (500_000, 8, 4),
        (1_000_000, 8, 20),
        (125_000, 0, 4),
        (125_000, 8, 1),  # too much for this bus already; a boot goes on nevertheless
    ],
)
def test_requests_in_a_cycle_of_10_ms(bitrate: int, running_axes: int, expected: int) -> None:
    assert requests("socketcan", bitrate, running_axes) == expected


@pytest.mark.parametrize("interface", ["virtual", "udp_multicast"])
def test_a_bus_without_a_wire_has_no_end_of_them(interface: str) -> None:
    assert requests(interface, 10_000, 8) == 1000


def test_a_longer_cycle_has_room_for_more() -> None:
    assert requests("socketcan", 500_000, 0, cycle_s=0.02) == 33


def test_every_cycle_begins_anew() -> None:
    budget = SdoBudget(Bus(interface="socketcan", channel="c", extra={}), 0.01)
    for _ in range(3):
        budget.refill(0)
        assert not budget.is_spent
        budget.spend(20)
        assert budget.is_spent
