"""One cable whose members may have different bit rates: which frames pass, and who sees an error frame. Pure.

The rules, from ISO 11898-1: a member receives only what is sent at its own bit rate. At any other rate it sees an
error, and destroys the frame by an error frame. So nothing passes while two nodes have different bit rates. A frame
that no node receives is acknowledged by nobody, and its sender sees an error.

Simpler than a real cable: error frames are not counted, so no node becomes error passive or bus-off, and somebody who
listens at another rate is taken for listen-only: the simulator does not know at which rate others listen.
"""

from __future__ import annotations

from canbase_sim.frame import Frame
from canbase_sim.world.bench import Bench

NO_ACKNOWLEDGE = Frame(0xA0, extended=True)
"""Error frame, class of linux/can/error.h: CAN_ERR_ACK, CAN_ERR_BUSERROR."""
PROTOCOL_ERROR = Frame(0x88, extended=True)
"""CAN_ERR_PROT, CAN_ERR_BUSERROR."""

Sent = tuple[int, Frame, bool]
"""Bit rate [bit/s], frame, whether it is an error frame."""


class RatedWire:
    """The nodes of `bench` on a cable, and others at any of `bitrates` [bit/s]."""

    def __init__(self, bench: Bench, bitrates: tuple[int, ...]) -> None:
        self._bench, self._bitrates = bench, bitrates
        self.destroyed = 0
        """Frames that did not pass."""

    def on_frame(self, frame: Frame, bitrate: int, now_s: float) -> list[Sent]:
        """Somebody sends a frame at this rate; the error frame that he sees, where it does not pass."""
        rates = self._rates()
        if rates == {bitrate}:
            self._bench.on_frame(frame, now_s)
            return []
        self.destroyed += 1
        return [(bitrate, PROTOCOL_ERROR if rates else NO_ACKNOWLEDGE, True)]

    def tick(self, now_s: float) -> list[Sent]:
        """The frames of the nodes at their rates, with the error frames that others see."""
        before = self._rates()
        frames = self._bench.tick_rated(now_s)
        sent: list[Sent] = []
        for bitrate, frame in frames:
            if before == {bitrate}:
                sent.append((bitrate, frame, False))
            else:
                self.destroyed += 1
        if frames:
            seen = {bitrate for bitrate, _, is_error in sent if not is_error}
            sent += [(bitrate, PROTOCOL_ERROR, True) for bitrate in self._bitrates if bitrate not in seen]
        return sent

    def _rates(self) -> set[int]:
        """Bit rates of the nodes that are on the cable now."""
        return {node.bitrate for node in self._bench.nodes.values() if node.bitrate}
