"""A tool that changes drives stops when another master comes to the bus."""

from __future__ import annotations

from typing import cast

import pytest

from canbase_commissioning.bus_monitor import Listener
from canbase_commissioning.nmt_session import NmtSession
from canbase_commissioning.onbus.alone import run_alone
from canbase_commissioning.onbus.bus_session import BusSession
from canbase_commissioning.session import Session
from canbase_driver.cia301.frame import Frame

QUIET_TURNS = 5


class FakeLine:
    """A bus on which one frame comes after five turns, and the session ends after twenty."""

    def __init__(self, frame: Frame) -> None:
        self.turns = 0
        self._frame = frame

    def turn(self, session: Session) -> None:
        self.turns += 1
        session.tick(float(self.turns))
        if self.turns == QUIET_TURNS:
            session.on_frame(self._frame, float(self.turns))


@pytest.mark.parametrize(
    ("frame", "sign"),
    [
        (Frame(0x080), "SYNC"),
        (Frame(0x77F, b"\x05"), "heartbeat of node 127, canbase's motor driver"),
        (Frame(0x77E, b"\x05"), "heartbeat of node 126, canbase's watchdog"),
        (Frame(0x201, b"\x0f\0"), "setpoints (RPDOs) to node 1"),
    ],
)
def test_the_first_sign_of_a_master_ends_it(frame: Frame, sign: str) -> None:
    heard = Listener(0.0)
    line = FakeLine(frame)
    turns: list[int] = []
    why = run_alone(cast(BusSession, line), heard, NmtSession([Frame(0)], heard, 19.0), lambda: turns.append(1))
    assert why.startswith(f"another master has come to this bus ({sign}")
    assert line.turns == len(turns) == QUIET_TURNS


@pytest.mark.parametrize("frame", [Frame(0x601, bytes(8)), Frame(0x000, b"\x80\x01"), Frame(0x581, bytes(8))])
def test_what_may_be_an_echo_of_its_own_frames_does_not(frame: Frame) -> None:
    heard = Listener(0.0)
    line = FakeLine(frame)
    assert run_alone(cast(BusSession, line), heard, NmtSession([Frame(0)], heard, 19.0)) == ""
    assert line.turns > QUIET_TURNS
