"""Whether somebody looks at a page: what proves it, and when nobody does any more."""

from __future__ import annotations

from canbase_web.presence import LOST_S, PROOF_S, Presence


def test_a_browser_that_answers_is_there_and_one_that_hangs_is_lost() -> None:
    presence = Presence()
    presence.begin(10.0)
    for step in range(40):
        assert presence.on_number(presence.number(10.0 + 0.25 * step), 10.1 + 0.25 * step)
    assert not presence.is_lost(19.85 + LOST_S)
    late = presence.number(21.0)
    assert not presence.on_number(late, 21.001 + PROOF_S), "what a network delivers late"
    assert presence.is_lost(19.86 + LOST_S)


def test_before_anybody_was_there_nobody_is() -> None:
    presence = Presence()
    assert presence.is_lost(100.0)
    for number in (0, 1, -1, "1", None, 1.0, [1]):
        assert not presence.on_number(number, 100.0)


def test_any_of_several_browsers_is_enough() -> None:
    presence = Presence()
    presence.begin(10.0)
    numbers = [presence.number(10.0 + 0.01 * page) for page in range(3)]
    assert presence.on_number(numbers[1], 10.5)
    assert not presence.is_lost(10.4 + LOST_S)
