"""The driver's handle on a bus that fails in every way that python-can's adapters do: no exception, no late frame."""

from __future__ import annotations

import errno
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any
from unittest.mock import Mock

import can
import pytest
from can.interfaces import BACKENDS
from can.interfaces.virtual import VirtualBus

from canbase_base.frame_socket import BusError
from canbase_driver.cia301.frame import Frame
from canbase_driver.runtime import bus_port
from canbase_driver.runtime.bus_port import (
    BUS_OFF,
    OPENS_AT_ONCE_S,
    RECEIVE_FAILURES,
    SEND_FAILURES,
    SEND_TIMEOUT_S,
    BusPort,
)
from canbase_driver.runtime.bus_traffic import Traffic
from canbase_driver.supervision.bus_health import ControllerState
from support.flaky_bus import FlakyBus

pytestmark = pytest.mark.bus
SYNC = Frame(0x080)
RETRY_S = 0.05
WAYS_TO_FAIL = [
    can.CanOperationError("network is down"),
    OSError(errno.ENODEV, "no such device"),  # the USB adapter is gone
    OSError(errno.ENETDOWN, "network is down"),  # ip link set can0 down
    ValueError("file descriptor cannot be a negative integer (-1)"),  # select on a closed handle
]


@pytest.fixture
def arguments(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Of a bus that this test has for itself, and can break; it is opened again soon, however busy the computer is."""
    monkeypatch.setitem(BACKENDS, "virtual", ("support.flaky_bus", "FlakyBus"))
    monkeypatch.setattr(bus_port, "RETRY_S", RETRY_S)
    monkeypatch.setattr(bus_port, "OPENS_AT_ONCE_S", 10.0)
    FlakyBus.heal()
    return {"interface": "virtual", "channel": f"port-{request.node.name}"}


@pytest.fixture
def port(arguments: dict[str, Any]) -> Iterator[BusPort]:
    opened = BusPort(arguments)
    yield opened
    FlakyBus.heal()
    opened.close()


@pytest.fixture
def other(arguments: dict[str, Any]) -> Iterator[VirtualBus]:
    """Somebody else on the same bus."""
    with VirtualBus(arguments["channel"]) as bus:
        yield bus


def receive_until(port: BusPort, done: Callable[[], bool]) -> None:
    """A try to open it again is due after RETRY_S; a busy computer may take longer for it."""
    end_s = time.monotonic() + 10.0
    while not done():
        assert time.monotonic() < end_s, port.problem
        assert port.receive(0.01) is None


def reopened(port: BusPort) -> None:
    """Wait for one try to open it again to begin."""
    time.sleep(RETRY_S)
    assert port.receive(0.0) is None


def error_frame(error_class: int, detail: int = 0) -> can.Message:
    """As SocketCAN gives it, linux/can/error.h."""
    data = bytes([0, detail, 0, 0, 0, 0, 0, 0])
    return can.Message(arbitration_id=error_class, is_error_frame=True, is_extended_id=False, data=data)


def test_a_bus_that_cannot_be_opened_says_what_to_look_at(arguments: dict[str, Any]) -> None:
    with pytest.raises(BusError, match=r"no_such_bus.*Check `bus` in robot\.yaml"):
        BusPort(arguments | {"interface": "no_such_bus"})


def test_a_full_transmit_buffer_is_counted_and_a_long_one_is_a_failed_bus(port: BusPort) -> None:
    FlakyBus.deaf = True
    for _ in range(SEND_FAILURES - 1):
        port.send(SYNC)
    assert (port.report.send_errors, port.problem) == (SEND_FAILURES - 1, "")
    FlakyBus.deaf = False
    port.send(SYNC)  # one that succeeds: what came before is forgiven
    FlakyBus.deaf = True
    for _ in range(SEND_FAILURES):
        port.send(SYNC)
    assert port.problem == "sending failed 10 times in a row: transmit buffer full"
    port.send(SYNC)  # nothing is kept for later
    assert port.report.send_errors == 2 * SEND_FAILURES - 1


def test_every_frame_is_sent_with_a_deadline(port: BusPort) -> None:
    port.send(SYNC)
    assert FlakyBus.timeouts == {SEND_TIMEOUT_S}


@pytest.mark.parametrize("error", WAYS_TO_FAIL, ids=lambda error: type(error).__name__ + str(error)[:12])
def test_an_adapter_that_goes_away_is_a_problem_until_it_is_back(port: BusPort, error: Exception) -> None:
    FlakyBus.error, FlakyBus.broken = error, True
    for _ in range(RECEIVE_FAILURES):
        assert port.problem == ""
        assert port.receive(0.0) is None
    assert port.problem.startswith(f"receiving failed {RECEIVE_FAILURES} times in a row: ")
    receive_until(port, lambda: "cannot be opened" in port.problem)
    assert (port.report.receive_errors, port.report.failures) == (RECEIVE_FAILURES, 1)
    FlakyBus.broken = False

    def works() -> bool:
        port.send(SYNC)
        return port.problem == ""

    receive_until(port, works)


def test_an_interface_that_is_down_can_be_opened_and_is_a_problem_all_the_same(port: BusPort) -> None:
    FlakyBus.down = True
    for _ in range(SEND_FAILURES):
        port.send(SYNC)
    problem = port.problem
    assert problem == "sending failed 10 times in a row: network is down"
    for _ in range(3):
        reopened(port)
        port.send(SYNC)
        assert port.problem == problem
    FlakyBus.down = False
    port.send(SYNC)
    assert port.problem == ""


def test_a_datagram_that_is_no_frame_does_not_fail_the_bus(port: BusPort, other: VirtualBus) -> None:
    for _ in range(10):
        FlakyBus.down = True
        port.receive(0.0)
        FlakyBus.down = False
        other.send(can.Message(arbitration_id=0x181, data=b"\1", is_extended_id=False))
        assert port.receive(0.1) == Frame(0x181, b"\1")
    assert (port.problem, port.report.receive_errors) == ("", 10)


def test_what_canopen_does_not_use_is_dropped_and_counted(port: BusPort, other: VirtualBus) -> None:
    other.send(can.Message(arbitration_id=0x181, data=b"\0", is_extended_id=True))
    other.send(can.Message(arbitration_id=0x181, is_extended_id=False, is_remote_frame=True))
    other.send(error_frame(0x008))
    other.send(can.Message(arbitration_id=0x181, data=b"\1", is_extended_id=False))
    assert [port.receive(0.05) for _ in range(2)] == [Frame(0x181, b"\1"), None]
    assert (port.report.dropped, port.report.error_frames, port.problem) == (2, 1, "")


def test_node_guarding_requests_of_the_watchdog_are_passed_over_and_hold_up_nothing(
    port: BusPort, other: VirtualBus
) -> None:
    for _ in range(3):
        other.send(can.Message(arbitration_id=0x701, is_extended_id=False, is_remote_frame=True, dlc=1))
    other.send(can.Message(arbitration_id=0x181, data=b"\1", is_extended_id=False))
    assert port.receive(0.05) == Frame(0x181, b"\1")
    assert (port.report.dropped, port.problem) == (0, "")


def test_a_tool_sends_a_request_as_a_remote_frame(port: BusPort, other: VirtualBus) -> None:
    port.send(Frame(0x701, remote=True))
    sent = other.recv(1.0)
    assert sent is not None
    assert (sent.arbitration_id, sent.is_remote_frame, sent.dlc) == (0x701, True, 1)


def test_bus_off_is_a_problem_until_something_is_heard_again(port: BusPort, other: VirtualBus) -> None:
    other.send(error_frame(0x040))
    assert port.receive(0.1) is None
    assert port.problem == BUS_OFF
    reopened(port)
    port.send(SYNC)  # the kernel takes it, and it goes nowhere
    assert port.problem == BUS_OFF
    other.send(can.Message(arbitration_id=0x701, data=b"\5", is_extended_id=False))
    assert port.receive(0.1) == Frame(0x701, b"\5")
    assert (port.problem, port.report.controller, port.report.failures) == ("", ControllerState.ERROR_ACTIVE, 1)


@pytest.mark.parametrize("begins_so", [True, False], ids=["at its start", "when it opens again"])
def test_a_controller_that_was_bus_off_before_is_a_problem_until_something_is_heard(
    arguments: dict[str, Any], other: VirtualBus, monkeypatch: pytest.MonkeyPatch, begins_so: bool
) -> None:
    """Its error frame came when nobody listened, and the kernel takes every frame and drops it."""
    off = [begins_so]
    monkeypatch.setattr(bus_port, "CARRIER_S", 0.0)
    monkeypatch.setattr(bus_port, "is_without_carrier", lambda _: off[0])
    port = BusPort(arguments)
    if not begins_so:
        FlakyBus.broken = True
        for _ in range(RECEIVE_FAILURES):
            port.receive(0.0)
        FlakyBus.broken, off[0] = False, True
    for _ in range(2):
        reopened(port)
        port.send(SYNC)
        assert (port.problem, port.report.controller) == (BUS_OFF, ControllerState.BUS_OFF)
    other.send(can.Message(arbitration_id=0x77E, data=b"\5", is_extended_id=False))  # the watchdog, on this computer
    assert port.receive(0.1) == Frame(0x77E, b"\5")
    assert (port.problem, port.report.controller) == (BUS_OFF, ControllerState.BUS_OFF)
    off[0] = False
    other.send(can.Message(arbitration_id=0x701, data=b"\5", is_extended_id=False))
    assert port.receive(0.1) == Frame(0x701, b"\5")
    assert (port.problem, port.report.controller, port.report.failures) == ("", ControllerState.ERROR_ACTIVE, 1)
    port.close()


def test_the_carrier_is_not_looked_at_for_each_frame(
    arguments: dict[str, Any], other: VirtualBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    look = Mock(return_value=True)
    monkeypatch.setattr(bus_port, "CARRIER_S", 30.0)
    monkeypatch.setattr(bus_port, "is_without_carrier", look)
    port = BusPort(arguments)
    reopened(port)
    before = look.call_count
    for _ in range(20):
        other.send(can.Message(arbitration_id=0x77E, data=b"\5", is_extended_id=False))
        assert port.receive(1.0) is not None
    assert look.call_count == before + 1
    port.close()


def test_frames_of_both_ways_are_counted_with_their_data(port: BusPort, other: VirtualBus) -> None:
    assert port.traffic() == Traffic(0, 0)
    port.send(SYNC)
    port.send(Frame(0x200, bytes(6)))
    other.send(can.Message(arbitration_id=0x701, data=b"\5", is_extended_id=False))
    other.send(can.Message(arbitration_id=0x1234567, data=bytes(8), is_extended_id=True))
    assert port.receive(0.1) is not None
    assert port.receive(0.1) is None
    assert port.traffic() == Traffic(4, 15)
    FlakyBus.deaf = True
    port.send(SYNC)
    assert port.traffic() == Traffic(4, 15)


def test_closing_twice_is_once(port: BusPort) -> None:
    port.close()
    port.close()
    port.send(SYNC)
    assert port.report.send_errors == 0


def test_what_waits_behind_frames_of_other_kinds_is_taken_in_at_once(port: BusPort, other: VirtualBus) -> None:
    """A cycle that is late takes in what waits without any time left for it: nothing may end that but an empty bus."""
    for _ in range(20):
        other.send(can.Message(arbitration_id=0x181, data=b"\0", is_extended_id=True))
        other.send(error_frame(0x008))
    other.send(can.Message(arbitration_id=0x181, data=b"\1", is_extended_id=False))
    assert port.receive(0.0) == Frame(0x181, b"\1")


def test_an_adapter_that_opens_slowly_does_not_hold_up_the_cycle(
    port: BusPort, other: VirtualBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A serial adapter (slcan) sleeps 2 s when it is opened. Here it is open when the test says so."""
    monkeypatch.setattr(bus_port, "OPENS_AT_ONCE_S", OPENS_AT_ONCE_S)
    opens = threading.Event()
    FlakyBus.broken = True
    for _ in range(RECEIVE_FAILURES):
        port.receive(0.0)
    FlakyBus.broken = False
    fast = FlakyBus.__init__

    def slow(self: FlakyBus, *arguments: Any, **options: Any) -> None:
        opens.wait(20.0)
        fast(self, *arguments, **options)

    monkeypatch.setattr(FlakyBus, "__init__", slow)
    reopened(port)
    longest_s = 0.0
    for _ in range(20):
        began = time.monotonic()
        assert port.receive(0.001) is None
        longest_s = max(longest_s, time.monotonic() - began)
    assert port.problem != ""
    assert longest_s < 0.5  # against 20 s
    opens.set()
    while port.problem:
        other.send(can.Message(arbitration_id=0x181, data=b"\1", is_extended_id=False))
        port.receive(0.01)


def test_a_bus_that_opens_after_the_end_is_closed(port: BusPort, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bus_port, "OPENS_AT_ONCE_S", OPENS_AT_ONCE_S)
    opens, closed = threading.Event(), threading.Event()
    FlakyBus.broken = True
    for _ in range(RECEIVE_FAILURES):
        port.receive(0.0)
    FlakyBus.broken = False
    fast, shut = FlakyBus.__init__, FlakyBus.shutdown

    def slow(self: FlakyBus, *arguments: Any, **options: Any) -> None:
        opens.wait(20.0)
        fast(self, *arguments, **options)

    def shut_down(self: FlakyBus) -> None:
        shut(self)
        closed.set()

    monkeypatch.setattr(FlakyBus, "__init__", slow)
    monkeypatch.setattr(FlakyBus, "shutdown", shut_down)
    reopened(port)
    port.close()
    assert not closed.is_set()
    opens.set()
    assert closed.wait(20.0)


LISTEN_S = 0.1
BEAT = Frame(0x77F, b"\x05")
"""The heartbeat of the driver."""


@pytest.fixture
def listening(arguments: dict[str, Any]) -> Iterator[BusPort]:
    """As a driver has it, on a bus that has just failed and works again."""
    opened = BusPort(arguments, LISTEN_S)
    FlakyBus.deaf = True
    for _ in range(SEND_FAILURES):
        opened.send(SYNC)
    FlakyBus.heal()
    reopened(opened)
    yield opened
    opened.close()


def sent(other: VirtualBus) -> int:
    count = 0
    while other.recv(0.0) is not None:
        count += 1
    return count


def test_after_a_failure_one_frame_goes_out_and_nothing_more_for_the_time_of_listening(
    listening: BusPort, other: VirtualBus
) -> None:
    began_s = time.monotonic()
    while time.monotonic() - began_s < 0.8 * LISTEN_S:
        listening.send(BEAT)
        assert listening.problem == "sending failed 10 times in a row: transmit buffer full"
    assert sent(other) == 1
    time.sleep(0.4 * LISTEN_S)
    listening.send(SYNC)
    assert (sent(other), listening.problem) == (1, "")


@pytest.mark.parametrize(("cob_id", "data"), [(0x080, b""), (0x080, b"\x01"), (0x77F, b"\x05")])
@pytest.mark.parametrize("probes", [False, True])
def test_another_driver_that_is_heard_then_keeps_this_one_silent(
    listening: BusPort, other: VirtualBus, cob_id: int, data: bytes, probes: bool
) -> None:
    if probes:
        listening.send(BEAT)
    for _ in range(2):  # the first one may be its own that came back
        other.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))
        listening.receive(0.0)
    assert listening.problem.startswith("another driver is on the bus: SYNC or the heartbeat of node 127 came.")
    other_heard = sent(other)
    for _ in range(3):
        listening.send(SYNC)
    assert (other_heard, sent(other)) == (int(probes), 0)


