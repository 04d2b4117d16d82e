"""The control thread at speed on a bus that fails, each way: no crash; latched, and said; a reset helps."""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterator

import can
import pytest
from can.interfaces import BACKENDS
from can.interfaces.virtual import VirtualBus

from bus.crews import simulated_crews
from bus.drive_rig import Driver, Surroundings
from bus.flaky_bus import FlakyBus
from canbase_driver.bus_port import BUS_OFF
from canbase_driver.snapshot import DriverState

pytestmark = pytest.mark.bus


class Rig:
    """A robot with two drives, and somebody who can break its bus."""

    def __init__(self, driver: Driver, around: Surroundings, controller: VirtualBus) -> None:
        self.driver, self.around = driver, around
        self._controller = controller

    def adapter_gone(self) -> None:
        """A USB adapter that was pulled out."""
        FlakyBus.error, FlakyBus.broken = OSError(errno.ENODEV, "no such device"), True

    def interface_down(self) -> None:
        """`ip link set can0 down`: it can be opened, and nothing goes through."""
        FlakyBus.error, FlakyBus.down = OSError(errno.ENETDOWN, "network is down"), True

    def nobody_acknowledges(self) -> None:
        """The transmit buffer stays full."""
        FlakyBus.deaf = True

    def bus_off(self) -> None:
        """As SocketCAN tells it, linux/can/error.h: once."""
        self._controller.send(
            can.Message(arbitration_id=0x040, is_error_frame=True, is_extended_id=False, data=bytes(8))
        )


@pytest.fixture
def rig(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Rig]:
    monkeypatch.setitem(BACKENDS, "virtual", ("bus.flaky_bus", "FlakyBus"))
    FlakyBus.heal()
    (crew,), channel = simulated_crews("generic"), f"failures-{request.node.name}"
    arguments = {"interface": "virtual", "channel": channel}
    with (
        VirtualBus(channel) as controller,
        Surroundings(crew, VirtualBus(channel)) as around,
        Driver(crew, arguments, around) as driver,
    ):
        yield Rig(driver, around, controller)
        FlakyBus.heal()


@pytest.mark.parametrize(
    ("fail", "told"),
    [
        (Rig.adapter_gone, "no such device"),
        (Rig.interface_down, "network is down"),
        (Rig.nobody_acknowledges, "transmit buffer full"),
        (Rig.bus_off, BUS_OFF),
    ],
)
def test_it_stops_latches_and_drives_again_after_a_reset(rig: Rig, fail: Callable[[Rig], None], told: str) -> None:
    driver = rig.driver
    driver.driving()
    fail(rig)
    failed = driver.latched(driver.forward)
    assert failed.cause == "bus failed"
    assert told in failed.detail
    assert rig.around.truth.standing_s > 0.1  # its own quick stop, the watchdog's or the drives'
    assert [(stop.cause, stop.latched) for stop in driver.stops] == [("bus failed", True)]
    FlakyBus.heal()
    again = driver.heard_again()
    assert again.bus_failures >= 1
    assert again.state is DriverState.LATCHED
    driver.reset()
    driver.driving()
    assert driver.loop.is_alive()
