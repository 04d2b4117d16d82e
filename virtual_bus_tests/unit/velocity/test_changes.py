"""What mux and filter tell: who drives and why not, locks, and how grave a stop is."""

from __future__ import annotations

from dataclasses import replace

import pytest

from canbase_config.mux import MuxLock, MuxSource
from canbase_runtime.log_priority import Priority
from canbase_runtime.stop_cause import StopCause
from canbase_velocity.changes import DropTeller, Repeats, changed_order, changes, is_told
from canbase_velocity.decision import Action, Decision
from canbase_velocity.safety_filter import ScanState
from canbase_velocity.twist import ZERO, Twist
from support.mux_world import rested

SOURCES = {
    "joy": MuxSource(topic="cmd_vel_joy", priority=100, timeout_s=0.3),
    "nav": MuxSource(topic="cmd_vel_nav", priority=10, timeout_s=0.5),
}
LOCKS = {"gate": MuxLock(topic="gate", priority=50, required=False)}
FORWARD = Twist(0.5, 0.0)


def test_from_first_command_to_silence() -> None:
    mux = rested(SOURCES, LOCKS)
    nobody = mux.decide(0.0)
    mux.accept_command("nav", FORWARD, 1.0)
    nav = mux.decide(1.0)
    silent = mux.decide(1.6)

    assert list(changes(nobody, nav)) == [
        ("nav drives; before: none", Priority.INFO, {"active": "nav", "before": ""}),
    ]
    assert list(changes(nav, mux.decide(1.4))) == []
    ((sentence, priority, fields),) = changes(nav, silent)
    assert sentence == "no active source; before: nav (no message for 0.60 s (timeout 0.50 s))"
    assert (priority, fields) == (Priority.INFO, {"active": "", "before": "nav"})


def test_a_source_that_is_slower_than_its_timeout_does_not_flood_the_log() -> None:
    mux, repeats = rested(SOURCES, LOCKS), Repeats()
    before, written = mux.decide(0.0), []
    for tenth in range(10, 610):  # a message each 0.7 s, its timeout is 0.5 s
        now_s = tenth / 10.0
        if tenth % 7 == 0:
            mux.accept_command("nav", FORWARD, now_s)
        now = mux.decide(now_s)
        written += [sentence for sentence, _, _ in repeats.thinned(changes(before, now), now_s)]
        before = now

    assert written[0] == "nav drives; before: none"
    assert 2 * 11 <= len(written) <= 2 * 12  # of each kind six at once, then one each 10 s
    assert "times more since the last such line)" in written[-1]
    gate = [("lock gate holds", Priority.NOTICE, {"lock": "gate", "lock_holds": "true"})]
    assert list(repeats.thinned(iter(gate), 61.0)) == gate


def test_a_lock_is_a_notice_and_so_is_what_it_takes_away() -> None:
    mux = rested(SOURCES, LOCKS)
    mux.accept_command("nav", FORWARD, 1.0)
    nav = mux.decide(1.0)
    mux.on_lock("gate", True, 1.1)
    locked = mux.decide(1.1)
    mux.on_lock("gate", False, 1.2)
    free = mux.decide(1.2)

    (lock, lost) = changes(nav, locked)
    assert lock == ("lock gate holds", Priority.NOTICE, {"lock": "gate", "lock_holds": "true"})
    assert (lost[0].startswith("no active source; before: nav ("), lost[1]) == (True, Priority.NOTICE)
    assert "gate" in lost[0]
    assert list(changes(locked, free)) == [
        ("lock gate is free", Priority.NOTICE, {"lock": "gate", "lock_holds": "false"}),
        ("nav drives; before: none", Priority.INFO, {"active": "nav", "before": ""}),
    ]


def test_a_source_that_is_not_followed_is_a_notice_with_what_it_waits_for() -> None:
    mux = rested(SOURCES, LOCKS)
    nobody = mux.decide(0.9)
    mux.on_estop(False)
    mux.accept_command("joy", FORWARD, 1.0)
    held = mux.decide(1.0)
    mux.on_estop(True)
    mux.accept_command("joy", ZERO, 1.2)
    released = mux.decide(1.2)

    ((sentence, priority, fields),) = changes(nobody, held)
    assert sentence.startswith("joy is not followed: waiting for zero")
    assert (priority, fields) == (Priority.NOTICE, {"active": "joy", "before": ""})
    assert [sentence for sentence, _, _ in changes(held, released)] == ["joy drives"]


