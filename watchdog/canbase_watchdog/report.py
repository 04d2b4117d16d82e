"""The watchdog's log and its notifications to systemd: one line per change with the values, never one per cycle."""

from __future__ import annotations

import enum
import logging

from canbase_base.sd_notify import notify
from canbase_watchdog import policy
from canbase_watchdog.bus_health import BusHealth
from canbase_watchdog.watchdog import Answer, State, Status, Watchdog

COUNTERS_PERIOD_S = 10.0
ALIVE_PERIOD_S = 0.2

ASSUMED = "standstill is assumed, not measured: a sensor is not trusted, and the power has been off long enough"
UNPROVEN = (
    "%s stopped faster than a wheel can: it met something hard, or its encoder is dead; a reset is refused until it is "
    "turned by hand, or its power has been off for as long as it may roll"
)

_log = logging.getLogger("canbase.watchdog")


class Reporter:
    """Compares with its last report."""

    def __init__(self, watchdog: Watchdog) -> None:
        """Reports about this watchdog."""
        self._watchdog = watchdog
        self._status: Status | None = None
        self._counters: dict[str, int] = {}
        self._counters_due = self._alive_due = 0.0
        self._stood = False
        """That all drives stand is reported once for each trip: drives may be lost and found again until the reset."""

    def tick(self, health: BusHealth, now_s: float, datagrams_dropped: int = 0) -> None:
        """Report what changed. systemd learns that the loop turns, also on a bus that takes no frames."""
        if self._watchdog.status != self._status:
            self._log_status(self._watchdog.status)
        if now_s >= self._alive_due:
            self._alive_due = now_s + ALIVE_PERIOD_S
            notify("WATCHDOG=1")
        if now_s >= self._counters_due:
            self._log_counters(health, now_s, datagrams_dropped)

    def _log_status(self, status: Status) -> None:
        old, self._status = self._status, status
        if old is None or (old.state, old.verdict) != (status.state, status.verdict):
            text = _state_line(status)
            _log.log(logging.WARNING if status.state is State.TRIPPED else logging.INFO, text)
            notify(f"STATUS={text}")
        if status.state is State.TRIPPED and old is not None:
            _log_ladder(old, status)
            if status.settled and not old.settled and not self._stood:
                _log.warning(ASSUMED if status.assumed else "all drives at standstill")
                self._stood = True
        if status.state is not State.TRIPPED:
            self._stood = False
        number, answer = status.reset
        if answer is not Answer.NONE and (old is None or old.reset != status.reset):
            _log.info("reset request %d: %s", number, _words(answer))

    def _log_counters(self, health: BusHealth, now_s: float, datagrams_dropped: int) -> None:
        counters = {
            "send errors": health.send_errors,
            "receive errors": health.receive_errors,
            "error frames": health.error_frames,
            "datagrams that are no frame": datagrams_dropped,
            "frames not understood": self._watchdog.dropped_frames,
        }
        counters |= {f"leases refused, {why.value}": n for why, n in self._watchdog.refused_leases.items()}
        changed = {name: n for name, n in counters.items() if n != self._counters.get(name, 0)}
        if not changed:
            return
        self._counters, self._counters_due = counters, now_s + COUNTERS_PERIOD_S
        _log.warning("since the start: %s", "; ".join(f"{name}: {n}" for name, n in changed.items()))


def _words(name: enum.Enum) -> str:
    return name.name.lower().replace("_", " ")


def _log_ladder(old: Status, status: Status) -> None:
    if old.step is not status.step:
        _log.warning("ladder: %s", _words(status.step))
    if status.unproven and status.unproven != old.unproven:
        _log.warning(UNPROVEN, status.unproven)


def _state_line(status: Status) -> str:
    if status.state is not State.TRIPPED:
        return _words(status.state)
    cause = _words(status.verdict.cause)
    about = f", node {status.verdict.node_id}" if status.verdict.node_id else ""
    clears = policy.clears_on(status.verdict)
    needs = f"a reset needs standstill, zero velocity ordered, and: {clears}"
    return f"tripped: {cause}{about}: {status.verdict.detail}; {needs}"
