"""When the drives may have power, and what takes it away: the driver's own state machine, above CiA 402.

Rules
1. Nothing gets power while one of BLOCKERS holds: drives booted and sending, watchdog alive and not tripped,
   standstill, no velocity commanded, no reset under way. The first that holds is the state and the cause. Then the
   drives are taken as far as switched on, however long that takes (STO open, no main voltage), and only together any
   further, and not before the records on disk are LIVE: a process that dies with power comes back latched.
2. While there is power, the first of HAZARDS that holds stops the base: by the ramp, or by quick stop at once. On the
   way to operation enabled nothing follows a command yet, so there it is always the quick stop.
3. A stop goes down one way only: ramp, quick stop, power off. Each step ends by measured standstill, or as soon as the
   base does not lose speed as it must (`braking.py`); a wheel whose sensor is no evidence has its power taken at once.
4. The first cause is the one that is shown; only a stop that needs no reset is taken over by a cause that does.
5. A latched cause is forgotten by `reset` alone, and only when nothing has power; a restart does not end it.
6. A shutdown ends in every state: at once without power, after the stop with it.

Pure: time is an argument, `Situation` has everything that was measured. It sends nothing; `Orders` has what to do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from canbase_driver.causes import DriverCause, Finding
from canbase_driver.motion.braking import Braking
from canbase_driver.supervision.hazards import BLOCKERS, HAZARDS, Blocker, Detect, Hazard, first
from canbase_driver.supervision.phases import ORDERS, SHOWN, STOPPING, WAITING, Orders, Phase
from canbase_driver.supervision.situation import Situation
from canbase_runtime.driver_state import DriverState

ENABLE_TIMEOUT_S = 2.0
"""From the first controlword to operation enabled on all drives; real ones need up to 1 s (brake, bus charge)."""
PREPARE_TIMEOUT_S = 1.0
"""From nothing that forbids power to switched on on all drives: after it STO or the main voltage is missing."""
POWER_OFF_TIMEOUT_S = 0.5
"""Time for the drives to report that power is off; then the stop ends all the same, and the watchdog stays alert."""


_HAZARDS_WHILE_ENABLING = tuple(hazard for hazard in HAZARDS if hazard.cause is not DriverCause.DRIVE_DISABLED)
_QUICK_HAZARDS = tuple(hazard for hazard in HAZARDS if hazard.quick)
_LATCHED_HAZARDS = tuple(hazard for hazard in HAZARDS if hazard.latched)
_LATCHED_HAZARDS_ON_THE_WAY_DOWN = tuple(hazard for hazard in _HAZARDS_WHILE_ENABLING if hazard.latched)
"""Drives that are disabled by a quick stop or by us are no hazard there."""

When = Callable[["StateMachine", Situation], "str | None"]
"""The sentence with the values when it is so, else None."""


@dataclass(frozen=True, slots=True)
class Transition:
    """In one of the phases `before`, as soon as `when` holds, on to `after`. The first row that holds counts."""

    before: tuple[Phase, ...]
    label: str
    when: When
    after: Phase
    cause: DriverCause | None = None
    """The cause that the driver reports from then on; None: the one before."""
    clears_on: str = ""
    latches: bool | None = None
    """Whether it needs a reset; None: as before."""
    reason: Blocker | Hazard | None = None
    """The row of BLOCKERS or HAZARDS that it is made of."""


class StateMachine:
    """The state machine. `step` once a cycle; `reset` when the reset sequence has finished."""

    def __init__(self, braking: Braking, ramp_timeout_s: float, latched: Finding | None = None) -> None:
        """`ramp_timeout_s`: the ramp takes no longer whatever the speed is (timeouts.standstill_s).

        `latched`: a stop of before the start, which ends by a reset alone.
        """
        self.phase = Phase.LATCHED if latched else Phase.BOOTING
        self.finding = latched or Finding(DriverCause.BOOTING, "", "drives booted")
        self.finished = False
        """A shutdown was requested, and the way down is at its end."""
        self.latches = latched is not None
        """The stop that is under way, or the last one, needs a reset."""
        self.now_s = self._since_s = 0.0
        self.ramp_timeout_s = ramp_timeout_s
        self.braking = braking

    @property
    def state(self) -> DriverState:
        """The state for the topics."""
        return SHOWN[self.phase]

    @property
    def elapsed_s(self) -> float:
        """Since the phase began [s]."""
        return self.now_s - self._since_s

    def step(self, situation: Situation, now_s: float) -> Orders:
        """Judge the situation, move on, and order what to do in this cycle."""
        self.now_s = now_s
        before = self.phase
        if situation.shutdown_requested and _is_down(before, situation):
            self._finish()
            return ORDERS[self.phase]
        if before in STOPPING:
            self._take_over(situation)
        for row in BY_PHASE[before]:
            detail = row.when(self, situation)
            if detail is not None:
                self._go(row, detail, situation)
                break
        return ORDERS[self.phase]

    def reset(self) -> None:
        """Forget a latched cause. Raises RuntimeError while there may be power: then the stop comes first."""
        if self.state not in (DriverState.LATCHED, DriverState.DISARMED):
            raise RuntimeError(f"reset in state {self.state.name}: only LATCHED and DISARMED can be reset")
        self.latches = False
        self.phase = Phase.DISARMED

    def _go(self, row: Transition, detail: str, situation: Situation) -> None:
        if row.after is not self.phase:
            self._since_s = self.now_s
            if row.after in STOPPING:
                quick = row.after is not Phase.RAMP
                self.braking.begin(situation.begin_mps, situation.turn_radps, self.now_s, quick)
        keeps_cause = self.phase in STOPPING and self.latches
        self.phase = row.after
        if row.cause is not None and not keeps_cause:
            self.finding = Finding(row.cause, detail, row.clears_on)
        if row.latches is not None and not keeps_cause:
            self.latches = row.latches

    def _take_over(self, situation: Situation) -> None:
        """A stop that needs no reset takes over a cause that does."""
        if self.latches:
            return
        ramps = self.phase is Phase.RAMP
        worse = first(_LATCHED_HAZARDS if ramps else _LATCHED_HAZARDS_ON_THE_WAY_DOWN, situation)
        if worse is not None:
            self.finding, self.latches = Finding(worse.cause, worse.detect(situation), worse.clears_on), True

    def _finish(self) -> None:
        self.finished = True
        if self.phase in (Phase.PREPARING, Phase.ARMING):
            self.phase = Phase.DISARMED
        self.finding = Finding(DriverCause.SHUTDOWN, "motor_driver is shutting down", "a new start")


def _is_down(phase: Phase, situation: Situation) -> bool:
    """There is no power, and nothing latches now: a stop that was requested just before is not forgotten."""
    blocker = first(BLOCKERS, situation)
    return phase is Phase.LATCHED or (phase in WAITING and (blocker is None or blocker.phase is not Phase.LATCHED))


def _when(detect: Detect) -> When:
    return lambda machine, s: detect(s) or None


def _blocked() -> Iterator[Transition]:
    for row in BLOCKERS:
        latches = row.phase is Phase.LATCHED
        yield Transition(WAITING, row.cause.value, _when(row.detect), row.phase, row.cause, row.clears_on, latches, row)


def _stopped(before: Phase, hazards: tuple[Hazard, ...]) -> Iterator[Transition]:
    for row in hazards:
        after = Phase.QUICK_STOP if row.quick or before is Phase.ENABLING else Phase.RAMP
        label, when = row.cause.value, _when(row.detect)
        yield Transition((before,), label, when, after, row.cause, row.clears_on, row.latched, row)


def _long_unprepared(machine: StateMachine, s: Situation) -> str | None:
    return s.unprepared if s.unprepared and machine.elapsed_s > PREPARE_TIMEOUT_S else None


def _too_late(machine: StateMachine, s: Situation) -> str | None:
    late = machine.elapsed_s > ENABLE_TIMEOUT_S
    return f"after {ENABLE_TIMEOUT_S:.1f} s {s.disabled}" if late else None


def _asks_for_quick_stop(machine: StateMachine, s: Situation) -> str | None:
    return "" if first(_QUICK_HAZARDS, s) is not None else None


def _stands(machine: StateMachine, s: Situation) -> str | None:
    return "" if s.standstill else None


def _keeps_on(machine: StateMachine, s: Situation) -> str | None:
    fails = machine.braking.fails(s.speed_mps, machine.now_s) or machine.elapsed_s > machine.ramp_timeout_s
    return f"{s.turning} on its ramp, {machine.elapsed_s:.2f} s after it began" if fails else None


def _keeps_its_speed(machine: StateMachine, s: Situation) -> str | None:
    unslowed = machine.braking.keeps_speed(s.braking_mps, machine.now_s)
    return "" if unslowed or machine.braking.fails(s.speed_mps, machine.now_s) else None


def _is_off(machine: StateMachine, s: Situation) -> str | None:
    return None if s.powered and machine.elapsed_s <= POWER_OFF_TIMEOUT_S else ""


def _is_off_for_good(machine: StateMachine, s: Situation) -> str | None:
    return _is_off(machine, s) if machine.latches else None


def _always(machine: StateMachine, s: Situation) -> str | None:
    return ""


_SWITCHED_ON = "the drive being switched on"
_PREPARING, _ENABLING, _RAMP = (Phase.PREPARING,), (Phase.ENABLING,), (Phase.RAMP,)
_QUICK, _OFF = (Phase.QUICK_STOP,), (Phase.POWER_OFF,)

TRANSITIONS: tuple[Transition, ...] = (
    *_blocked(),
    Transition(
        _PREPARING, "not ready for long", _long_unprepared, Phase.PREPARING, DriverCause.DRIVE_NOT_READY, _SWITCHED_ON
    ),
    Transition(
        WAITING, "not switched on", _when(lambda s: s.unprepared), Phase.PREPARING, DriverCause.PREPARING, _SWITCHED_ON
    ),
    Transition(
        WAITING,
        "no record of power",
        _when(lambda s: s.unarmed),
        Phase.ARMING,
        DriverCause.NO_RECORD,
        "the record on disk",
    ),
    Transition(
        WAITING, "nothing blocks", _always, Phase.ENABLING, DriverCause.ENABLING, "operation enabled on all drives"
    ),
    *_stopped(Phase.ENABLING, _HAZARDS_WHILE_ENABLING),
    Transition(
        _ENABLING, "operation enabled", lambda m, s: None if s.disabled else "", Phase.ENABLED, DriverCause.NONE
    ),
    Transition(_ENABLING, "takes too long", _too_late, Phase.QUICK_STOP, DriverCause.ENABLE_TIMEOUT, "reset", True),
    *_stopped(Phase.ENABLED, HAZARDS),
    Transition(_RAMP, "needs a quick stop", _asks_for_quick_stop, Phase.QUICK_STOP),
    Transition(_RAMP, "at standstill", _stands, Phase.POWER_OFF),
    Transition(
        _RAMP,
        "feedback implausible",
        _when(lambda s: s.doubted),
        Phase.POWER_OFF,
        DriverCause.FEEDBACK_IMPLAUSIBLE,
        "reset",
        True,
    ),
    Transition(_RAMP, "does not stop in time", _keeps_on, Phase.QUICK_STOP, DriverCause.DID_NOT_STOP, "reset", True),
    Transition(_QUICK, "at standstill", _stands, Phase.POWER_OFF),
    Transition(_QUICK, "feedback implausible", _when(lambda s: s.doubted), Phase.POWER_OFF),
    Transition(_QUICK, "does not slow down", _keeps_its_speed, Phase.POWER_OFF),
    Transition(_OFF, "power off, reset needed", _is_off_for_good, Phase.LATCHED),
    Transition(_OFF, "power off", _is_off, Phase.DISARMED),
)
"""All that the driver ever does. Out of LATCHED there is no row: `reset` alone leads there."""
BY_PHASE: dict[Phase, tuple[Transition, ...]] = {
    phase: tuple(row for row in TRANSITIONS if phase in row.before) for phase in Phase
}
