"""The bench in real time on a python-can bus: one thread, one loop.

While every drive has the bit rate of robot.yaml, one channel suffices. As soon as one has another, each bit rate has
its channel, and `RatedWire` decides what passes.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable

import can

from canbase_config.bit_rate import BIT_RATES
from canbase_sim.control_server import ControlServer
from canbase_sim.frame import Frame
from canbase_sim.rated_bus import RatedBus
from canbase_sim.world.bench import Bench
from canbase_sim.world.rated_wire import RatedWire
from canbase_sim.world.trace import Trace

STEP_S = 0.002
"""Longest wait for a frame, so the longest delay of anything that a drive does by itself."""
SYNC = 0x080
"""CiA 301: COB-ID of SYNC."""
DROPS_TOLD_S = 10.0
SEND_TIMEOUT_S = 0.05
"""A frame that the bus does not take in this time is a bus error."""

log = logging.getLogger(__name__)


class Loop:
    """Moves `bench` with the monotonic clock, and frames between it and `bus`."""

    def __init__(self, bus: RatedBus, bitrate: int, bench: Bench, trace: Trace, control: ControlServer) -> None:
        """`bitrate`: of robot.yaml [bit/s]."""
        self._bus, self._bitrate = bus, bitrate
        self._bench, self._trace, self._control = bench, trace, control
        self._wire = RatedWire(bench, BIT_RATES)
        self._next_step = self._told_drops_at = 0.0
        self.sync_at_s = -math.inf
        """When the last SYNC came, by time.monotonic [s]."""
        self.datagrams_dropped = 0
        """Those that were no CAN frame."""

    def run(self, stopped: Callable[[], bool]) -> None:
        """Until `stopped()` is true. Raises can.CanError when the bus fails."""
        while not stopped():
            received = self._receive()
            now_s = time.monotonic()
            self._trace.tick(now_s)
            if received is not None and _is_ours(received[0]):
                message, bitrate = received
                frame = Frame(message.arbitration_id, bytes(message.data), remote=message.is_remote_frame)
                self._take(frame, bitrate, now_s)
            self._give(now_s)
            if now_s >= self._next_step:
                self._next_step = now_s + STEP_S
                self._control.poll(now_s)
                self._tell_changes()
                if not self._bus.is_rated and any(n.bitrate != self._bitrate for n in self._bench.nodes.values()):
                    self._bus.open_all()

    def _take(self, frame: Frame, bitrate: int, now_s: float) -> None:
        if frame.cob_id == SYNC:
            self.sync_at_s = now_s
        if not self._bus.is_rated:
            self._bench.on_frame(frame, now_s)
            return
        for rate, error, _ in self._wire.on_frame(frame, bitrate, now_s):
            self._send(error, rate, is_error=True)

    def _give(self, now_s: float) -> None:
        if not self._bus.is_rated:
            for frame in self._bench.tick(now_s):
                self._send(frame, self._bitrate)
            return
        for rate, frame, is_error in self._wire.tick(now_s):
            self._send(frame, rate, is_error=is_error)

    def _receive(self) -> tuple[can.Message, int] | None:
        """The next frame, None when none came in STEP_S. Processes may send to the port what is no frame."""
        try:
            return self._bus.receive(STEP_S)
        except can.CanOperationError as error:
            # python-can names the reason as the cause; where the bus itself fails, that is an OSError or none.
            if isinstance(error.__cause__, OSError | None):
                raise
        self.datagrams_dropped += 1
        if time.monotonic() >= self._told_drops_at + DROPS_TOLD_S:
            self._told_drops_at = time.monotonic()
            log.warning("dropped what is no CAN frame: %d datagrams since the start", self.datagrams_dropped)
        return None

    def _send(self, frame: Frame, bitrate: int, *, is_error: bool = False) -> None:
        message = can.Message(
            arbitration_id=frame.cob_id,
            data=frame.data,
            is_extended_id=frame.extended,
            is_error_frame=is_error,
            check=True,
        )
        self._bus.send(message, bitrate, SEND_TIMEOUT_S)

    def _tell_changes(self) -> None:
        for node_id, producer in self._bench.lost_heartbeats():
            log.info("node %d: %s lost", node_id, f"heartbeat of node {producer}" if producer else "life guarding")
        for c in self._bench.state_changes():
            log.info("node %d axis %d: %s → %s (%d)", c.node_id, c.axis, c.before.name, c.after.name, c.number)


def _is_ours(message: can.Message) -> bool:
    """CANopen uses frames with eleven-bit identifiers. Where our own come back, no node heeds them."""
    kinds = message.is_extended_id or message.is_error_frame or message.is_fd
    return not kinds and type(message.arbitration_id) is int  # python-can lets 1.5 pass
