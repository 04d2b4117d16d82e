"""The safety filter over time: what came in when, and the emergency stop's memory. Deciding is safety_filter.py."""

from __future__ import annotations

from canbase_velocity.clearance import FREE, Clearances
from canbase_velocity.decision import Action, Decision
from canbase_velocity.safety_filter import FilterConfig, Inputs, decide, estop_holds
from canbase_velocity.twist import ZERO, Twist


class SafetyFilter:
    """Keeps the newest of each input. Starts with nothing received: that is a stop for everything required."""

    def __init__(self, config: FilterConfig) -> None:
        self._config = config
        self._command = ZERO
        self._command_at_s: float | None = None
        self._clearances = FREE
        self._scan_at_s: float | None = None
        self._estop = False
        self._estop_at_s: float | None = None
        self._awaits_zero = False
        self._stopped = True

    def on_command(self, twist: Twist, now: float) -> None:
        """Takes a command of cmd_vel_mux, also one with NaN: that stops."""
        self._command, self._command_at_s = twist, now

    def on_scan(self, clearances: Clearances, now: float) -> None:
        """Takes the clearances of a scan that says something."""
        self._clearances, self._scan_at_s = clearances, now

    def on_estop(self, pressed: bool, now: float) -> None:
        """Takes a message of the emergency stop: true = stop."""
        self._estop, self._estop_at_s = pressed, now
        self._awaits_zero = self._awaits_zero or pressed

    def inputs(self, now: float) -> Inputs:
        """What is known at time `now` [s, monotonic]."""
        return Inputs(
            command=self._command,
            command_age_s=_age_s(self._command_at_s, now),
            clearances=self._clearances,
            scan_age_s=_age_s(self._scan_at_s, now),
            estop=self._estop,
            estop_age_s=_age_s(self._estop_at_s, now),
            awaits_zero=self._awaits_zero,
        )

    def decide(self, now: float) -> Decision:
        """The order at time `now` [s, monotonic]."""
        self._remember_estop(now)
        return decide(self.inputs(now), self._config)

    def begins_stop(self, decision: Decision) -> bool:
        """Whether `decision`, the newest, is the beginning of a stop that a command to move ran into."""
        begins = decision.action is Action.STOP and not self._stopped and not self._command.is_zero
        self._stopped = decision.action is Action.STOP
        return begins

    def _remember_estop(self, now: float) -> None:
        """A fresh zero command counts only while the emergency stop is free."""
        inputs = self.inputs(now)
        age_s = inputs.command_age_s
        if estop_holds(inputs, self._config):
            self._awaits_zero = True
        elif self._command.is_zero and age_s is not None and age_s <= self._config.safety.command_timeout_s:
            self._awaits_zero = False


def _age_s(at_s: float | None, now: float) -> float | None:
    return None if at_s is None else now - at_s
