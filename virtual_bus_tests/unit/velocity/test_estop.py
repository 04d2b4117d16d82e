"""The memory of the emergency stop: every state, every event."""

from __future__ import annotations

import pytest

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
