"""Intruders: a second master on the bus, and a node that publishes straight to cmd_vel."""

from __future__ import annotations

import struct

from canbase_campaign.can_bus import CanBus, Receiver, frame_bits
from canbase_campaign.process import Topics
from canbase_config.robot import Robot
from canbase_config.units import mps_per_bit
from canbase_velocity.twist import Twist

BABBLED = 0x001
"""Only NMT has a lower identifier."""
ENABLE = 0x000F
NMT_RESETS = (0x81, 0x82)
"""Reset node, reset communication."""
SETPOINT = {16: struct.Struct("<Hh"), 32: struct.Struct("<Hi")}
VL_RAMP = 0x70
"""Bits 4 to 6 of the controlword: in mode 2 the ramp runs, is not locked, and has the target as its input."""
TWIN_STATUS = struct.pack("<Hi", 0x0637, 0)
"""Operation enabled; position 0."""


class Intruder:
    """Each flag switches one misdeed on; it goes on every `PERIOD_S` until it is switched off."""

    PERIOD_S = 0.01

    def __init__(self, robot: Robot, bus: CanBus, topics: Topics) -> None:
        self._bus, self._clock, self._topics = bus, bus.clock, topics
        self._member = bus.join("intruder", Receiver())
        self._robot = robot
        self.setpoints_mps = 0.0
        """It sends enabling setpoints of this speed and SYNC, as if it were the driver."""
        self.syncs = False
        self.nmt = b""
        """It sends this NMT command again and again."""
        self.twist: Twist | None = None
        """It publishes this to cmd_vel."""
        self.twin = 0
        """It answers as a second drive of this node id: switched on, at a stand."""
        self.babbles = 0.0
        """Share of the bus that it takes with frames of the lowest identifier."""
        self.moves_at = self.resets_at = -1.0
        """When it last sent setpoints or NMT commands, and when an NMT reset: both forget settings, 1016h too."""
        self._act()

    def _act(self) -> None:
        now_s = self._clock.now_s
        if self.nmt:
            self._member.send(0x000, self.nmt)
            self.moves_at = now_s
            self.resets_at = now_s if self.nmt[0] in NMT_RESETS else self.resets_at
        if self.setpoints_mps:
            for drive in self._robot.drives:
                bits = round(self.setpoints_mps / mps_per_bit(drive, self._robot.base.wheel_radius_m))
                word = ENABLE | (VL_RAMP if drive.kind.is_vl else 0)
                data = SETPOINT[drive.kind.layout.target_bits].pack(word, bits)
                self._member.send(0x200 + 0x100 * drive.axis + drive.node_id, data)
            self.moves_at = now_s
        if self.setpoints_mps or self.syncs:
            self._member.send(0x080, b"")
        if self.twin:
            self._member.send(0x180 + self.twin, TWIN_STATUS)
            self._member.send(0x280 + self.twin, bytes(4))
        self._babble()
        if self.twist is not None:
            self._topics.publish("cmd_vel", self.twist)
        self._clock.after(self.PERIOD_S, self._act)

    def _babble(self) -> None:
        if not self.babbles:
            return  # a bus in a small world is infinitely fast: there is no share of it
        for _ in range(round(self.babbles * self.PERIOD_S * self._bus.bitrate / frame_bits(8))):
            self._member.send(BABBLED, bytes(8))
