"""The log entries of mux and filter for each changed decision: sentence, severity, fields (docs/troubleshooting.md)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from canbase_runtime.log_budget import LogBudget
from canbase_runtime.log_priority import Priority
from canbase_runtime.source_standing import IGNORED, SourceStanding
from canbase_runtime.stop_cause import StopCause
from canbase_velocity.decision import Action, Decision
from canbase_velocity.mux import MuxDecision
from canbase_velocity.safety_filter import ScanState

LogLine = tuple[str, Priority, dict[str, str]]

AGAIN_S: Final = 10.0
"""What goes on all the time, such as scans that are dropped, is reported again after this time [s]."""
REPEATS: Final = 6.0
"""So many times a change of the mux is reported before it counts as going on all the time."""
STOP_PRIORITY: Final = {
    StopCause.OBSTACLE: Priority.NOTICE,
    StopCause.OBSTACLE_NEAR: Priority.NOTICE,
    StopCause.SHUTDOWN: Priority.INFO,
}
"""Of a stop. An obstacle is what the filter is for; each other cause is one that somebody should look at."""


def changes(before: MuxDecision, now: MuxDecision) -> Iterator[LogLine]:
    """Locks that hold or release, and the source that drives. A source that lost the base to a lock is a notice, as is
    one that is not followed.
    """
    held = {lock.name: lock.holds for lock in before.locks}
    for lock in now.locks:
        if lock.holds != held[lock.name]:
            sentence = f"lock {lock.name} {lock.reason}" if lock.holds else f"lock {lock.name} is free"
            yield sentence, Priority.NOTICE, {"lock": lock.name, "lock_holds": str(lock.holds).lower()}
    ignored = now.holder is not None and now.holder.standing in IGNORED
    if ignored and _standing(now) is not _standing(before):
        yield now.sentence, Priority.NOTICE, {"active": now.active or "", "before": before.active or ""}
    elif now.active != before.active or (_standing(before) in IGNORED and not ignored):
        lost = next((source for source in now.sources if source.name == before.active), None)
        why = f" ({lost.reason})" if lost is not None and lost.reason else ""
        locked = lost is not None and lost.standing is SourceStanding.LOCKED
        other = now.active != before.active
        sentence = f"{now.sentence}; before: {before.active or 'none'}{why}" if other else now.sentence
        fields = {"active": now.active or "", "before": before.active or ""}
        yield sentence, Priority.NOTICE if locked else Priority.INFO, fields


class Repeats:
    """Thins out the lines of a source that is slower than its timeout, or of a lock that is set again and again."""

    def __init__(self) -> None:
        self._budgets: dict[tuple[str, ...], LogBudget] = {}

    def thinned(self, lines: Iterator[LogLine], now_s: float) -> Iterator[LogLine]:
        """Those to write at `now_s` [s, monotonic]; one that was left out is counted in the next one of its kind."""
        for sentence, priority, fields in lines:
            budget = self._budgets.setdefault(tuple(fields.values()), LogBudget(REPEATS, 1.0 / AGAIN_S))
            omitted = budget.take(now_s)
            if omitted is not None:
                count = f" ({omitted} times more since the last such line)" if omitted else ""
                yield sentence + count, priority, fields


class DropTeller:
    """Reports that scans are dropped and why: at the first one, for another reason, and AGAIN_S later if it goes on."""

    def __init__(self) -> None:
        self._told: dict[str, tuple[StopCause, float]] = {}

    def news(self, scans: Sequence[ScanState], now_s: float) -> Iterator[LogLine]:
        """The report at the time `now_s` [s, monotonic]."""
        for scan in scans:
            why = scan.problem or scan.why_dropped
            cause, told_at = self._told.get(scan.topic, (StopCause.NONE, -math.inf))
            if why and (scan.cause is not cause or now_s - told_at >= AGAIN_S):
                self._told[scan.topic] = scan.cause, now_s
                sentence = f"scans of {scan.topic} are dropped, {scan.dropped} so far: {why}"
                yield sentence, Priority.WARNING, {"topic": scan.topic, "cause": scan.cause.value}


def is_told(before: Decision, now: Decision) -> bool:
    """Whether a log line and a journal entry are due: each change but for speed limits, which come and go all the time.

    A stop that begins or ends, and hard braking that begins, are reported in any case, a speed limit before or after
    it.
    """
    if (now.action, now.cause) == (before.action, before.cause):
        return now.emergency and not before.emergency
    actions = (before.action, now.action)
    return Action.STOP in actions or Action.LIMIT not in actions or (now.emergency and not before.emergency)


def _standing(decision: MuxDecision) -> SourceStanding | None:
    return None if decision.holder is None else decision.holder.standing


def changed_order(now: Decision) -> LogLine:
    """What the filter does from now on, and what ends it."""
    stops = now.action is Action.STOP
    otherwise = Priority.NOTICE if now.emergency else Priority.INFO
    priority = STOP_PRIORITY.get(now.cause, Priority.WARNING) if stops else otherwise
    hard = "brakes hard" if now.emergency and now.cause is not StopCause.OBSTACLE else ""  # there the detail has it
    sentence = " ".join(word for word in (now.action.name, now.cause.value, now.detail, hard) if word)
    fields = {"action": now.action.name, "cause": now.cause.value, "clears_on": now.clears_on}
    return sentence, priority, fields | {"emergency": str(now.emergency).lower()}
