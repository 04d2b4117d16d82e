"""Two stop buttons on one topic: what one of them says is no word of the other. Times in s."""

from __future__ import annotations

import pytest

from canbase_runtime.stop_cause import StopCause
from canbase_velocity.decision import Decision
from canbase_velocity.estop import EstopState
from canbase_velocity.filter_state import SafetyFilter
from canbase_velocity.twist import ZERO, Twist
from support.filter_inputs import config

FORWARD = Twist(0.3, 0.0)


class Base:
    """Button A publishes when it changes, button B says ten times a second that it is free."""

    def __init__(self, *, latched: bool = True, publishers: int = 2) -> None:
        self.now_s = 10.0
        self.filter = SafetyFilter(config(scan=False, estop=False, latched=latched))
        self.filter.on_estop_publishers(publishers)
        self.run(ZERO, 0.2)

    def press(self) -> None:
        self.filter.on_estop(True, self.now_s)

    def run(self, twist: Twist, seconds: float) -> Decision:
        decision = self.filter.decide(self.now_s)
        for _ in range(round(seconds / 0.1)):
            self.now_s += 0.1
            self.filter.on_estop(False, self.now_s)
            self.filter.accept_command(twist, self.now_s)
            decision = self.filter.decide(self.now_s)
        return decision


def test_while_no_button_is_pressed_the_base_drives() -> None:
    assert Base().run(FORWARD, 1.0).twist == FORWARD


# A pressed ── B: free, free … ── a reset
@pytest.mark.parametrize("latched", [True, False])
def test_what_one_button_says_releases_no_other(latched: bool) -> None:
    base = Base(latched=latched)
    base.press()
    decision = base.run(ZERO, 2.0)
    assert decision.cause is StopCause.ESTOP
    assert "has 2 publishers" in decision.detail
    done, sentence = base.filter.reset((), base.now_s)
    assert not done
    assert "has 2 publishers" in sentence
    assert base.run(FORWARD, 1.0).twist == ZERO


# A, a console, has gone ── B: free ── a reset
def test_when_one_publisher_is_left_its_word_counts_again() -> None:
    base = Base()
    base.press()
    base.run(ZERO, 0.5)
    base.filter.on_estop_publishers(1)
    base.run(ZERO, 0.2)
    assert base.filter.estop is EstopState.AWAITS_RESET
    assert base.filter.reset((), base.now_s)[0]
    assert base.run(FORWARD, 0.5).twist == FORWARD


# A pressed, B: free, before anybody knew that there are two ── then it is known ── a reset
def test_a_release_from_before_the_crowd_was_known_is_not_reset_either() -> None:
    base = Base(publishers=1)
    base.press()
    base.run(ZERO, 0.3)
    base.filter.on_estop_publishers(2)
    done, sentence = base.filter.reset((), base.now_s)
    assert not done
    assert "has 2 publishers" in sentence


# a button whose node publishes Int8 in place of Bool: it is pressed, and nobody hears it
def test_a_button_of_another_type_holds_the_base_as_long_as_it_is_there() -> None:
    base = Base(publishers=1)
    base.filter.on_estop_publishers(0, "/button publishes it as std_msgs/msg/Int8, which is not received")
    decision = base.run(FORWARD, 0.5)
    assert (decision.cause, decision.twist) == (StopCause.ESTOP, ZERO)
    assert "std_msgs/msg/Int8, which is not received" in decision.detail
    assert not base.filter.reset((), base.now_s)[0]
    base.filter.on_estop_publishers(1)
    base.run(ZERO, 0.2)
    assert base.filter.reset((), base.now_s)[0]
    assert base.run(FORWARD, 0.5).twist == FORWARD
