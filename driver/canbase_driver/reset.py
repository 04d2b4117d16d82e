"""One reset on its way: the watchdog first, then the drives, then the supervisor. It never gives power to anything.

Rules: refused while a velocity is commanded, while a wheel turns, or while the bus or the watchdog is dead. Each step
has a deadline; the sentence of a failed reset says which step failed and what to do. Pure: time is an argument.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from canbase_driver.snapshot import WatchdogView
from canbase_driver.supervisor import Situation
from canbase_driver.watchdog_link import ACCEPTED, ANSWERS

WATCHDOG_TIMEOUT_S = 0.5
DRIVES_TIMEOUT_S = 10.0
EDGE_S = 0.05
"""How long bit 7 of the controlword stays 0, then 1: some drives sample it in a slow loop, after several PDOs."""
FAULT_TIMEOUT_S = 1.0


class Phase(Enum):
    """Where the reset is."""

    WATCHDOG = "waiting for the watchdog"
    DRIVES = "waiting for the drives to boot"
    EDGE_LOW = "fault reset bit low"
    EDGE_HIGH = "fault reset bit high"
    FAULTS = "waiting for the faults to clear"


@dataclass(frozen=True, slots=True)
class Outcome:
    """How it ended."""

    done: bool
    sentence: str


def refusal(situation: Situation, stopped: bool) -> str | None:
    """Why a reset may not even begin; None when it may. `stopped`: the supervisor has taken all power away."""
    if not stopped:
        return "there is power on the drives: stop first (service motor_driver/stop)"
    if situation.commanded:
        return f"refused: {situation.commanded}; let go of the joystick or cancel the goal first"
    if not situation.standstill and not situation.silent and not situation.absent:
        return "refused: a wheel turns"
    if situation.bus:
        return f"refused: {situation.bus}"
    if situation.watchdog is WatchdogView.MISSING:
        return f"refused: watchdog {situation.watchdog_detail}"
    return None


class Reset:
    """The sequence, stepped once a cycle until `outcome` is there."""

    def __init__(self, now: float) -> None:
        self.phase = Phase.WATCHDOG
        self.outcome: Outcome | None = None
        self._since_s = now

    @property
    def asks_watchdog(self) -> bool:
        """The core shall send the reset request to the watchdog in this cycle."""
        return self.phase is Phase.WATCHDOG and self.outcome is None

    @property
    def fault_reset_bit(self) -> bool:
        """Bit 7 of the controlword of the drives in fault, in this cycle."""
        return self.phase is Phase.EDGE_HIGH and self.outcome is None

    def step(self, situation: Situation, answer: int | None, now: float) -> None:
        """Judge the situation and move on. `answer`: the watchdog's answer to our request, None while there is none."""
        elapsed_s = now - self._since_s
        if situation.commanded:
            self._fail(f"refused: {situation.commanded}")
        elif self.phase is Phase.WATCHDOG:
            self._watchdog(situation, answer, elapsed_s, now)
        elif self.phase is Phase.DRIVES:
            self._drives(situation, elapsed_s, now)
        elif self.phase is Phase.EDGE_LOW and elapsed_s >= EDGE_S:
            self._go(Phase.EDGE_HIGH, now)
        elif self.phase is Phase.EDGE_HIGH and elapsed_s >= EDGE_S:
            self._go(Phase.FAULTS, now)
        elif self.phase is Phase.FAULTS:
            self._faults(situation, elapsed_s)

    def _watchdog(self, situation: Situation, answer: int | None, elapsed_s: float, now: float) -> None:
        if answer is not None and answer not in ACCEPTED:
            self._fail(f"the watchdog refused: {ANSWERS.get(answer, f'answer {answer}')}")
        elif answer is not None and situation.watchdog is WatchdogView.OK:
            self._go(Phase.DRIVES, now)
        elif elapsed_s > WATCHDOG_TIMEOUT_S:
            self._fail(f"the watchdog did not answer within {WATCHDOG_TIMEOUT_S} s; is it running?")

    def _drives(self, situation: Situation, elapsed_s: float, now: float) -> None:
        waiting = situation.booting or situation.absent or situation.silent
        if not waiting:
            self._go(Phase.EDGE_LOW if situation.fault else Phase.FAULTS, now)
        elif elapsed_s > DRIVES_TIMEOUT_S:
            self._fail(f"{waiting}; check its power and its cable, then reset again")

    def _faults(self, situation: Situation, elapsed_s: float) -> None:
        if not situation.fault:
            self.outcome = Outcome(True, "reset done; the drives get power once the command is zero")
        elif elapsed_s > FAULT_TIMEOUT_S:
            self._fail(f"{situation.fault}: it does not clear; remove its cause, then reset again")

    def _go(self, phase: Phase, now: float) -> None:
        self.phase, self._since_s = phase, now

    def _fail(self, sentence: str) -> None:
        self.outcome = Outcome(False, sentence)
