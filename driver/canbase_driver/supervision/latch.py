"""What the driver writes to disk about its stops, and what it makes of what it finds there. Pure.

Rules: LIVE before there is power (the phase ARMING waits for it), and until all of it was measured to be off;
LATCHED as soon as a stop latches; CLEAR else. So a kill, a crash, a hang and a power cut find LIVE or LATCHED on disk.
Each record carries how far an operator lets the driver go (`code`): what was switched off stays off after a start.
"""

from __future__ import annotations

from canbase_base.latch_record import Defect, Found, Mark, Record, WriteAhead
from canbase_driver.causes import DriverCause, Finding
from canbase_driver.supervision.lifecycle import Aim
from canbase_driver.supervision.phases import Phase
from canbase_driver.supervision.situation import Situation
from canbase_driver.supervision.state_machine import StateMachine
from canbase_runtime.driver_state import DriverState

NOT_YET = "the driver's record of stops is not on disk yet"
_WITH_POWER = (DriverState.ENABLING, DriverState.ENABLED, DriverState.STOPPING)


def allowed_before_the_start(on_disk: Found | None) -> Aim:
    """How far an operator lets the driver go. A number that this version does not know: no power. A record that cannot
    be used is latched, and its reset is an operator's request for power."""
    if on_disk is None or on_disk.defect is not Defect.NONE:
        return Aim.ACTIVE
    return next((aim for aim in Aim if Aim.ACTIVE - aim == on_disk.record.code), Aim.CONFIGURED)


def finding_before_the_start(on_disk: Found | None) -> Finding | None:
    """Why the driver is latched from its first moment; None: it is not."""
    if on_disk is None or not on_disk.latched:
        return None
    if on_disk.defect is not Defect.NONE:
        return Finding(DriverCause.RECORD_UNUSABLE, on_disk.sentence, "reset")
    cause = _recorded(on_disk.record) if on_disk.record.mark is Mark.LATCHED else DriverCause.ENDED_WITH_POWER
    return Finding(cause, on_disk.sentence, "reset")


def _recorded(record: Record) -> DriverCause:
    """What latched then; a word that this version does not know counts as an unusable record."""
    return next((cause for cause in DriverCause if cause.value == record.cause), DriverCause.RECORD_UNUSABLE)


class PowerRecord:
    """The record that the driver wants on disk, cycle by cycle."""

    def __init__(self, on_disk: Found | None) -> None:
        """`on_disk`: what was there at the start; None: no record is kept, which is for virtual time alone."""
        self._ahead = WriteAhead(on_disk)

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
        is_live = self._ahead.wanted.mark is Mark.LIVE
        return self.unrecorded if is_live else self.unrecorded or NOT_YET

    @property
    def unrecorded(self) -> str:
        """A sentence until what is wanted is on disk; else empty."""
        if self._ahead.is_on_disk:
            return ""
        return self._ahead.problem or NOT_YET

    def note(self, state_machine: StateMachine, situation: Situation, allowed: Aim) -> None:
        """After the state machine's step. `allowed`: how far an operator lets the driver go."""
        code = Aim.ACTIVE - allowed
        state, finding = state_machine.state, state_machine.finding
        if state is DriverState.LATCHED or (state is DriverState.STOPPING and state_machine.latches):
            if not state_machine.finished:  # the shutdown is no cause
                self._ahead.want(Mark.LATCHED, code, cause=finding.cause.value, detail=finding.detail)
        elif self._is_live(state_machine, situation):
            self._ahead.want(Mark.LIVE, code)
        else:
            self._ahead.want(Mark.CLEAR, code)

    def _is_live(self, state_machine: StateMachine, situation: Situation) -> bool:
        """Power is about to come, is there, or was there and was not measured to be off."""
        may_be_left = situation.powered and self._ahead.wanted.mark is not Mark.CLEAR
        return state_machine.state in _WITH_POWER or state_machine.phase is Phase.ARMING or may_be_left
