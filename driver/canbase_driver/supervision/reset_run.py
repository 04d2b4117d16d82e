"""The reset on its way, its request to the watchdog, and the waiting caller. The sequence: `fault_reset.py`."""

from __future__ import annotations

from collections.abc import Callable

from canbase_driver.cia301.frame import Frame
from canbase_driver.supervision.fault_reset import RequestOutcome, Reset, ResetPhase, refusal
from canbase_driver.supervision.situation import Situation
from canbase_driver.supervision.watchdog_link import WatchdogLink
from canbase_runtime.driver_state import DriverState

OnOutcome = Callable[[RequestOutcome], None]

STOOD_STILL_S = 0.5
"""Two steps that are further apart: the process stood still between them, and the caller may be gone."""


class ResetRun:
    """At most one at a time; its caller gets exactly one outcome."""

    def __init__(self, watchdog: WatchdogLink, cycle_s: float, boot_s: float) -> None:
        self._watchdog = watchdog
        self._cycle_s, self._boot_s = cycle_s, boot_s
        self._sequence: Reset | None = None
        self._stepped_at = 0.0
        self._request = Frame(0, b"")
        self._on_outcome: OnOutcome = lambda _outcome: None

    @property
    def runs(self) -> bool:
        """One is under way."""
        return self._sequence is not None

    @property
    def fault_reset_bit(self) -> bool:
        """Bit 7 of the controlword of the drives in fault, in this cycle."""
        return self._sequence is not None and self._sequence.fault_reset_bit

    def begin(self, situation: Situation, state: DriverState, now_s: float, on_outcome: OnOutcome) -> bool:
        """Whether it begins; `on_outcome` is called at once when it is refused."""
        refused = refusal(situation, state)
        if refused is not None:
            on_outcome(RequestOutcome(False, refused))
            return False
        self._sequence, self._stepped_at = Reset(now_s, self._cycle_s, self._boot_s), now_s
        self._request, self._on_outcome = self._watchdog.request_reset(), on_outcome
        return True

    def step(self, situation: Situation, now_s: float) -> tuple[list[Frame], RequestOutcome | None]:
        """Once a cycle: what to send, and the outcome, which the caller hands to `end`."""
        if self._sequence is None:
            return [], None
        pause_s, self._stepped_at = now_s - self._stepped_at, now_s
        if pause_s > STOOD_STILL_S:
            return [], RequestOutcome(False, f"broken off: motor_driver did not run for {pause_s:.1f} s; reset again")
        outcome = self._sequence.step(situation, self._watchdog.answer(), now_s)
        asks = outcome is None and self._sequence.phase is ResetPhase.WATCHDOG
        return [self._request] if asks else [], outcome

    def end(self, outcome: RequestOutcome) -> None:
        """It is over, or broken off; does nothing when none is under way."""
        if self._sequence is not None:
            self._sequence = None
            self._on_outcome(outcome)
