"""The memory of the emergency stop: every state, every event."""

from __future__ import annotations

import pytest

from canbase_base.latch_record import Found, Mark, Record
from canbase_velocity.estop import TRANSITIONS, Estop, EstopEvent, EstopState

FREE, HELD, AWAITS_RESET, AWAITS_ZERO = EstopState
PRESS, SILENCE, RELEASE, ZERO, RESET = EstopEvent


def after(*events: EstopEvent, latches: bool = True) -> EstopState:
    estop = Estop(latches)
    for event in events:
        estop.happens(event)
    return estop.state


@pytest.mark.parametrize(
    ("events", "state"),
    [
        ((), FREE),
        ((ZERO, RELEASE), FREE),
        ((PRESS,), HELD),
        ((PRESS, ZERO), HELD),
        ((PRESS, RELEASE), AWAITS_RESET),
        ((PRESS, RELEASE, ZERO), AWAITS_RESET),
        ((PRESS, RELEASE, RESET), FREE),
        ((PRESS, RELEASE, PRESS), HELD),
        ((SILENCE, RELEASE), AWAITS_ZERO),  # it was never heard before: the robot has just started
        ((SILENCE, RELEASE, ZERO), FREE),
        ((SILENCE, RELEASE, RESET), FREE),
        ((SILENCE, RELEASE, ZERO, SILENCE, RELEASE), AWAITS_RESET),
        ((SILENCE, PRESS, RELEASE), AWAITS_RESET),
        ((RELEASE, SILENCE, RELEASE), AWAITS_RESET),  # it published before: what ended is a button that lived
        ((PRESS, RELEASE, RESET, SILENCE, RELEASE), AWAITS_RESET),
        ((PRESS, RELEASE, RESET, ZERO, SILENCE, RELEASE), AWAITS_RESET),
    ],
)
def test_latched(events: tuple[EstopEvent, ...], state: EstopState) -> None:
    assert after(*events) is state


def test_unlatched_a_zero_command_is_enough() -> None:
    assert after(PRESS, RELEASE, latches=False) is AWAITS_ZERO
    assert after(PRESS, RELEASE, ZERO, latches=False) is FREE


def test_a_reset_while_it_is_held_raises_and_changes_nothing() -> None:
    estop = Estop(latches=True)
    estop.happens(PRESS)
    with pytest.raises(ValueError, match="cannot be reset while it is held"):
        estop.happens(RESET)
    assert estop.state is HELD
    estop.happens(RELEASE)
    assert estop.state is AWAITS_RESET


def test_whatever_the_state_a_press_and_silence_hold_and_nothing_else_does() -> None:
    into_held = {(state, event) for (state, event), then in TRANSITIONS.items() if then is HELD}
    assert into_held == {(state, event) for state in EstopState for event in (PRESS, SILENCE)}


@pytest.mark.parametrize(
    ("code", "state"), [(0, HELD), (1, HELD), (2, AWAITS_RESET), (3, AWAITS_ZERO), (4, HELD), (255, HELD)]
)
def test_a_latched_record_gives_its_state_and_an_unknown_code_counts_as_pressed(code: int, state: EstopState) -> None:
    assert Estop(True, Found(Record(Mark.LATCHED, code, "before"))).state is state


@pytest.mark.parametrize(("mark", "state"), [(Mark.LIVE, HELD), (Mark.CLEAR, FREE)])
def test_a_live_record_counts_as_pressed_whatever_its_code_and_a_clear_one_is_free(
    mark: Mark, state: EstopState
) -> None:
    for code in range(len(EstopState)):
        assert Estop(True, Found(Record(mark, code, ""))).state is state


# latched since before the start ── reset: the sentence of then is gone ── a new press has none
def test_the_sentence_of_before_the_start_ends_with_the_first_free_moment() -> None:
    estop = Estop(True, Found(Record(Mark.LATCHED, 2, "before")))
    assert estop.before_the_start
    estop.happens(RESET)
    assert (estop.state, estop.before_the_start) == (FREE, "")
    estop.happens(PRESS)
    assert estop.before_the_start == ""


# a stop that waited for its reset since before the start ── reset ── no button has published: nothing of it is left
def test_a_reset_ends_the_latch_of_before_the_start() -> None:
    estop = Estop(True, Found(Record(Mark.LATCHED, 2, "before")))
    for event in (RESET, SILENCE, RELEASE):
        estop.happens(event)
    assert estop.state is AWAITS_ZERO


# the button publishes ── its record is wanted ── it is on disk
def test_a_record_is_on_disk_once_it_was_written() -> None:
    estop = Estop(True, Found())
    estop.happens(RELEASE)
    assert (estop.record_is_on_disk, bool(estop.unarmed)) == (False, True)
    estop.on_written(estop.record, "")
    assert (estop.record_is_on_disk, estop.unarmed) == (True, "")
