"""Who drives, told as stories with times [s]."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_config.mux import DEFAULT_SOURCES, MuxLock, MuxSource
from canbase_runtime.source_standing import LockStanding, SourceStanding
from canbase_velocity.lock import crowd
from canbase_velocity.mux import Mux, MuxDecision
from canbase_velocity.twist import ZERO, Twist
from canbase_velocity.unexpected_publishers import Foreign
from support.mux_world import rested

SLOW = Twist(0.1, 0.0)
FAST = Twist(0.5, 0.2)
TIMEOUTS_S = {name: source.timeout_s for name, source in DEFAULT_SOURCES.items()}


@pytest.fixture
def mux() -> Mux:
    return rested()


def reasons(decision: MuxDecision) -> dict[str, str]:
    return {source.name: source.reason for source in decision.sources}


def standings(decision: MuxDecision) -> list[SourceStanding]:
    return [source.standing for source in decision.sources]


def test_before_any_command_zero_is_ordered_and_each_source_says_why(mux: Mux) -> None:
    decision = mux.decide(0.0)
    assert decision.active is None
    assert decision.twist == ZERO
    assert reasons(decision) == dict.fromkeys(("joystick", "navigation", "action"), "never received")
    assert [source.age_s for source in decision.sources] == [math.inf] * 3


def test_sources_are_listed_by_falling_priority_whatever_their_order_in_the_file() -> None:
    sources = {
        "low": MuxSource(topic="a", priority=0, timeout_s=0.3),
        "high": MuxSource(topic="b", priority=255, timeout_s=0.3),
        "middle": MuxSource(topic="c", priority=7, timeout_s=0.3),
    }
    assert [source.name for source in rested(sources).decide(0.0).sources] == ["high", "middle", "low"]


def test_priority_0_drives_when_it_is_alone() -> None:
    mux = rested({"low": MuxSource(topic="a", priority=0, timeout_s=0.3)})
    mux.accept_command("low", SLOW, 1.0)
    assert mux.decide(1.0).twist == SLOW


def test_the_joystick_takes_over_at_once_and_gives_back_only_to_a_source_that_still_talks(mux: Mux) -> None:
    mux.accept_command("action", SLOW, 10.0)
    assert mux.decide(10.0).active == "action"
    mux.accept_command("joystick", FAST, 10.1)  # somebody takes the joystick
    decision = mux.decide(10.1)
    assert (decision.active, decision.twist) == ("joystick", FAST)
    assert reasons(decision)["action"] == "joystick has priority"
    mux.accept_command("joystick", ZERO, 10.25)  # let go: it still holds, with zero
    assert mux.decide(10.30) == mux.decide(10.30)
    assert (mux.decide(10.30).active, mux.decide(10.30).twist) == ("joystick", ZERO)
    decision = mux.decide(10.56)  # the joystick is silent; so is the action, whose old command must not come back
    assert (decision.active, decision.twist) == (None, ZERO)
    assert reasons(decision)["joystick"] == "no message for 0.31 s (timeout 0.30 s)"
    assert reasons(decision)["action"] == "no message for 0.56 s (timeout 0.30 s)"
    mux.accept_command("action", SLOW, 10.60)  # a new command of its own
    assert mux.decide(10.60).active == "action"


def test_a_silent_source_is_told_as_silent_though_a_higher_one_drives(mux: Mux) -> None:
    mux.accept_command("navigation", SLOW, 0.0)
    mux.accept_command("joystick", FAST, 0.6)
    assert reasons(mux.decide(0.6))["navigation"] == "no message for 0.60 s (timeout 0.50 s)"


def test_a_lower_source_that_kept_talking_drives_on_with_its_newest_command(mux: Mux) -> None:
    mux.accept_command("joystick", FAST, 0.0)
    mux.accept_command("navigation", SLOW, 0.1)
    mux.accept_command("navigation", Twist(0.3, 0.0), 0.3)
    assert mux.decide(0.3).active == "joystick"
    decision = mux.decide(0.301)
    assert (decision.active, decision.twist) == ("navigation", Twist(0.3, 0.0))


@pytest.mark.parametrize("name", TIMEOUTS_S)
def test_a_source_holds_until_exactly_its_timeout(mux: Mux, name: str) -> None:
    mux.accept_command(name, FAST, 0.0)
    assert mux.decide(TIMEOUTS_S[name]).twist == FAST
    assert mux.decide(math.nextafter(TIMEOUTS_S[name], math.inf)).twist == ZERO


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_a_command_that_is_not_finite_is_refused_counted_and_keeps_nobody_fresh(mux: Mux, number: float) -> None:
    assert mux.accept_command("joystick", FAST, 0.0) is True
    assert mux.accept_command("joystick", Twist(number, 0.0), 0.2) is False
    assert mux.accept_command("joystick", Twist(0.0, number), 0.3) is False
    joystick = mux.decide(0.3).sources[0]
    assert (joystick.received, joystick.refused, joystick.age_s) == (1, 2, 0.3)
    assert mux.decide(0.3).twist == FAST
    assert mux.decide(0.31).active is None


def test_a_source_whose_messages_are_refused_says_why_until_one_is_valid(mux: Mux) -> None:
    mux.refuse("navigation", "1 joints instead of 2")
    never = "never received; its newest message was refused: 1 joints instead of 2"
    assert reasons(mux.decide(0.0))["navigation"] == never
    mux.accept_command("navigation", SLOW, 0.1)
    assert mux.decide(0.1).twist == SLOW
    mux.refuse("navigation", "the speed of left_wheel is nan: NaN or infinity")
    assert mux.decide(0.6).twist == SLOW  # 0.5 s after the valid one: a refused message does not end it ...
    decision = mux.decide(0.61)  # ... and does not refresh it
    assert (decision.active, decision.twist, decision.sources[1].refused) == (None, ZERO, 2)
    assert reasons(decision)["navigation"] == (
        "no message for 0.51 s (timeout 0.50 s); its newest message was refused: the speed of left_wheel is nan: "
        "NaN or infinity"
    )
    mux.accept_command("navigation", SLOW, 0.7)
    assert reasons(mux.decide(1.3))["navigation"] == "no message for 0.60 s (timeout 0.50 s)"


def test_a_source_that_the_configuration_does_not_name_is_our_own_error(mux: Mux) -> None:
    with pytest.raises(KeyError, match="gamepad"):
        mux.accept_command("gamepad", FAST, 0.0)


def test_a_mux_without_sources_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one source"):
        Mux({})


def test_at_shutdown_zero_is_ordered_whoever_wants_to_drive(mux: Mux) -> None:
    mux.accept_command("joystick", FAST, 0.0)
    decision = mux.shutdown(0.1)
    assert (decision.active, decision.twist) == (None, ZERO)
    assert standings(decision) == [SourceStanding.SHUTDOWN] * 3
    assert reasons(decision)["joystick"] == "shutdown"


def test_the_essence_changes_with_the_reason_and_not_with_the_age(mux: Mux) -> None:
    mux.accept_command("navigation", SLOW, 0.0)
    first, later, silent = mux.decide(0.1), mux.decide(0.2), mux.decide(0.6)
    assert first.essence == later.essence
    assert first.essence != silent.essence
    assert standings(first) == [SourceStanding.NEVER_RECEIVED, SourceStanding.FOLLOWED, SourceStanding.NEVER_RECEIVED]
    assert standings(silent) == [SourceStanding.NEVER_RECEIVED, SourceStanding.SILENT, SourceStanding.NEVER_RECEIVED]


PAUSE = MuxLock(topic="pause", priority=60, required=False)
BUTTON = MuxLock(topic="button", priority=255, timeout_s=0.5)


def test_a_lock_holds_back_the_sources_below_it_and_not_those_above() -> None:
    mux = rested(DEFAULT_SOURCES, {"pause": PAUSE})
    mux.accept_command("navigation", SLOW, 0.0)
    assert mux.decide(0.0).active == "navigation"  # a lock that is not required says nothing, and does not hold
    mux.on_lock("pause", True, 0.1)
    decision = mux.decide(0.1)
    assert (decision.active, decision.twist) == (None, ZERO)
    assert reasons(decision) == {
        "joystick": "never received", "navigation": "locked: pause holds", "action": "locked: pause holds",
    }  # fmt: skip
    mux.accept_command("joystick", FAST, 0.2)  # somebody drives it by hand all the same
    assert mux.decide(0.2).active == "joystick"
    mux.on_lock("pause", False, 0.3)
    mux.accept_command("navigation", SLOW, 0.3)
    mux.accept_command("joystick", FAST, 0.3)
    assert reasons(mux.decide(0.3))["navigation"] == "joystick has priority"


def test_a_source_with_the_priority_of_the_lock_is_not_held_back() -> None:
    mux = rested(DEFAULT_SOURCES, {"alike": MuxLock(topic="x", priority=50)})
    mux.accept_command("navigation", SLOW, 0.0)
    assert mux.decide(0.0).active == "navigation"
    mux.accept_command("action", FAST, 0.6)
    assert mux.decide(0.6).active is None


def test_a_required_lock_holds_until_it_is_heard_and_again_when_it_falls_silent() -> None:
    mux = rested(DEFAULT_SOURCES, {"button": BUTTON})
    mux.accept_command("joystick", FAST, 0.0)
    assert reasons(mux.decide(0.0))["joystick"] == "locked: button has published nothing yet on button"
    mux.on_lock("button", False, 0.1)
    assert mux.decide(0.1).active == "joystick"
    mux.accept_command("joystick", FAST, 0.6)
    assert mux.decide(0.6).active == "joystick"  # 0.5 s after its word, exactly its timeout
    decision = mux.decide(math.nextafter(0.6, 1.0))
    assert reasons(decision)["joystick"] == "locked: button has published nothing for 0.50 s (timeout 0.50 s)"
    mux.on_lock("button", False, 0.7)
    mux.accept_command("joystick", FAST, 0.7)
    assert mux.decide(0.7).twist == FAST


def test_the_last_true_of_a_lock_holds_however_long_it_is_silent() -> None:
    mux = rested(DEFAULT_SOURCES, {"pause": PAUSE})
    mux.on_lock("pause", True, 0.0)
    mux.accept_command("action", FAST, 9999.0)
    decision = mux.decide(9999.0)
    assert decision.twist == ZERO
    (lock,) = decision.locks
    assert (lock.name, lock.holds, lock.age_s, lock.reason) == ("pause", True, 9999.0, "holds")


# two nodes publish on one lock: it holds, whatever they say ── one is left, and says that it does not hold
def test_a_lock_with_two_publishers_holds_and_names_them() -> None:
    mux = rested(DEFAULT_SOURCES, {"pause": PAUSE})
    assert mux.decide(8.0).locks[0].age_s == math.inf
    mux.on_lock("pause", False, 8.0)
    mux.on_publishers("pause", ["/panel"])
    assert [lock.standing for lock in mux.decide(8.0).locks] == [LockStanding.FREE]
    mux.on_publishers("pause", ["/panel", "/button"])
    (lock,) = mux.decide(8.5).locks
    assert (lock.standing, lock.holds, lock.age_s) == (LockStanding.SHARED, True, 0.5)
    assert lock.reason == "has 2 publishers on pause (/button, /panel): give each a topic and a key of its own"
    mux.on_publishers("pause", ["/a", "/b", "/c", "/d"])
    assert "4 publishers on pause (/a, /b, /c):" in mux.decide(8.5).locks[0].reason
    mux.on_lock("pause", True, 8.75)
    assert (mux.decide(8.75).locks[0].standing, mux.decide(8.75).locks[0].reason) == (LockStanding.LOCKED, "holds")
    mux.on_lock("pause", False, 9.0)
    mux.on_publishers("pause", ["/panel"])
    assert mux.decide(9.0).locks[0].holds is False


@pytest.mark.parametrize(("nodes", "why"), [([], ""), (["/a"], ""), (["/b", "/a"], "2 publishers on t (/a, /b): give")])
def test_one_publisher_is_no_crowd_and_two_are(nodes: list[str], why: str) -> None:
    assert crowd("t", nodes).startswith(why)
    assert bool(crowd("t", nodes)) is bool(why)


def test_locks_are_told_by_falling_priority_and_a_change_of_one_changes_the_essence() -> None:
    mux = rested(DEFAULT_SOURCES, {"pause": PAUSE, "button": BUTTON})
    mux.on_lock("button", False, 0.0)
    before = mux.decide(0.0)
    assert [(lock.name, lock.holds) for lock in before.locks] == [("button", False), ("pause", False)]
    mux.on_lock("pause", True, 0.0)
    assert mux.decide(0.0).essence != before.essence


def test_a_lock_that_the_configuration_does_not_name_is_our_own_error(mux: Mux) -> None:
    with pytest.raises(KeyError, match="pause"):
        mux.on_lock("pause", True, 0.0)


def stranger(source: str | None, *, obeyed: bool = True) -> Foreign:
    return Foreign("/t", "/evil", "geometry_msgs/msg/TwistStamped", "only /good should", source, obeyed)


def test_a_foreign_publisher_is_reported_and_holds_nobody_back_unless_the_configuration_says_so(mux: Mux) -> None:
    mux.accept_command("action", SLOW, 0.0)
    quiet = mux.decide(0.0)
    mux.on_foreign([stranger("action"), stranger(None)])
    decision = mux.decide(0.0)
    assert decision.active == "action"
    assert decision.foreign == (stranger("action"), stranger(None))
    assert decision.essence != quiet.essence


def test_a_foreign_publisher_locks_its_source_alone_or_all_of_them_when_it_speaks_for_the_chain() -> None:
    mux = rested(DEFAULT_SOURCES, foreign_lock=True)
    mux.on_foreign([stranger("action")])
    mux.accept_command("action", SLOW, 0.0)
    assert reasons(mux.decide(0.0))["action"] == "locked: /evil publishes on /t: only /good should"
    mux.accept_command("joystick", FAST, 0.0)
    assert mux.decide(0.0).active == "joystick"
    mux.on_foreign([stranger(None)])
    assert (mux.decide(0.0).active, mux.decide(0.0).twist) == (None, ZERO)
    mux.on_foreign([stranger(None, obeyed=False)])  # of a type that nobody hears
    assert mux.decide(0.0).active == "joystick"


commands = st.lists(
    st.tuples(
        st.sampled_from(sorted(DEFAULT_SOURCES)),
        st.builds(Twist, st.floats(), st.floats()),
        st.floats(0.0, 0.6),  # pause before it [s]
    ),
    max_size=30,
)


@given(commands=commands, pause_s=st.floats(0.0, 1.0))
def test_the_order_is_the_newest_valid_command_of_the_highest_fresh_source_or_zero(
    commands: list[tuple[str, Twist, float]], pause_s: float
) -> None:
    mux, now_s, newest = rested(), 0.0, dict[str, tuple[Twist, float]]()
    for name, twist, before_s in commands:
        now_s += before_s
        mux.accept_command(name, twist, now_s)
        if twist.is_finite:
            newest[name] = (twist, now_s)
    now_s += pause_s
    fresh = [name for name, (_, at_s) in newest.items() if now_s - at_s <= TIMEOUTS_S[name]]
    expected = max(fresh, key=lambda name: DEFAULT_SOURCES[name].priority, default=None)
    decision = mux.decide(now_s)
    assert decision.active == expected
    assert decision.twist == newest.get(expected or "", (ZERO, 0.0))[0]
    assert [source.name for source in decision.sources if source.reason == ""] == [expected] * (expected is not None)