@pytest.mark.parametrize("cause", StopCause)
@pytest.mark.parametrize("action", Action)
def test_only_a_stop_that_is_not_the_filters_daily_work_is_a_warning(action: Action, cause: StopCause) -> None:
    daily = {
        StopCause.OBSTACLE: Priority.NOTICE,
        StopCause.OBSTACLE_NEAR: Priority.NOTICE,
        StopCause.SHUTDOWN: Priority.INFO,
    }
    expected = {Action.STOP: daily.get(cause, Priority.WARNING)}.get(action, Priority.INFO)

    sentence, priority, fields = changed_order(Decision(action, cause, "at 0.31 m", "it being gone", ZERO))

    assert sentence == f"{action.name} {cause.value} at 0.31 m"
    assert priority is expected
    assert fields == {
        "action": action.name,
        "cause": cause.value,
        "clears_on": "it being gone",
        "emergency": "false",
    }


def decision(action: Action, cause: StopCause, *, emergency: bool = False) -> Decision:
    return Decision(action, cause, "", "", ZERO, emergency)


LIMITED = decision(Action.LIMIT, StopCause.SPEED)
FREE = decision(Action.PASS, StopCause.NONE)
PRESSED = decision(Action.STOP, StopCause.ESTOP, emergency=True)


@pytest.mark.parametrize(
    ("before", "now", "told"),
    [
        (LIMITED, PRESSED, True),  # an emergency stop while the speed was limited
        (PRESSED, LIMITED, True),
        (FREE, PRESSED, True),
        (decision(Action.STOP, StopCause.SCAN_STALE), PRESSED, True),
        (FREE, decision(Action.SLOW, StopCause.OBSTACLE_NEAR), True),
        (FREE, LIMITED, False),  # comes and goes with each command
        (LIMITED, decision(Action.LIMIT, StopCause.ZONE), False),
        (LIMITED, decision(Action.SLOW, StopCause.OBSTACLE_NEAR), False),
        (FREE, decision(Action.PASS, StopCause.NONE, emergency=True), True),  # brakes hard under a zero command
        (decision(Action.PASS, StopCause.NONE, emergency=True), FREE, False),
        (PRESSED, PRESSED, False),
    ],
)
def test_each_stop_is_told_also_one_that_ends_or_follows_a_speed_limit(
    before: Decision, now: Decision, told: bool
) -> None:
    assert is_told(before, now) is told


def test_hard_braking_is_in_the_sentence_and_in_the_fields() -> None:
    sentence, priority, fields = changed_order(decision(Action.PASS, StopCause.NONE, emergency=True))
    assert (sentence, priority, fields["emergency"]) == ("PASS none brakes hard", Priority.NOTICE, "true")


def test_scans_that_are_dropped_are_told_once_for_each_reason_and_again_after_ten_seconds() -> None:
    sound = ScanState("scan", True, 0.3, 0.1)
    invalid = replace(sound, cause=StopCause.SCAN_INVALID, dropped=3, why_dropped="it has no readings")
    frozen = replace(sound, cause=StopCause.SCAN_FROZEN, dropped=9, problem="the same 360 readings for 0.5 s, 6 scans")
    drops = DropTeller()
    assert list(drops.news([sound], 0.0)) == []
    ((sentence, priority, fields),) = drops.news([invalid], 0.1)
    assert sentence == "scans of scan are dropped, 3 so far: it has no readings"
    assert (priority, fields) == (Priority.WARNING, {"topic": "scan", "cause": "scan_invalid"})
    assert list(drops.news([invalid], 0.2)) == []
    assert list(drops.news([sound], 0.3)) == []  # one that comes and goes does not fill the log
    assert list(drops.news([invalid], 0.4)) == []
    assert [told[2]["cause"] for told in drops.news([frozen], 0.5)] == ["scan_frozen"]
    assert list(drops.news([frozen], 10.4)) == []
    assert len(list(drops.news([frozen], 10.5))) == 1
