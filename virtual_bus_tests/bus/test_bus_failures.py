"""The control thread at speed on a bus that fails each way, with drives of every kind: latched; a reset helps."""

from __future__ import annotations

import errno
from collections.abc import Callable
from typing import Any

import can
import pytest
from can.interfaces.virtual import VirtualBus

from canbase_driver.runtime.bus_port import BUS_OFF
from canbase_runtime.driver_state import DriverState
from support.crews import Crew, simulated_crews
from support.drive_rig import Driver, Surroundings
from support.flaky_bus import FlakyBus

pytestmark = pytest.mark.bus


def adapter_gone(_channel: str) -> None:
    """A USB adapter that was pulled out."""
    FlakyBus.error, FlakyBus.broken = OSError(errno.ENODEV, "no such device"), True


def interface_down(_channel: str) -> None:
    """`ip link set can0 down`: it can be opened, and nothing goes through."""
    FlakyBus.error, FlakyBus.down = OSError(errno.ENETDOWN, "network is down"), True


def nobody_acknowledges(_channel: str) -> None:
    """The transmit buffer stays full."""
    FlakyBus.deaf = True


def bus_off(channel: str) -> None:
    """As SocketCAN tells it, linux/can/error.h: once."""
    told = can.Message(arbitration_id=0x040, is_error_frame=True, is_extended_id=False, data=bytes(8))
    with VirtualBus(channel) as controller:
        controller.send(told)


WAYS: list[tuple[Callable[[str], None], str]] = [
    (adapter_gone, "no such device"),
    (interface_down, "network is down"),
    (nobody_acknowledges, "transmit buffer full"),
    (bus_off, BUS_OFF),
]
"""How a bus fails, and what is told of it. What the driver's handle does with each: test_bus_port.py."""


def dealt(crew: Crew) -> list[tuple[Callable[[str], None], str]]:
    """Each way once among the crews: it says nothing about the drives. All of them to a crew of one kind."""
    names = [each.name for each in simulated_crews(None)]
    return WAYS[names.index(crew.name) :: len(names)] if crew.name in names else WAYS


# driving ── the bus fails ── stopped, latched ── it is back, all drives have booted: still latched ── reset, driving
def test_it_stops_latches_and_drives_again_after_a_reset(
    crew: Crew, driver: Driver, around: Surroundings, arguments: dict[str, Any]
) -> None:
    for fail, told in dealt(crew):
        driver.driving()
        driver.stops.clear()
        fail(arguments["channel"])
        failed = driver.latched(driver.forward)
        assert failed.finding.cause.value == "bus failed"
        assert told in failed.finding.detail
        assert around.truth.standing_s > 0.1  # its own quick stop, the watchdog's or the drives'
        assert [(stop.cause, stop.latched) for stop in driver.stops] == [("bus failed", True)]
        FlakyBus.heal()
        again = driver.heard_again()
        assert again.bus.failures >= 1
        assert again.state is DriverState.LATCHED
        driver.reset(5.0)
        driver.driving()
        assert driver.loop.is_alive()
