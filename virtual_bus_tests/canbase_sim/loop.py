"""The bench in real time on a python-can bus: one thread, one loop."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

import can

from canbase_sim.control_server import ControlServer
from canbase_sim.frame import Frame
from canbase_sim.world.bench import Bench
from canbase_sim.world.trace import Trace

STEP_S = 0.002
"""Longest wait for a frame, so the longest delay of anything that a drive does by itself."""
DROPS_TOLD_S = 10.0
SEND_TIMEOUT_S = 0.05
"""A frame that the bus does not take in this time is a bus error."""

log = logging.getLogger(__name__)


class Loop:
    """Moves `bench` with the monotonic clock, and frames between it and `bus`."""

    def __init__(self, bus: can.BusABC, bench: Bench, trace: Trace, control: ControlServer) -> None:
        self._bus, self._bench, self._trace, self._control = bus, bench, trace, control
        self._next_step = self._told_drops_at = 0.0
        self.datagrams_dropped = 0
        """Those that were no CAN frame."""

    def run(self, stopped: Callable[[], bool]) -> None:
        """Until `stopped()` is true. Raises can.CanError when the bus fails."""
        while not stopped():
            message = self._receive()
            now_s = time.monotonic()
            self._trace.tick(now_s)
            if message is not None and _is_ours(message):
                self._bench.on_frame(Frame(message.arbitration_id, bytes(message.data)), now_s)
            for frame in self._bench.tick(now_s):
                self._send(frame)
            if now_s >= self._next_step:
                self._next_step = now_s + STEP_S
                self._control.poll(now_s)
                self._tell_changes()

    def _receive(self) -> can.Message | None:
        """The next frame, None when none came in STEP_S. Processes may send to the port what is no frame."""
        try:
            return self._bus.recv(STEP_S)
        except can.CanOperationError as error:
            # python-can names the reason as the cause; where the bus itself fails, that is an OSError or none.
            if isinstance(error.__cause__, OSError | None):
                raise
        self.datagrams_dropped += 1
        if time.monotonic() >= self._told_drops_at + DROPS_TOLD_S:
            self._told_drops_at = time.monotonic()
            log.warning("dropped what is no CAN frame: %d datagrams since the start", self.datagrams_dropped)
        return None

    def _send(self, frame: Frame) -> None:
        message = can.Message(arbitration_id=frame.cob_id, data=frame.data, is_extended_id=frame.extended, check=True)
        self._bus.send(message, timeout=SEND_TIMEOUT_S)

    def _tell_changes(self) -> None:
        for node_id, producer in self._bench.lost_heartbeats():
            log.info("node %d: heartbeat of node %d lost", node_id, producer)
        for c in self._bench.state_changes():
            log.info("node %d axis %d: %s → %s (%d)", c.node_id, c.axis, c.before.name, c.after.name, c.number)


def _is_ours(message: can.Message) -> bool:
    """CANopen uses data frames with eleven-bit identifiers. Where our own come back, no node heeds them."""
    kinds = message.is_extended_id or message.is_remote_frame or message.is_error_frame or message.is_fd
    return not kinds and type(message.arbitration_id) is int  # python-can lets 1.5 pass
