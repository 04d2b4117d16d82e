"""The shell of the commissioning commands: which bus, and the loop that puts a session on it."""

from __future__ import annotations

import time
from pathlib import Path

from pydantic import ValidationError

from canbase_base.frame_socket import BusError
from canbase_commissioning.session import Echo, Session
from canbase_config.robot import Bus, Robot
from canbase_driver.cia301.frame import Frame
from canbase_driver.runtime.bus_port import BusPort
from canbase_runtime.terminal import FAILED, WRONG_INPUT, fail, load_config

TURN_S = 0.002
"""Longest wait for a frame, so the longest delay of anything that a session does by itself."""
MOST_FRAMES = 100
"""After this many frames in a row it is the session's turn."""


def choose_bus(
    config: Path | None, interface: str | None, channel: str | None, bitrate: int | None
) -> tuple[Bus, Robot | None]:
    """The bus, and the robot whose it is. Where the command line names neither, those of the robot that is meant; where
    it names a bus alone, no robot. Exits with 2 when it makes no sense."""
    if interface is None and channel is None:
        robot = load_config(config).robot
        return robot.bus, robot
    kind = interface or "socketcan"
    values: dict[str, object] = {"interface": kind, "channel": channel or "can0"}
    if bitrate is not None:
        values["bitrate"] = bitrate
    try:
        bus = Bus.model_validate(values)
    except ValidationError as error:
        fail(f"--interface, --channel, --bitrate: {error.errors()[0]['msg']}", WRONG_INPUT)
    return bus, robot_if_given(config)


def robot_if_given(config: Path | None) -> Robot | None:
    """The robot of --config; None without it."""
    return None if config is None else load_config(config).robot


def open_line(bus: Bus) -> BusSession:
    """The bus, for a `with`. Exits with 1 and advice when it cannot be opened."""
    try:
        return BusSession(bus)
    except BusError as error:
        fail(str(error), FAILED)


class BusSession:
    """One bus, and the clock. Use with `with`."""

    def __init__(self, bus: Bus) -> None:
        """Opens it. Raises BusError."""
        self._echo = Echo() if bus.interface == "udp_multicast" else None
        self._port = BusPort(bus.arguments())

    def __enter__(self) -> BusSession:
        return self

    def __exit__(self, *error: object) -> None:
        self._port.close()

    @property
    def problem(self) -> str:
        """What is wrong with the bus now; empty: nothing."""
        return self._port.problem

    @property
    def send_errors(self) -> int:
        """Frames that the bus did not take, since it was opened."""
        return self._port.report.send_errors

    @property
    def error_frames(self) -> int:
        """Errors on the wire that the CAN controller has reported since it was opened."""
        return self._port.report.error_frames

    def run(self, session: Session) -> None:
        """Until the session is done."""
        while not session.done:
            self.turn(session)

    def turn(self, session: Session) -> None:
        """Wait for a frame TURN_S at most, hand over all that have come, send what the session wants."""
        frame = self._port.receive(TURN_S)
        for _ in range(MOST_FRAMES):
            if frame is None:
                break
            now_s = time.monotonic()
            if not self._is_own(frame, now_s):
                session.on_frame(frame, now_s)
            frame = self._port.receive(0.0)
        now_s = time.monotonic()
        for out in session.tick(now_s):
            self._send(out, now_s)

    def _is_own(self, frame: Frame, now_s: float) -> bool:
        return self._echo is not None and self._echo.is_own(frame, now_s)

    def _send(self, frame: Frame, now_s: float) -> None:
        if self._echo is not None:
            self._echo.sent(frame, now_s)
        self._port.send(frame)
