"""The memory of the emergency stop: what has to happen after it before the base may move again. A table, no clock."""

from __future__ import annotations

import enum


class EstopState(enum.Enum):
    """What the emergency stop wants."""

    FREE = "free"
    HELD = "held"
    """Pressed, or required and silent."""
    AWAITS_RESET = "released, waits for a reset"
    AWAITS_ZERO = "released, waits for a zero command"


class EstopEvent(enum.Enum):
    """What happens to it."""

    PRESS = "pressed"
    SILENCE = "required and silent"
    RELEASE = "neither pressed nor silent"
    ZERO = "the command is zero, and fresh"
    RESET = "an accepted reset"


FREE, HELD = EstopState.FREE, EstopState.HELD
AWAITS_RESET, AWAITS_ZERO = EstopState.AWAITS_RESET, EstopState.AWAITS_ZERO

TRANSITIONS: dict[tuple[EstopState, EstopEvent], EstopState] = {
    **{(state, event): HELD for state in EstopState for event in (EstopEvent.PRESS, EstopEvent.SILENCE)},
    (HELD, EstopEvent.RELEASE): AWAITS_ZERO,  # or AWAITS_RESET, see `Estop.happens`
    (AWAITS_RESET, EstopEvent.RESET): FREE,
    (AWAITS_ZERO, EstopEvent.ZERO): FREE,
    (AWAITS_ZERO, EstopEvent.RESET): FREE,
}
"""Rules: pressing and silence hold from every state. While it is held neither a zero nor a reset counts. Where a row is
missing nothing changes, but for a reset: that is refused before, and raises here."""


class Estop:
    """The state, and whether it is latched.

    What latches: a press, and a silence after it was heard once. A robot that starts before its stop button speaks has
    nothing to reset: there a zero command is enough.
    """

    def __init__(self, latches: bool) -> None:
        """`latches`: safety.estop.latched."""
        self.state = FREE
        self._latches = latches
        self._heard = self._latched = False

    def happens(self, event: EstopEvent) -> None:
        """The next state. Raises ValueError, with nothing changed, for a reset while it is held."""
        before = self.state
        if event is EstopEvent.RESET and before is HELD:
            raise ValueError("the emergency stop cannot be reset while it is held; ask `state` before")
        after = TRANSITIONS.get((before, event), before)
        if event is EstopEvent.PRESS or (event is EstopEvent.SILENCE and self._heard):
            self._latched = self._latches
        if (before, event) == (HELD, EstopEvent.RELEASE) and self._latched:
            after = AWAITS_RESET
        self._heard = self._heard or event in (EstopEvent.PRESS, EstopEvent.RELEASE)
        self._latched = self._latched and after is not FREE
        self.state = after
