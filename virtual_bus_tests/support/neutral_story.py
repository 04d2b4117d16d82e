"""A mux with a driver and sources that publish what a test sets, for the neutral start. Times in s."""

from __future__ import annotations

from collections.abc import Mapping

from canbase_config.mux import DEFAULT_SOURCES, MuxSource
from canbase_runtime.driver_state import DriverState
from canbase_velocity.mux import Mux, MuxDecision
from canbase_velocity.twist import ZERO, Twist

FORWARD = Twist(0.3, 0.0)
STEP_S = 0.02
STATUS_S = 0.1


class Story:
    """A mux at 50 Hz, a driver that publishes its state at 10 Hz, and sources that publish what a test sets."""

    def __init__(self, sources: Mapping[str, MuxSource] = DEFAULT_SOURCES) -> None:
        self.mux = Mux(sources)
        self.now_s = 100.0
        self.driver: DriverState | None = DriverState.ENABLED
        self.estop_free = True
        self.cycles = 0
        self.sends: dict[str, Twist] = {}
        self.ordered: list[Twist] = []
        self._status_due = self.now_s

    def run(self, seconds: float) -> MuxDecision:
        """Let time pass; the last decision."""
        for _ in range(round(seconds / STEP_S)):
            self.now_s += STEP_S
            self.cycles += 2
            if self.driver is not None and self.now_s >= self._status_due:
                self._status_due = self.now_s + STATUS_S
                self.mux.on_driver(self.driver, self.cycles, self.now_s)
            for name, twist in self.sends.items():
                self.mux.accept_command(name, twist, self.now_s)
            decision = self.decide()
        return decision

    def decide(self) -> MuxDecision:
        self.mux.on_estop(self.estop_free)
        decision = self.mux.decide(self.now_s)
        self.ordered.append(decision.twist)
        return decision

    def followed(self, name: str, seconds: float = 0.5) -> bool:
        """It orders motion for a while; whether the base gets it."""
        self.sends = {name: FORWARD}
        return self.run(seconds).twist == FORWARD

    def release(self, name: str = "joystick") -> None:
        self.sends = {name: ZERO}
        self.run(0.1)
