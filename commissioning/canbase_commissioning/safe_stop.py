"""The end of every use of the drives by a tool: one session, the same for all ways out. Pure."""

from __future__ import annotations

import math

from canbase_commissioning.powered_drives import PoweredDrives
from canbase_config.robot import DRIVER_NODE_ID, WATCHDOG_NODE_ID
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import NmtState, heartbeat

PERIOD_S = 0.01


class SafeStop:
    """Quick stop until all stand, voltage off, pre-operational. Needs nothing from the drives to get to its end.

    A session; done after STOP_S and OFF_S at most. Heartbeats go on meanwhile: the drives keep to their ramps.
    """

    STOP_S = 2.0
    OFF_S = 0.1

    def __init__(self, rig: PoweredDrives) -> None:
        self._rig = rig
        self._since = self._off_since = self._cycle_at = math.nan
        self.done = False

    def on_frame(self, frame: Frame, now_s: float) -> None:
        """Take a frame."""
        self._rig.on_frame(frame, now_s)

    def tick(self, now_s: float) -> list[Frame]:
        """The next frames of the stop."""
        rig = self._rig
        rig.now_s = now_s
        if math.isnan(self._since):
            self._since, rig.is_mute = now_s, False
        if now_s - self._cycle_at < PERIOD_S or self.done:
            return []
        self._cycle_at = now_s
        beats = [heartbeat(node_id, NmtState.OPERATIONAL) for node_id in (DRIVER_NODE_ID, WATCHDOG_NODE_ID)]
        if math.isnan(self._off_since) and not self._stands(now_s):
            return [*beats, *rig.stop_frames()]
        if math.isnan(self._off_since):
            self._off_since = now_s
        if now_s - self._off_since < self.OFF_S:
            return [*beats, *rig.off_frames()]
        self.done = True
        return rig.end_frames()

    def _stands(self, now_s: float) -> bool:
        """At least three quick stops, whatever was received."""
        return now_s - self._since > self.STOP_S or (now_s - self._since > 0.05 and self._rig.standing)
