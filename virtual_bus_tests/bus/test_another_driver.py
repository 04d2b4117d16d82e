"""A driver of another computer on the same bus: heard before the first frame of this one, which then ends."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import can
import pytest

from canbase_driver.runtime.bus_port import BusPort
from canbase_driver.runtime.main import _listen_for_another
from canbase_runtime.single_instance import TakenError

pytestmark = pytest.mark.bus

LISTEN_S = 0.3


@pytest.fixture
def other(request: pytest.FixtureRequest) -> Iterator[can.BusABC]:
    with can.Bus(interface="virtual", channel=request.node.name) as bus:
        yield bus


def listen(other: can.BusABC, name: str, cob_id: int, data: bytes) -> None:
    """It listens, and after 0.1 s the frame comes."""
    port = BusPort({"interface": "virtual", "channel": name})
    message = can.Message(arbitration_id=cob_id, data=data, is_extended_id=False)
    timer = threading.Timer(0.1, other.send, (message,))
    timer.start()
    try:
        _listen_for_another(port, LISTEN_S)
        assert other.recv(0.0) is None  # nothing was sent
    finally:
        timer.join()
        port.close()


@pytest.mark.parametrize(("cob_id", "data"), [(0x080, b""), (0x080, b"\x01"), (0x77F, b"\x05")])
def test_sync_and_the_heartbeat_of_a_driver_are_another_driver(
    other: can.BusABC, request: pytest.FixtureRequest, cob_id: int, data: bytes
) -> None:
    with pytest.raises(TakenError, match="another driver is on the bus"):
        listen(other, request.node.name, cob_id, data)


@pytest.mark.parametrize(("cob_id", "data"), [(0x701, b"\x7f"), (0x77E, b"\x05"), (0x1FE, bytes(8)), (0x181, bytes(6))])
def test_drives_and_the_watchdog_are_none(
    other: can.BusABC, request: pytest.FixtureRequest, cob_id: int, data: bytes
) -> None:
    listen(other, request.node.name, cob_id, data)
