"""What a listener reads out of MuxSource about the source that holds the base is what the mux decided."""

from __future__ import annotations

from builtin_interfaces.msg import Time

from canbase_config.mux import MuxSource
from canbase_runtime.driver_state import DriverState
from canbase_runtime.source_standing import Followed, followed
from canbase_velocity.delay import Sent
from canbase_velocity.mux import Mux
from canbase_velocity.mux_messages import mux_state
from canbase_velocity.twist import ZERO, Twist

MOVES = Twist(0.3, 0.0)


def told(mux: Mux, now_s: float) -> list[Followed]:
    return [followed(source) for source in mux_state(mux.decide(now_s), Time()).sources]


def test_each_standing_of_the_source_that_holds_the_base_is_read_back() -> None:
    """At 1.0 s the joystick is held since before the start, at 1.1 s released, at 1.2 s held, at 1.3 s 1 s late."""
    sources = {
        "joystick": MuxSource(topic="a", priority=9, timeout_s=0.3, same_clock=True),
        "action": MuxSource(topic="b", priority=1, timeout_s=0.3),
    }
    mux = Mux(sources)
    mux.on_estop(True)
    assert told(mux, 0.9) == [Followed.NOT_HOLDING] * 2
    for now_s, twist, stamp_s, expected in (
        (1.0, MOVES, 1.0, Followed.UNARMED),
        (1.1, ZERO, 1.1, Followed.YES),
        (1.2, MOVES, 1.2, Followed.YES),
        (1.3, MOVES, 0.3, Followed.LATE),
        (1.4, MOVES, 2.4, Followed.LATE),
    ):
        mux.on_driver(DriverState.ENABLED, 1, now_s)
        mux.on_command("joystick", twist, now_s, sent=Sent(stamp_s, now_s, now_s))
        assert told(mux, now_s) == [expected, Followed.NOT_HOLDING]
    assert told(mux, 2.0) == [Followed.NOT_HOLDING] * 2


def test_two_publishers_on_the_topic_of_a_joystick_leave_it_unarmed() -> None:
    """The sentence is about the publishers then, and says nothing of a zero."""
    mux = Mux({"joystick": MuxSource(topic="a", priority=9, timeout_s=0.3)})
    mux.on_publishers("a", ["joy", "other"])
    mux.on_command("joystick", ZERO, 1.0)
    assert told(mux, 1.0) == [Followed.UNARMED]
