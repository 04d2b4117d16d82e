"""Error frames of SocketCAN in words, as the driver tells them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_driver.supervision.bus_health import BusReport, ControllerState

CONTROLLER = 0x004


@pytest.mark.parametrize(
    ("error_class", "detail", "controller"),
    [
        (CONTROLLER, 0x04, ControllerState.ERROR_WARNING),
        (CONTROLLER, 0x08, ControllerState.ERROR_WARNING),
        (CONTROLLER, 0x10, ControllerState.ERROR_PASSIVE),
        (CONTROLLER, 0x20, ControllerState.ERROR_PASSIVE),
        (CONTROLLER, 0x24, ControllerState.ERROR_PASSIVE),
        (0x040, 0x00, ControllerState.BUS_OFF),
        (0x040 | CONTROLLER, 0x20, ControllerState.BUS_OFF),
        (0x008, 0x30, ControllerState.ERROR_ACTIVE),  # a single error on the wire: byte 1 is no state there
        (0x002, 0x00, ControllerState.ERROR_ACTIVE),  # lost arbitration
    ],
)
def test_what_one_error_frame_says(error_class: int, detail: int, controller: ControllerState) -> None:
    report = BusReport().with_error_frame(error_class, bytes([0, detail]))
    assert (report.controller, report.error_frames) == (controller, 1)
    assert report.is_bus_off == (controller is ControllerState.BUS_OFF)


@pytest.mark.parametrize(("error_class", "detail"), [(CONTROLLER, 0x40), (0x100, 0x00)])
def test_the_controller_recovers(error_class: int, detail: int) -> None:
    passive = BusReport().with_error_frame(CONTROLLER, bytes([0, 0x20]))
    assert passive.with_error_frame(error_class, bytes([0, detail])).controller == ControllerState.ERROR_ACTIVE


def test_an_error_on_the_wire_leaves_the_state_as_it_was() -> None:
    passive = BusReport().with_error_frame(CONTROLLER, bytes([0, 0x20]))
    assert passive.with_error_frame(0x080, bytes(8)).controller == ControllerState.ERROR_PASSIVE


@given(st.integers(0, 0x1FFF_FFFF), st.binary(max_size=8))
def test_no_error_frame_is_too_strange(error_class: int, data: bytes) -> None:
    assert BusReport().with_error_frame(error_class, data).error_frames == 1
