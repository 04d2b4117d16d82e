"""The watchdog in virtual time: its core with the ticks of its loop; leases come by a queue as from a Unix socket."""

from __future__ import annotations

import math

from canbase_campaign.can_bus import REMOTE, CanBus
from canbase_campaign.clock import FINE, ComputerClock, Pace
from canbase_campaign.disk import StopDisk
from canbase_campaign.process import FRAMES_HELD, Process
from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog.watchdog import Answer, State, Watchdog


class WatchdogProcess(Process):
    """`core` is the real watchdog."""

    name = "watchdog"

    def __init__(self, config: WatchdogConfig, clock: ComputerClock, bus: CanBus, pace: Pace = FINE) -> None:
        super().__init__(clock)
        self._config, self._tick_s = config, pace.watchdog_tick_s
        self._failed_since = math.inf
        self.disk = StopDisk("watchdog")
        """Its record of a trip, which outlives it."""
        self._member = bus.join(self.name, self)
        self.begin()

    def fail_bus(self, fails: bool) -> None:
        """Its adapter takes and gives no frames from now on; or does again."""
        self._failed_since = self.clock.now_s if fails else math.inf

    @property
    def is_deaf(self) -> bool:
        """Its adapter takes and gives no frames."""
        return self._failed_since < math.inf

    @property
    def tripped(self) -> bool:
        """It reports a trip."""
        return self.core.status.state is State.TRIPPED

    @property
    def watching(self) -> bool:
        """It reports that it watches."""
        return self.core.status.state is State.WATCHING

    @property
    def trip_cause(self) -> str:
        """The name of what it has tripped on."""
        return self.core.status.verdict.cause.name.lower()

    @property
    def reset_done(self) -> bool:
        """It accepted the last reset."""
        return self.core.status.reset[1] is Answer.DONE

    def begin(self) -> None:
        """A new core, which knows of a trip before by its record."""
        self.core = Watchdog(self._config, self.clock.now_s, self.disk.found())
        self._suspended_s = self.clock.suspended_s
        self.every(self._tick_s, self._on_tick, phase_s=0.001)

    def end(self) -> None:
        """With a wheel in motion it stops it first."""
        self.core.end(self.clock.now_s)

    def on_lease(self, datagram: bytes) -> None:
        """A datagram arrives at the socket."""
        self.receive("leases", FRAMES_HELD, self._on_lease, datagram)

    def _on_lease(self, datagram: bytes) -> None:
        self.core.on_lease(datagram, None, self.clock.now_s)
        if self.core.has_unreported_flag:  # as loop.py does
            self._on_tick()

    def hear(self, cob_id: int, data: bytes) -> None:
        """A frame on the bus."""
        if self.running:
            self._on_frame(cob_id, data)
        else:
            self.receive("frames", FRAMES_HELD, self._on_frame, cob_id, data)

    def _on_frame(self, cob_id: int, data: bytes) -> None:
        if self._failed_since == math.inf:
            self.core.on_frame(cob_id, data, self.clock.now_s)

    def _look_for_a_suspend(self) -> None:
        before_s, self._suspended_s = self._suspended_s, self.clock.suspended_s
        if self._suspended_s > before_s:
            self.core.on_suspend(self._suspended_s - before_s)

    def _on_tick(self) -> None:
        self._look_for_a_suspend()  # as loop.py does
        self.core.on_bus(self._failed_since, 0)
        for frame in self.core.tick(self.clock.now_s):
            if self._failed_since == math.inf:
                self._member.send(frame.cob_id | REMOTE if frame.remote else frame.cob_id, frame.data)
        self.core.on_record(*self.disk.write(self.core.record))
