"""When the drives may have power, and what takes it away: the driver's own state machine, above CiA 402.

Rules
1. Nothing gets power while one of BLOCKERS holds: drives booted and heard, watchdog alive and not tripped, standstill,
   no velocity commanded, no reset under way. The first that holds is the state and the cause. Then the drives are taken
   as far as switched on, however long that lasts (STO open, no main voltage), and only together any further, and not
   before the records on disk say that there is power: whoever dies with it comes back latched.
2. While there is power, the first of HAZARDS that holds stops the base: by the ramp, or by quick stop at once. On the
   way to operation enabled nothing follows a command yet, so there it is always the quick stop.
3. A stop goes down one way only: ramp, quick stop, power off. Each step ends by measured standstill, or as soon as the
   base does not lose speed as it must (`braking.py`); a wheel whose sensor is no evidence has its power taken at once.
4. The first cause is the one that is shown; only a stop that needs no reset is taken over by a cause that does.
5. A latched cause is forgotten by `reset` alone, and only when nothing has power; a restart does not end it.
6. A shutdown ends in every state: at once without power, after the stop with it.

Pure: time is an argument, `Situation` says everything that was measured. It sends nothing; `Orders` says what to do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import TypeVar

from canbase_driver.cia402 import PowerGoal
from canbase_driver.motion.braking import Braking
from canbase_driver.snapshot import DriverState, WatchdogView

ENABLE_TIMEOUT_S = 2.0
"""From the first controlword to operation enabled on all drives; real ones need up to 1 s (brake, bus charge)."""
PREPARE_TIMEOUT_S = 1.0
"""From nothing that forbids power to switched on on all drives: after it STO or the main voltage is missing."""
POWER_OFF_TIMEOUT_S = 0.5
"""Time for the drives to report that power is off; then the stop ends all the same, and the watchdog stays alert."""


@dataclass(frozen=True, slots=True)
class Situation:
    """What is measured at one cycle. The sentences name joint, node and values; empty: not so."""

    bus: str = ""  # the bus failed
    booting: str = ""  # what is still waited for
    missing: str = ""  # a drive that could not be booted for timeouts.boot_s
    fault: str = ""  # a drive is in fault or fault reaction
    absent: str = ""  # a node restarted, or is not in NMT operational
    silent: str = ""  # statusword or heartbeat too old
    disabled: str = ""  # an axis is not in operation enabled
    unprepared: str = ""  # an axis has not got as far as switched on: STO open, no main voltage
    unarmed: str = ""  # the records on disk do not say yet that there is power
    watchdog: WatchdogView = WatchdogView.OK
    watchdog_detail: str = ""
    watchdog_about_drive: bool = False  # it tripped because a drive was silent or down
    commanded: str = ""  # a fresh command asks for motion
    overdue: str = ""  # zero was ordered, and the wheels still turn
    standstill: bool = True  # measured, on all wheels
    turning: str = ""  # which wheel does not stand
    speed_mps: float = 0.0  # of the fastest wheel, measured
    braking_mps: float = 0.0  # of the fastest one with power and fresh feedback
    begin_mps: float = 0.0  # the same, or what it was ordered last where that is more
    turn_radps: float = 0.0  # of the base, ordered last
    doubted: str = ""  # a wheel's sensors are no evidence of anything
    powered: bool = False  # some axis may produce torque
    unconfigured: str = ""  # the node's lifecycle: nothing may be sent
    inactive: str = ""  # the node's lifecycle: nothing may have power
    resetting: bool = False
    stop_requested: bool = False
    shutdown_requested: bool = False

    @property
    def unready(self) -> str:
        """A drive that is being booted, must be booted or is not heard: nothing of it is measured."""
        return self.booting or self.absent or self.silent


@dataclass(frozen=True, slots=True)
class Cause:
    """Why there is no power: a short name, a sentence, what ends it."""

    name: str = "none"
    detail: str = ""
    clears_on: str = ""


class Drive(Enum):
    """What the setpoints do."""

    ZERO = "zero"
    FOLLOW = "follow the command"
    RAMP = "ramp to zero"


@dataclass(frozen=True, slots=True)
class Orders:
    """What the core does in this cycle."""

    goal: PowerGoal
    drive: Drive


Seen = Callable[[Situation], str]
"""A sentence when it is so, else empty."""


@dataclass(frozen=True, slots=True)
class Blocker:
    """One reason why nothing gets power, and the state that shows it."""

    name: str
    seen: Seen
    state: DriverState
    clears_on: str


@dataclass(frozen=True, slots=True)
class Hazard:
    """One reason to stop what has power. `quick`: the drives' quick stop at once; otherwise the driver's ramp first."""

    name: str
    seen: Seen
    quick: bool
    latched: bool
    clears_on: str


Reason = TypeVar("Reason", Blocker, Hazard)


def _watchdog(view: WatchdogView) -> Seen:
    return lambda s: f"watchdog: {s.watchdog_detail}" if s.watchdog is view else ""


def _stop_requested(s: Situation) -> str:
    return "service motor_driver/stop" if s.stop_requested else ""


SHUTDOWN = "shutdown"
DID_NOT_STOP = "did not stop"
NOT_READY = "drive not ready"
UNARMED = "stop record"
PREPARING_CAUSE = "preparing"
INACTIVE = "inactive"
_MISSING, _TRIPPED = _watchdog(WatchdogView.MISSING), _watchdog(WatchdogView.TRIPPED)

BLOCKERS: tuple[Blocker, ...] = (
    Blocker("stop requested", _stop_requested, DriverState.LATCHED, "reset"),
    Blocker("bus failed", lambda s: s.bus, DriverState.OFFLINE, "the bus working"),
    Blocker("watchdog tripped", _TRIPPED, DriverState.LATCHED, "reset"),
    Blocker("not configured", lambda s: s.unconfigured, DriverState.OFFLINE, "lifecycle transition configure"),
    Blocker("drive missing", lambda s: s.missing, DriverState.BOOTING, "the drive answering"),
    Blocker("booting", lambda s: s.booting or s.absent, DriverState.BOOTING, "drives booted"),
    Blocker("drive fault", lambda s: s.fault, DriverState.LATCHED, "reset, with the drive's cause gone"),
    Blocker("drive silent", lambda s: s.silent, DriverState.DISARMED, "the drive answering"),
    Blocker("watchdog missing", _MISSING, DriverState.DISARMED, "the watchdog alive"),
    Blocker(INACTIVE, lambda s: s.inactive, DriverState.DISARMED, "lifecycle transition activate"),
    Blocker("resetting", lambda s: "a reset is under way" if s.resetting else "", DriverState.DISARMED, "its end"),
    Blocker("command not zero", lambda s: s.commanded, DriverState.DISARMED, "a zero command"),
    Blocker("not standing", lambda s: "" if s.standstill else s.turning, DriverState.DISARMED, "standstill"),
)
"""What keeps the power off while nothing is latched, the most telling first. Nothing moved: most go by themselves."""

HAZARDS: tuple[Hazard, ...] = (
    Hazard("bus failed", lambda s: s.bus, True, True, "reset, with the bus working"),
    Hazard("watchdog tripped", lambda s: "" if s.watchdog_about_drive else _TRIPPED(s), True, True, "reset"),
    Hazard("drive fault", lambda s: s.fault, True, True, "reset, with the drive's cause gone"),
    Hazard("drive restarted", lambda s: s.absent, True, True, "reset"),
    Hazard("drive silent", lambda s: s.silent, True, True, "reset, with the drive answering"),
    Hazard("watchdog tripped", _TRIPPED, True, True, "reset"),
    Hazard("watchdog missing", _MISSING, False, True, "reset, with the watchdog alive"),
    Hazard("drive disabled", lambda s: s.disabled, True, True, "reset"),
    Hazard(DID_NOT_STOP, lambda s: s.overdue, True, True, "reset"),
    Hazard("stop requested", _stop_requested, False, True, "reset"),
    Hazard(INACTIVE, lambda s: s.inactive, False, False, "lifecycle transition activate"),
    Hazard(SHUTDOWN, lambda s: "the driver is ending" if s.shutdown_requested else "", False, False, "a new start"),
)
"""All reasons to stop, the most telling first: when several hold, the first one is the cause that is reported.

