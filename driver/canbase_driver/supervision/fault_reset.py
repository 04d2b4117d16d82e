"""One reset on its way: the watchdog first, then the drives, then their faults. It never gives power to anything.

Rules: refused or broken off while a velocity is commanded, while a wheel turns, or while the bus or the watchdog is
dead. Each step has a deadline; the sentence of a failed reset names the step and the remedy. Pure: time is an
argument.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from canbase_driver.cia402 import FAULT_RESET_CYCLES
from canbase_driver.supervision.phases import NO_POWER
from canbase_driver.supervision.situation import Situation
from canbase_driver.supervision.watchdog_link import ACCEPTED, ANSWERS
from canbase_runtime.driver_state import DriverState
from canbase_runtime.watchdog_view import WatchdogView

WATCHDOG_TIMEOUT_S = 0.5
EDGE_S = 0.05
"""How long bit 7 of the controlword stays 0, then 1, at the first try, and twice as long at each further one: some
drives sample it in a slow loop, after several PDOs."""
FAULT_TIMEOUT_S = 1.0
"""From the edge of bit 7 until the fault has gone."""
FAULT_TRIES = 3
"""After this many edges the reset has failed; it does not go on against a cause that stays."""


class ResetPhase(Enum):
    """Where the reset is, in this order; without a fault the edges are left out."""

    WATCHDOG = "waiting for the watchdog"
    DRIVES = "waiting for the drives to boot"
    EDGE_LOW = "fault reset bit low"
    EDGE_HIGH = "fault reset bit high"
    FAULTS = "waiting for the faults to clear"


@dataclass(frozen=True, slots=True)
class RequestOutcome:
    """How it ended."""

    done: bool
    sentence: str


_BUS_OR_COMMAND: tuple[Callable[[Situation], str], ...] = (
    lambda s: f"{s.commanded}; release the joystick or cancel the goal, then reset" if s.commanded else "",
    lambda s: s.bus,
)
_WATCHDOG: tuple[Callable[[Situation], str], ...] = (
    lambda s: f"watchdog: {s.watchdog_detail}" if s.watchdog is not WatchdogView.OK else "",
)


def _turning(s: Situation) -> str:
    if s.standstill or s.unready:
        return ""
    return f"{s.turning or 'a wheel turns'}; {'then reset again' if s.doubted else 'reset again at standstill'}"


_DRIVES: tuple[Callable[[Situation], str], ...] = (lambda s: s.unready,)

REFUSALS: tuple[Callable[[Situation], str], ...] = (
    lambda s: "motor_driver is shutting down" if s.shutdown_requested else "",
    lambda s: "a reset is under way" if s.resetting else "",
    lambda s: f"{s.unconfigured}; configure it first" if s.unconfigured else "",
    _turning,
    *_BUS_OR_COMMAND,
    lambda s: f"watchdog: {s.watchdog_detail}" if s.watchdog is WatchdogView.MISSING else "",
)
"""Why a reset may not even begin. A drive without messages cannot be seen at standstill; the reset waits for it."""

BREAKS: dict[ResetPhase, tuple[Callable[[Situation], str], ...]] = {
    ResetPhase.WATCHDOG: _BUS_OR_COMMAND,
    ResetPhase.DRIVES: _BUS_OR_COMMAND + _WATCHDOG,
    ResetPhase.EDGE_LOW: _BUS_OR_COMMAND + _WATCHDOG + _DRIVES,
    ResetPhase.EDGE_HIGH: _BUS_OR_COMMAND + _WATCHDOG + _DRIVES,
    ResetPhase.FAULTS: _BUS_OR_COMMAND + _WATCHDOG + _DRIVES,
}
"""What ends a reset in each phase: what an earlier phase has found to be well must stay so."""


def refusal(situation: Situation, state: DriverState) -> str | None:
    """Why a reset may not even begin; None when it may."""
    if state is DriverState.STOPPING:
        return "refused: a stop is under way; reset again when it has ended"
    if state not in NO_POWER:
        return "refused: an enabled robot needs no reset. `canbase stop` takes the power off"
    problem = _first(REFUSALS, situation)
    return f"refused: {problem}" if problem else None


class Reset:
    """The sequence, stepped once a cycle until it has an outcome."""

    def __init__(self, now_s: float, cycle_s: float, boot_s: float) -> None:
        """`cycle_s`: period of the setpoints; each level of the fault reset bit lasts FAULT_RESET_CYCLES at least.

        `boot_s`: how long it waits for drives that boot [s] (timeouts.boot_s).
        """
        self._boot_s = boot_s
        self.phase = ResetPhase.WATCHDOG
        self._edge_s = max(EDGE_S, FAULT_RESET_CYCLES * cycle_s)
        self._since_s = now_s
        self._tries_left = FAULT_TRIES

    @property
    def fault_reset_bit(self) -> bool:
        """Bit 7 of the controlword of the drives in fault, in this cycle."""
        return self.phase is ResetPhase.EDGE_HIGH

    def step(self, situation: Situation, answer: int | None, now_s: float) -> RequestOutcome | None:
        """Judge the situation and move on; the outcome when it has ended.

        `answer`: the watchdog's answer to our request, None while there is none.
        """
        problem = _first(BREAKS[self.phase], situation)
        if problem:
            return RequestOutcome(False, f"broken off: {problem}")
        return RULES[self.phase](self, situation, answer, now_s)

    def _watchdog(self, situation: Situation, answer: int | None, now_s: float) -> RequestOutcome | None:
        if answer is not None and answer not in ACCEPTED:
            cause = situation.watchdog_detail.partition(";")[0]  # clues of the driver follow
            about = f" ({cause})" if cause else ""
            return RequestOutcome(False, f"the watchdog{about} refused: {ANSWERS.get(answer, f'answer {answer}')}")
        if answer is not None and situation.watchdog is WatchdogView.OK:
            self._go(ResetPhase.DRIVES, now_s)
        elif now_s - self._since_s > WATCHDOG_TIMEOUT_S:
            detail = situation.watchdog_detail or "no answer"
            return RequestOutcome(
                False, f"the watchdog is not ready after {WATCHDOG_TIMEOUT_S} s ({detail}); reset again"
            )
        return None

    def _drives(self, situation: Situation, _answer: int | None, now_s: float) -> RequestOutcome | None:
        if not situation.unready:
            self._go(ResetPhase.EDGE_LOW if situation.fault else ResetPhase.FAULTS, now_s)
        elif now_s - self._since_s > self._boot_s:
            return RequestOutcome(False, f"{situation.unready}; remedy that, then reset again")
        return None

    def _edge(self, _situation: Situation, _answer: int | None, now_s: float) -> RequestOutcome | None:
        if now_s - self._since_s >= self._edge_s * 2 ** (FAULT_TRIES - self._tries_left):
            self._go(ResetPhase.EDGE_HIGH if self.phase is ResetPhase.EDGE_LOW else ResetPhase.FAULTS, now_s)
        return None

    def _faults(self, situation: Situation, _answer: int | None, now_s: float) -> RequestOutcome | None:
        if not situation.fault:
            return RequestOutcome(True, "Reset. The drives are enabled once every velocity command is zero")
        if now_s - self._since_s > FAULT_TIMEOUT_S:
            self._tries_left -= 1
            if not self._tries_left:
                return RequestOutcome(
                    False, f"{situation.fault}: it does not clear; remove its cause, then reset again"
                )
            self._go(ResetPhase.EDGE_LOW, now_s)
        return None

    def _go(self, phase: ResetPhase, now_s: float) -> None:
        self.phase, self._since_s = phase, now_s


RULES: dict[ResetPhase, Callable[[Reset, Situation, int | None, float], RequestOutcome | None]] = {
    ResetPhase.WATCHDOG: Reset._watchdog,
    ResetPhase.DRIVES: Reset._drives,
    ResetPhase.EDGE_LOW: Reset._edge,
    ResetPhase.EDGE_HIGH: Reset._edge,
    ResetPhase.FAULTS: Reset._faults,
}
"""What is decided in each phase."""


def _first(checks: tuple[Callable[[Situation], str], ...], situation: Situation) -> str:
    return next((problem for check in checks if (problem := check(situation))), "")