@pytest.mark.parametrize(
    "frame", [SYNC, Frame(0x000, b"\x82\x00"), Frame(0x201, b"\x02\x00" + bytes(4)), Frame(0x601, b"\x40" + bytes(7))]
)
def test_nothing_that_drives_of_another_driver_obey_goes_out_before_it_has_listened(
    listening: BusPort, other: VirtualBus, frame: Frame
) -> None:
    """SYNC, NMT, a setpoint, an SDO request: the other driver's robot may be in motion."""
    for _ in range(3):
        listening.send(frame)
    assert (sent(other), listening.problem != "") == (0, True)
    listening.send(BEAT)
    time.sleep(1.2 * LISTEN_S)
    listening.send(frame)
    assert (sent(other), listening.problem) == (2, "")


def test_when_the_other_driver_has_ended_this_one_listens_once_more_and_goes_on(
    listening: BusPort, other: VirtualBus
) -> None:
    other.send(can.Message(arbitration_id=0x080, is_extended_id=False))
    listening.receive(0.0)

    def works() -> bool:
        listening.send(BEAT)
        return listening.problem == ""

    began_s = time.monotonic()
    receive_until(listening, works)
    assert time.monotonic() - began_s >= RETRY_S + LISTEN_S


def test_drives_and_the_watchdog_are_no_driver_and_their_frames_come_through(
    listening: BusPort, other: VirtualBus
) -> None:
    for cob_id, data in ((0x701, b"\x7f"), (0x77E, b"\x05"), (0x181, bytes(6))):
        other.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))
        assert listening.receive(0.0) == Frame(cob_id, data)
    time.sleep(1.2 * LISTEN_S)
    listening.send(SYNC)
    assert listening.problem == ""


def test_its_own_frame_that_a_simulated_bus_brings_back_is_none_of_another_but_the_same_one_again_is(
    listening: BusPort, other: VirtualBus
) -> None:
    listening.send(BEAT)
    for expected in ("sending failed 10 times in a row: transmit buffer full", "another driver is on the bus"):
        other.send(can.Message(arbitration_id=0x77F, data=b"\x05", is_extended_id=False))
        listening.receive(0.0)
        assert listening.problem.startswith(expected)


def test_at_work_the_frames_of_another_driver_are_the_watchdogs_concern(port: BusPort, other: VirtualBus) -> None:
    other.send(can.Message(arbitration_id=0x080, is_extended_id=False))
    assert port.receive(0.0) == SYNC
    assert port.problem == ""
