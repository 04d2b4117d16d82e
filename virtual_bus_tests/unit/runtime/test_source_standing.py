"""A listener reads from MuxSource and MuxLock what the mux has decided, and never guesses it from ages or sentences."""

from __future__ import annotations

import pytest
from builtin_interfaces.msg import Time
from canbase.msg import MuxLock as LockMessage
from canbase.msg import MuxSource as SourceMessage

from canbase_config.mux import MuxLock, MuxSource
from canbase_runtime.driver_state import DriverState
from canbase_runtime.source_standing import LockStanding, SourceStanding, lock_standing, source_standing
from canbase_velocity.delay import Sent
from canbase_velocity.mux import Mux
from canbase_velocity.mux_messages import mux_state
from canbase_velocity.twist import ZERO, Twist

MOVES = Twist(0.3, 0.0)


def told(mux: Mux, now_s: float) -> list[SourceStanding]:
    return [source_standing(source.standing) for source in mux_state(mux.decide(now_s), Time()).sources]


def test_the_numbers_are_those_of_the_interface() -> None:
    for kind, message in ((SourceStanding, SourceMessage), (LockStanding, LockMessage)):
        constants = {member.name: getattr(message, member.name) for member in kind}
        assert {member.name: int(member) for member in kind} == constants


@pytest.mark.parametrize("number", [99, 255])
def test_a_number_that_the_interface_does_not_have_is_unknown(number: int) -> None:
    assert source_standing(number) is SourceStanding.UNKNOWN
    assert lock_standing(number) is LockStanding.UNKNOWN


def test_each_standing_of_the_source_that_holds_the_base_is_read_back() -> None:
    """At 1.0 s the joystick is held since before the start, at 1.1 s released, at 1.2 s held, at 1.3 s 1 s late."""
    sources = {
        "joystick": MuxSource(topic="a", priority=9, timeout_s=0.3, same_clock=True),
        "action": MuxSource(topic="b", priority=1, timeout_s=0.3),
    }
    mux = Mux(sources)
    mux.on_estop(True)
    never = SourceStanding.NEVER_RECEIVED
    assert told(mux, 0.9) == [never, never]
    for now_s, twist, stamp_s, expected in (
        (1.0, MOVES, 1.0, SourceStanding.UNARMED),
        (1.1, ZERO, 1.1, SourceStanding.FOLLOWED),
        (1.2, MOVES, 1.2, SourceStanding.FOLLOWED),
        (1.3, MOVES, 0.3, SourceStanding.DELAYED),
        (1.4, MOVES, 2.4, SourceStanding.DELAYED),
    ):
        mux.on_driver(DriverState.ENABLED, 1, now_s)
        mux.accept_command("joystick", twist, now_s, sent=Sent(stamp_s, now_s, now_s))
        assert told(mux, now_s) == [expected, never]
    assert told(mux, 2.0) == [SourceStanding.SILENT, never]


def test_two_publishers_on_the_topic_of_a_joystick_leave_it_unarmed() -> None:
    """The sentence is about the publishers then, and says nothing of a zero."""
    mux = Mux({"joystick": MuxSource(topic="a", priority=9, timeout_s=0.3)})
    mux.on_publishers("a", ["joy", "other"])
    mux.accept_command("joystick", ZERO, 1.0)
    assert told(mux, 1.0) == [SourceStanding.UNARMED]


def test_each_standing_of_a_lock_is_read_back() -> None:
    """A required lock: silent from the start, free at 1.0 s, true at 1.1 s, free again, silent, shared by two nodes."""
    mux = Mux(
        {"a": MuxSource(topic="a", priority=1, timeout_s=0.3)},
        {"gate": MuxLock(topic="gate", priority=9, timeout_s=0.5)},
    )

    def standing(now_s: float) -> LockStanding:
        (lock,) = mux_state(mux.decide(now_s), Time()).locks
        assert lock.holds is (lock.standing != LockMessage.FREE) is bool(lock.reason)
        return lock_standing(lock.standing)

    assert standing(0.9) is LockStanding.NEVER_RECEIVED
    for now_s, word, expected in ((1.0, False, LockStanding.FREE), (1.1, True, LockStanding.LOCKED)):
        mux.on_lock("gate", word, now_s)
        assert standing(now_s) is expected
    mux.on_lock("gate", False, 1.2)
    assert standing(1.8) is LockStanding.SILENT
    mux.on_lock("gate", False, 1.8)
    mux.on_publishers("gate", ["one", "two"])
    assert standing(1.8) is LockStanding.SHARED
