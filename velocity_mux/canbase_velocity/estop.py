"""The memory of the emergency stop: what has to happen after it before the base may move again. A table, no clock.

It outlives the process: the record on disk is LIVE from the first message of the button until an orderly end, so that
a filter that was killed takes the button for pressed until it is seen released. A stop that waits for its reset comes
back held for the same reason: the button may have been pressed again while no filter received it.
"""

from __future__ import annotations

import enum

from canbase_base.latch_record import Defect, Found, Mark, Record, WriteAhead


class EstopState(enum.Enum):
    """What the emergency stop wants."""

    FREE = "free"
    HELD = "held"
    """Pressed, or required without a recent message."""
    AWAITS_RESET = "released, waits for a reset"
    AWAITS_ZERO = "released, waits for a zero command"


class EstopEvent(enum.Enum):
    """What happens to it."""

    PRESS = "pressed"
    SILENCE = "required, and no message arrives"
    RELEASE = "released, and messages arrive"
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
"""Rules: a press and a timeout hold from every state. While held, neither a zero nor a reset counts. Where a row is
missing nothing changes, but for a reset: that is refused before, and raises here."""


class Estop:
    """The state, and whether it is latched.

    What latches: a press, and a timeout after a first message. A robot that starts before its stop button publishes has
    nothing to reset: there a zero command is enough.
    """

    def __init__(self, latches: bool, found: Found | None = None) -> None:
        """`latches`: safety.estop.latched. `found`: the record at the start; None: no record is kept (virtual time)."""
        self._latches = latches
        self._ahead = WriteAhead(found)
        self.state = _before_the_start(found, latches)
        self._heard = self.state is HELD
        self._latched = self._latches and self.state is not FREE
        self._ended = False
        self.before_the_start = "" if found is None else found.sentence
        """Why it is not free from its first moment, until it is; empty: it was."""
        self._note()

    @property
    def record(self) -> Record:
        """What shall be on disk now."""
        return self._ahead.wanted

    @property
    def record_is_on_disk(self) -> bool:
        """It is there."""
        return self._ahead.is_on_disk

    @property
    def unarmed(self) -> str:
        """A sentence while a press would not outlive this process: the record is not on disk yet; else empty."""
        if self._ahead.wanted.mark is not Mark.LIVE or self._ahead.is_on_disk:
            return ""
        return self._ahead.problem or "the record of the emergency stop is not on disk yet"

    def on_written(self, written: Record | None, problem: str) -> None:
        """The newest record on disk (None: none since the start), and what keeps the writer from writing."""
        self._ahead.on_written(written, problem)

    def end(self) -> None:
        """An orderly end: a free button leaves nothing behind."""
        self._ended = True
        self._note()

    def happens(self, event: EstopEvent) -> None:
        """The next state. Raises ValueError, with nothing changed, for a reset while it is held."""
        before = self.state
        if event is EstopEvent.RESET and before is HELD:
            raise ValueError("the emergency stop cannot be reset while it is held; check `state` first")
        after = TRANSITIONS.get((before, event), before)
        if event is EstopEvent.PRESS or (event is EstopEvent.SILENCE and self._heard):
            self._latched = self._latches
        if (before, event) == (HELD, EstopEvent.RELEASE) and self._latched:
            after = AWAITS_RESET
        self._heard = self._heard or event in (EstopEvent.PRESS, EstopEvent.RELEASE)
        self._latched = self._latched and after is not FREE
        self.state = after
        if after is FREE:
            self.before_the_start = ""
        self._note()

    def _note(self) -> None:
        if self.state is FREE:
            self._ahead.want(Mark.LIVE if self._heard and not self._ended else Mark.CLEAR)
        elif self._heard or self._latched:
            next_life = HELD if self._heard else self.state
            self._ahead.want(Mark.LATCHED, STATES.index(next_life), self.state.value)


STATES = tuple(EstopState)
"""A record's code is the place in it."""


def _before_the_start(found: Found | None, latches: bool) -> EstopState:
    if found is None or not found.latched:
        return FREE
    if found.defect is not Defect.NONE:
        return AWAITS_RESET if latches else AWAITS_ZERO
    if found.record.mark is Mark.LIVE or found.record.code not in range(1, len(STATES)):
        return HELD
    return STATES[found.record.code]
