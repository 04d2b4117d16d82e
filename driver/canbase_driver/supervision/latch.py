"""What the driver writes to disk about its stops, and what it makes of what it finds there. Pure.

Rules: LIVE before there is power (`supervisor.UNARMED` waits for it), and until all of it was measured to be off;
LATCHED as soon as a stop latches; CLEAR else. So a kill, a crash, a hang and a power cut find LIVE or LATCHED on disk.
"""

from __future__ import annotations

from canbase_driver.snapshot import DriverState
from canbase_driver.supervision.supervisor import UNARMED, Cause, Situation, Supervisor
from canbase_runtime.latch_record import Defect, Found, Mark, Record, WriteAhead

POWER_AT_END = "ended with power"
UNUSABLE = "stop record unusable"
_WITH_POWER = (DriverState.ENABLING, DriverState.ENABLED, DriverState.STOPPING)


def cause_before_the_start(found: Found | None) -> Cause | None:
    """Why the driver is latched from its first moment; None: it is not."""
    if found is None or not found.latched:
        return None
    if found.defect is not Defect.NONE:
        return Cause(UNUSABLE, found.sentence, "reset")
    name = found.record.cause if found.record.mark is Mark.LATCHED else POWER_AT_END
    return Cause(name, found.sentence, "reset")


class PowerRecord:
    """The record that the driver wants on disk, cycle by cycle."""

    def __init__(self, found: Found | None) -> None:
        """`found`: what was there at the start; None: nobody keeps a record, which is for virtual time alone."""
        self._ahead = WriteAhead(found)

    @property
    def wanted(self) -> Record:
        """What shall be on disk now."""
        return self._ahead.wanted

    def on_written(self, written: Record | None, problem: str) -> None:
        """The newest record on disk (None: none since the start), and what keeps the writer from writing."""
        self._ahead.on_written(written, problem)

    @property
    def unarmed(self) -> str:
        """A sentence until LIVE is on disk; else empty."""
        if self._ahead.wanted.mark is Mark.LIVE and self._ahead.is_on_disk:
            return ""
        return self._ahead.problem or "the driver's record of stops is not on disk yet"

    def note(self, supervisor: Supervisor, situation: Situation) -> None:
        """After the supervisor's step."""
        state, cause = supervisor.state, supervisor.cause
        if state is DriverState.LATCHED or (state is DriverState.STOPPING and supervisor.latches):
            if not supervisor.finished:  # the shutdown is no cause
                self._ahead.want(Mark.LATCHED, cause=cause.name, detail=cause.detail)
        elif self._is_live(state, cause, situation):
            self._ahead.want(Mark.LIVE)
        else:
            self._ahead.want(Mark.CLEAR)

    def _is_live(self, state: DriverState, cause: Cause, situation: Situation) -> bool:
        """Power is about to come, is there, or was there and was not measured to be off."""
        may_be_left = situation.powered and self._ahead.wanted.mark is not Mark.CLEAR
        return state in _WITH_POWER or cause.name == UNARMED or may_be_left
