"""Hold-to-drive: what ends the orders of a page, to the hundredth of a second."""

from __future__ import annotations

import math

import pytest

from canbase_web.hold import NUMBER_S, VALID_S, ZERO, Hold, Speed

FORWARD = Speed(0.4, 0.0)


def test_a_press_begins_with_a_zero_and_then_drives_by_the_share_of_the_greatest_speed() -> None:
    hold = Hold(0.8, 2.0)
    number = hold.number(10.0)
    assert hold.on_order("a", 1, number, 0.5, -0.25, 10.01)
    assert [hold.speed(10.05), hold.speed(10.1)] == [ZERO, Speed(0.4, -0.5)]


def held(until_s: float = 10.5) -> tuple[Hold, int, float]:
    """A page that has held since 10 s, its newest number and when that was sent."""
    hold = Hold(0.8, 2.0)
    at_s = 10.0
    while at_s < until_s:
        number = hold.number(at_s)
        assert hold.on_order("a", 1, number, 0.5, 0.0, at_s + 0.01)
        hold.speed(at_s + 0.02)
        at_s += NUMBER_S
    return hold, number, at_s - NUMBER_S


def test_when_the_orders_end_it_drives_for_the_validity_of_the_last_number_then_zero_once_then_nothing() -> None:
    hold, _, sent_s = held()
    assert hold.speed(sent_s + VALID_S - 0.001) == FORWARD
    assert [hold.speed(sent_s + VALID_S), hold.speed(sent_s + VALID_S + NUMBER_S)] == [ZERO, None]


def test_letting_go_is_a_zero_at_once() -> None:
    hold, _, sent_s = held()
    hold.release("a")
    assert [hold.speed(sent_s + 0.03), hold.speed(sent_s + 0.08)] == [ZERO, None]


@pytest.mark.parametrize(("age_s", "counts"), [(0.0, True), (0.199, True), (0.2, False), (0.201, False), (5.0, False)])
def test_what_the_network_delivers_late_is_no_order(age_s: float, counts: bool) -> None:
    hold = Hold(0.8, 2.0)
    number = hold.number(10.0)
    assert hold.on_order("a", 1, number, 1.0, 0.0, 10.0 + age_s) is counts
    assert (hold.speed(10.0 + age_s) is None) is not counts


def test_a_burst_after_an_unplugged_cable_moves_nothing() -> None:
    """The cable is out from 10.5 s to 12.5 s; what the page has sent meanwhile comes at once."""
    hold, number, sent_s = held()
    for _ in range(20):
        hold.number(sent_s + 2.0)
    assert hold.speed(sent_s + 2.0) == ZERO
    assert not any(hold.on_order("a", 1, number, 1.0, 0.0, sent_s + 2.0 + 0.001 * i) for i in range(40))
    assert hold.speed(sent_s + 2.05) is None


@pytest.mark.parametrize("number", [0, -1, 99_999])
def test_a_number_that_was_never_sent_is_no_order(number: int) -> None:
    hold = Hold(0.8, 2.0)
    hold.number(10.0)
    assert not hold.on_order("a", 1, number, 1.0, 0.0, 10.0)


def test_an_order_that_was_overtaken_is_none() -> None:
    hold = Hold(0.8, 2.0)
    first, second = hold.number(10.0), hold.number(10.05)
    assert hold.on_order("a", 1, second, 0.5, 0.0, 10.06)
    assert not hold.on_order("a", 1, first, 1.0, 0.0, 10.07)
    assert hold.on_order("a", 1, second, 0.25, 0.0, 10.08), "a finger that moves needs no new number"


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1.001, -1.001, 1e300])
def test_no_order_beyond_the_limits(value: float) -> None:
    hold = Hold(0.8, 2.0)
    number = hold.number(10.0)
    assert not hold.on_order("a", 1, number, value, 0.0, 10.0)
    assert not hold.on_order("a", 2, number, 0.0, value, 10.0)
    assert hold.speed(10.0) is None


def test_a_press_that_ended_by_itself_is_over_until_the_finger_was_lifted() -> None:
    """A browser hangs at 10.5 s for a second, and goes on with the finger still down."""
    hold, _, sent_s = held()
    hold.speed(sent_s + VALID_S)
    number = hold.number(sent_s + 1.0)
    assert not hold.on_order("a", 1, number, 0.5, 0.0, sent_s + 1.01)
    assert hold.speed(sent_s + 1.02) is None
    assert hold.on_order("a", 2, number, 0.5, 0.0, sent_s + 1.03)


def test_another_page_drives_only_when_the_first_has_let_go() -> None:
    hold, number, sent_s = held()
    assert not hold.on_order("b", 1, number, -1.0, 0.0, sent_s + 0.02)
    hold.release("b")
    assert hold.holder(sent_s + 0.02) == "a", "who does not hold cannot let go"
    hold.release("a")
    assert not hold.on_order("b", 1, number, -1.0, 0.0, sent_s + 0.03), "its finger has waited there"
    assert hold.on_order("b", 2, number, -1.0, 0.0, sent_s + 0.04)
    assert hold.holder(sent_s + 0.04) == "b"


def test_a_finger_on_a_page_that_hung_moves_nothing_after_another_page_has_driven_either() -> None:
    hold, _, sent_s = held()
    number = hold.number(sent_s + 1.0)
    assert hold.on_order("b", 1, number, -1.0, 0.0, sent_s + 1.01)
    hold.release("b")
    for again in (0, 1):
        assert not hold.on_order("a", again, number, 0.5, 0.0, sent_s + 1.02)
    assert hold.on_order("a", 2, number, 0.5, 0.0, sent_s + 1.03)


@pytest.mark.parametrize("number", [-1, 0])
def test_a_press_whose_first_order_was_none_is_over(number: int) -> None:
    hold = Hold(0.8, 2.0)
    newest = hold.number(10.0)
    assert not hold.on_order("a", 1, number, 0.5, 0.0, 10.0)
    assert not hold.on_order("a", 1, newest, 0.5, 0.0, 10.01)
    assert hold.on_order("a", 2, newest, 0.5, 0.0, 10.02)


def test_a_page_that_has_gone_is_forgotten_and_holds_no_more() -> None:
    hold, number, sent_s = held()
    hold.forget("a")
    assert [hold.speed(sent_s + 0.02), hold.speed(sent_s + 0.07)] == [ZERO, None]
    assert hold.on_order("a", 1, number, 0.5, 0.0, sent_s + 0.08), "a new page with the same name"


def test_the_other_page_begins_with_a_zero_of_its_own() -> None:
    hold, number, sent_s = held()
    hold.release("a")
    hold.speed(sent_s + 0.02)
    assert hold.on_order("b", 1, number, -1.0, 0.0, sent_s + 0.03)
    assert [hold.speed(sent_s + 0.04), hold.speed(sent_s + 0.09)] == [ZERO, Speed(-0.8, 0.0)]


def test_without_orders_nothing_is_published() -> None:
    hold = Hold(0.8, 2.0)
    assert [hold.speed(10.0 + i * NUMBER_S) for i in range(5)] == [None] * 5
