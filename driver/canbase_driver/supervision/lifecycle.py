"""How far the driver may go: nothing on the bus, drives booted, drives with power. ROS's lifecycle sets it.

RELEASED ──configure──► CONFIGURED ──activate──► ACTIVE      one change at a time; a change that fails is taken back,
   ▲ └────cleanup───────────┘ └──────deactivate────┘         but none that takes power away: a stop goes on.

What is aimed at is the state of the lifecycle: ROS shows it (`managed_node.py`), and owns none of its own.

Rules. What is aimed at holds at once: less than ACTIVE is a reason to stop (`state_machine.py`), and RELEASED follows
only when nothing has power. A latched stop outlives every change: `reset` alone ends it. What an operator switched off
stays off over restarts: `allowed` is part of the record on disk (`latch.py`). Pure: time is an argument.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from canbase_config.robot import Robot
from canbase_config.stopping import given_up_s
from canbase_driver.causes import Finding
from canbase_driver.supervision.fault_reset import RequestOutcome
from canbase_driver.supervision.phases import NO_POWER
from canbase_driver.supervision.situation import Situation
from canbase_driver.supervision.state_machine import ENABLE_TIMEOUT_S, POWER_OFF_TIMEOUT_S
from canbase_runtime.driver_state import DriverState

MARGIN_S = 1.0
"""On top of the times of what is waited for."""


class Aim(IntEnum):
    """How far the driver goes."""

    RELEASED = 0
    """It sends nothing."""
    CONFIGURED = 1
    """Drives are booted and send feedback, and have no power."""
    ACTIVE = 2
    """Drives get power as soon as nothing forbids it, and follow commands."""


@dataclass(frozen=True, slots=True)
class _Change:
    before: Aim
    allowed_before: Aim
    until: float
    on_outcome: Callable[[RequestOutcome], None]


class Lifecycle:
    """What is aimed at, and the change on its way there."""

    def __init__(self, robot: Robot, aim: Aim, allowed: Aim = Aim.ACTIVE) -> None:
        """`aim`: of a start. `allowed`: as an operator left it before the start."""
        timeouts = robot.timeouts
        self.aim = min(aim, allowed)
        self.allowed = allowed
        """How far it may go after a restart: less than ACTIVE once an operator has switched it off."""
        self._kept_off = self.aim < aim
        self.released = self.aim is Aim.RELEASED
        """Nothing is sent: never configured, or cleaned up again."""
        self._change: _Change | None = None
        stop_s = given_up_s(robot) + POWER_OFF_TIMEOUT_S
        self._timeout_s = {
            Aim.RELEASED: stop_s + MARGIN_S,
            Aim.CONFIGURED: max(timeouts.boot_s, stop_s) + MARGIN_S,
            Aim.ACTIVE: ENABLE_TIMEOUT_S + MARGIN_S,
        }

    @property
    def unconfigured(self) -> str:
        """A sentence while drives must not be booted; else empty."""
        return f"lifecycle: unconfigured{self._since}" if self.aim is Aim.RELEASED else ""

    @property
    def inactive(self) -> str:
        """A sentence while drives must not have power; else empty."""
        return "" if self.aim is Aim.ACTIVE else f"lifecycle: not active{self._since}"

    @property
    def _since(self) -> str:
        return ", switched off by an operator before this start" if self._kept_off else ""

    def request(self, aim: Aim, now_s: float, on_outcome: Callable[[RequestOutcome], None]) -> None:
        """Aim at that; `on_outcome` is called once, when it is there or has failed."""
        if self._change is not None:
            on_outcome(RequestOutcome(False, f"refused: a change to {self.aim.name} is under way"))
            return
        self._change = _Change(self.aim, self.allowed, now_s + self._timeout_s[aim], on_outcome)
        if aim <= self.aim:
            self.allowed = min(self.allowed, aim)
        self.aim, self._kept_off = aim, self._kept_off and aim is not Aim.ACTIVE
        self.released = self.released and aim is Aim.RELEASED

    def step(
        self, situation: Situation, state: DriverState, finding: Finding, now_s: float, unrecorded: str = ""
    ) -> bool:
        """Once a cycle, after the state machine. True: the drives are to be released now. `unrecorded`: why `allowed`
        is not on disk; a change is done only when it is."""
        releases = self.aim is Aim.RELEASED and not self.released and state in NO_POWER and not situation.powered
        self.released = self.released or releases
        change = self._change
        if change is not None:
            outcome = self._outcome(change, situation, state, finding, now_s, unrecorded)
            if outcome is not None:
                self._end(change, outcome)
        return releases

    def _outcome(
        self,
        change: _Change,
        situation: Situation,
        state: DriverState,
        finding: Finding,
        now_s: float,
        unrecorded: str,
    ) -> RequestOutcome | None:
        there = self._there(change, situation, state)
        if there and self.allowed < self.aim:  # an activation that fails leaves the record as it was
            self.allowed = self.aim
            return None
        if there and unrecorded and now_s > change.until:
            return RequestOutcome(False, f"{self.aim.name.lower()}, and a restart may not keep it: {unrecorded}")
        if there and not unrecorded:
            return RequestOutcome(True, f"{self.aim.name.lower()} ({state.name.lower()}, {finding.cause.value})")
        hopeless = self.aim is Aim.ACTIVE and state is DriverState.LATCHED
        if not there and (hopeless or now_s > change.until):
            ends = f"; ends with: {finding.clears_on}" if finding.clears_on else ""
            return RequestOutcome(
                False, f"not {self.aim.name.lower()}: {finding.cause.value} {finding.detail}".rstrip() + ends
            )
        return None

    def _there(self, change: _Change, situation: Situation, state: DriverState) -> bool:
        if self.aim is Aim.RELEASED:
            return self.released
        if self.aim is Aim.ACTIVE:
            return state is DriverState.ENABLED
        if change.before is Aim.ACTIVE:
            return state in NO_POWER and not situation.powered
        return not (situation.unready or situation.missing or situation.bus)

    def _end(self, change: _Change, outcome: RequestOutcome) -> None:
        self._change = None
        if not outcome.done and self.aim > change.before:
            self.aim, self.allowed = change.before, change.allowed_before
        change.on_outcome(outcome)