A tripped watchdog stops the drives itself. Where both are seen in the same cycle (this process was stopped for a
while), drives that left NMT operational, are in fault or silent are what came of it, unless it tripped about a drive.
"""

_HAZARDS_WHILE_ENABLING = tuple(hazard for hazard in HAZARDS if hazard.name != "drive disabled")
_QUICK_HAZARDS = tuple(hazard for hazard in HAZARDS if hazard.quick)
_LATCHED_HAZARDS = tuple(hazard for hazard in HAZARDS if hazard.latched)
_LATCHED_HAZARDS_ON_THE_WAY_DOWN = tuple(hazard for hazard in _HAZARDS_WHILE_ENABLING if hazard.latched)
"""Drives that are disabled by a quick stop or by us are no hazard there."""


NO_POWER = (DriverState.OFFLINE, DriverState.BOOTING, DriverState.DISARMED, DriverState.LATCHED)


class Step(Enum):
    """The way down: `DriverState.STOPPING` in detail."""

    RAMP = "ramp"
    QUICK = "quick stop"
    OFF = "power off"


PREPARING = "preparing"
"""DISARMED, with nothing left that forbids power but drives that are not switched on."""

ORDERS: dict[DriverState | Step | str, Orders] = {
    DriverState.OFFLINE: Orders(PowerGoal.OFF, Drive.ZERO),
    DriverState.BOOTING: Orders(PowerGoal.OFF, Drive.ZERO),
    DriverState.DISARMED: Orders(PowerGoal.OFF, Drive.ZERO),
    PREPARING: Orders(PowerGoal.READY, Drive.ZERO),
    DriverState.ENABLING: Orders(PowerGoal.ON, Drive.ZERO),
    DriverState.ENABLED: Orders(PowerGoal.ON, Drive.FOLLOW),
    DriverState.LATCHED: Orders(PowerGoal.OFF, Drive.ZERO),
    Step.RAMP: Orders(PowerGoal.ON, Drive.RAMP),
    Step.QUICK: Orders(PowerGoal.QUICK_STOP, Drive.ZERO),
    Step.OFF: Orders(PowerGoal.OFF, Drive.ZERO),
}


class Supervisor:
    """The state machine. `step` once a cycle; `reset` when the reset sequence has finished."""

    def __init__(self, braking: Braking, ramp_timeout_s: float, latched: Cause | None = None) -> None:
        """`ramp_timeout_s`: the ramp takes no longer whatever the speed is (timeouts.standstill_s).

        `latched`: a stop of before the start, which ends by a reset alone.
        """
        self.state = DriverState.LATCHED if latched else DriverState.BOOTING
        self.cause = latched or Cause("booting", "", "drives booted")
        self.finished = False
        """A shutdown was asked for, and the way down is at its end."""
        self.latches = latched is not None
        """The stop that is under way, or the last one, needs a reset."""
        self._step = Step.OFF
        self._since_s = self._prepares_since_s = 0.0
        self._ramp_timeout_s = ramp_timeout_s
        self._braking = braking

    def step(self, situation: Situation, now: float) -> Orders:
        """Judge the situation, move on, and say what to do in this cycle."""
        before = (self.state, self._step)
        RULES[self.state](self, situation, now)
        if (self.state, self._step) != before:
            self._since_s = now
            if self.state is DriverState.STOPPING:
                quick = self._step is not Step.RAMP
                self._braking.begin(situation.begin_mps, situation.turn_radps, now, quick)
        if self.state is DriverState.DISARMED and self.cause.name in (NOT_READY, PREPARING_CAUSE, UNARMED):
            return ORDERS[PREPARING]
        return ORDERS[self._step if self.state is DriverState.STOPPING else self.state]

    def reset(self) -> None:
        """Forget a latched cause. Raises RuntimeError while there may be power: then the stop comes first."""
        if self.state not in (DriverState.LATCHED, DriverState.DISARMED):
            raise RuntimeError(f"reset in state {self.state.name}: only LATCHED and DISARMED can be reset")
        self.latches = False
        self.state = DriverState.DISARMED

    def _without_power(self, situation: Situation, now: float) -> None:
        blocker = _first(BLOCKERS, situation)
        if blocker is not None or not situation.unprepared:
            self._prepares_since_s = now
        latches = blocker is not None and blocker.state is DriverState.LATCHED
        if situation.shutdown_requested and not latches:  # a stop that was asked for just before is not forgotten
            self._finish()
        elif blocker is None and situation.unprepared:
            self._prepare(situation, now)
        elif blocker is None and situation.unarmed:
            self.state = DriverState.DISARMED
            self.cause = Cause(UNARMED, situation.unarmed, "the record on disk")
        elif blocker is None:
            self.state, self.cause = DriverState.ENABLING, Cause("enabling", "", "operation enabled on all drives")
        else:
            self.state, self.cause = blocker.state, _cause(blocker, situation)
            self.latches = latches

    def _prepare(self, situation: Situation, now: float) -> None:
        """The way to switched on takes some cycles; what takes longer needs a hand."""
        late = now - self._prepares_since_s > PREPARE_TIMEOUT_S
        self.state = DriverState.DISARMED
        self.cause = Cause(NOT_READY if late else PREPARING_CAUSE, situation.unprepared, "the drive being switched on")

    def _enabling(self, situation: Situation, now: float) -> None:
        hazard = _first(_HAZARDS_WHILE_ENABLING, situation)
        if hazard is not None:
            self._stop(Step.QUICK, _cause(hazard, situation), hazard.latched)
        elif not situation.disabled:
            self.state, self.cause = DriverState.ENABLED, Cause()
        elif now - self._since_s > ENABLE_TIMEOUT_S:
            late = Cause("enable timeout", f"{situation.disabled} after {ENABLE_TIMEOUT_S:.1f} s", "reset")
            self._stop(Step.QUICK, late, latched=True)

    def _enabled(self, situation: Situation, _now: float) -> None:
        hazard = _first(HAZARDS, situation)
        if hazard is not None:
            self._stop(Step.QUICK if hazard.quick else Step.RAMP, _cause(hazard, situation), hazard.latched)

    def _stop(self, step: Step, cause: Cause, latched: bool) -> None:
        self.state, self._step = DriverState.STOPPING, step
        self.cause, self.latches = cause, latched

    def _stopping(self, situation: Situation, now: float) -> None:
        if not self.latches:
            ramps = self._step is Step.RAMP
            worse = _first(_LATCHED_HAZARDS if ramps else _LATCHED_HAZARDS_ON_THE_WAY_DOWN, situation)
            if worse is not None:
                self.cause, self.latches = _cause(worse, situation), True
        STEPS[self._step](self, situation, now)

    def _ramp(self, situation: Situation, now: float) -> None:
        if _first(_QUICK_HAZARDS, situation) is not None:
            self._step = Step.QUICK
        elif situation.standstill:
            self._step = Step.OFF
        elif situation.doubted:
            self._step = Step.OFF
            self._latch("feedback implausible", situation.doubted)
        elif self._braking.fails(situation.speed_mps, now) or now - self._since_s > self._ramp_timeout_s:
            self._step = Step.QUICK
            self._latch(DID_NOT_STOP, f"{situation.turning} on its ramp, {now - self._since_s:.2f} s after it began")

    def _quick(self, situation: Situation, now: float) -> None:
        unslowed = self._braking.keeps_speed(situation.braking_mps, now)
        if unslowed or situation.standstill or situation.doubted or self._braking.fails(situation.speed_mps, now):
            self._step = Step.OFF

    def _latch(self, name: str, detail: str) -> None:
        if not self.latches:
            self.cause, self.latches = Cause(name, detail, "reset"), True

    def _off(self, situation: Situation, now: float) -> None:
        if situation.powered and now - self._since_s <= POWER_OFF_TIMEOUT_S:
            return
        self.state = DriverState.LATCHED if self.latches else DriverState.DISARMED
        if situation.shutdown_requested:
            self._finish()

    def _latched(self, situation: Situation, _now: float) -> None:
        if situation.shutdown_requested:
            self._finish()

    def _finish(self) -> None:
        self.finished = True
        self.cause = Cause(SHUTDOWN, "the driver is ending", "a new start")


RULES: dict[DriverState, Callable[[Supervisor, Situation, float], None]] = {
    DriverState.OFFLINE: Supervisor._without_power,
    DriverState.BOOTING: Supervisor._without_power,
    DriverState.DISARMED: Supervisor._without_power,
    DriverState.ENABLING: Supervisor._enabling,
    DriverState.ENABLED: Supervisor._enabled,
    DriverState.STOPPING: Supervisor._stopping,
    DriverState.LATCHED: Supervisor._latched,
}
"""What is decided in each state."""
STEPS: dict[Step, Callable[[Supervisor, Situation, float], None]] = {
    Step.RAMP: Supervisor._ramp,
    Step.QUICK: Supervisor._quick,
    Step.OFF: Supervisor._off,
}
"""What is decided in each step of a stop."""


def _first(reasons: tuple[Reason, ...], situation: Situation) -> Reason | None:
    return next((reason for reason in reasons if reason.seen(situation)), None)


def _cause(reason: Blocker | Hazard, situation: Situation) -> Cause:
    return Cause(reason.name, reason.seen(situation), reason.clears_on)
