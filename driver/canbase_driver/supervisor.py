"""When the drives may have power, and what takes it away: the driver's own state machine, above CiA 402.

Rules
1. Nothing gets power unless every condition holds: drives booted and heard, watchdog alive and not tripped, standstill,
   no velocity commanded.
2. While there is power, the first hazard of HAZARDS that holds stops the base: by the ramp, or by quick stop at once.
3. A stop goes down one way only: ramp, quick stop, power off. Each step ends by measured standstill or by its deadline.
4. A latched cause is forgotten by `reset` alone, and only when nothing has power.

Pure: time is an argument, `Situation` says everything that was measured. It sends nothing; `Orders` says what to do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import ClassVar

from canbase_driver.cia402 import PowerGoal
from canbase_driver.snapshot import DriverState, WatchdogView

ENABLE_TIMEOUT_S = 2.0
"""From the first controlword to operation enabled on all drives; real ones need up to 1 s (brake, bus charge)."""
QUICK_STOP_TIMEOUT_S = 1.5
"""Time for the drives' own quick-stop ramp before their power is taken away."""
POWER_OFF_TIMEOUT_S = 0.5
"""Time for the drives to report that power is off; then the stop ends all the same, and the watchdog stays alert."""


@dataclass(frozen=True, slots=True)
class Situation:
    """What is measured at one cycle. The sentences name joint, node and values; empty: not so."""

    bus: str = ""  # the bus failed
    booting: str = ""  # what is still waited for
    fault: str = ""  # a drive is in fault or fault reaction
    absent: str = ""  # a node restarted, or is not in NMT operational
    silent: str = ""  # statusword or heartbeat too old
    disabled: str = ""  # an axis is not in operation enabled
    watchdog: WatchdogView = WatchdogView.OK
    watchdog_detail: str = ""
    commanded: str = ""  # a fresh command asks for motion
    overdue: str = ""  # zero was ordered, and the wheels still turn
    standstill: bool = True  # measured, on all wheels
    powered: bool = False  # some axis may produce torque
    stop_requested: bool = False
    shutdown_requested: bool = False


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


@dataclass(frozen=True, slots=True)
class Hazard:
    """One reason to stop. `quick`: the drives' quick stop at once; otherwise the driver's ramp first."""

    name: str
    seen: Callable[[Situation], str]
    quick: bool
    latched: bool
    clears_on: str


def _watchdog(view: WatchdogView, text: str) -> Callable[[Situation], str]:
    return lambda s: f"{text}{s.watchdog_detail}" if s.watchdog is view else ""


SHUTDOWN = Hazard(
    "shutdown", lambda s: "the driver is ending" if s.shutdown_requested else "", False, False, "a new start"
)

HAZARDS: tuple[Hazard, ...] = (
    Hazard("bus failed", lambda s: s.bus, True, True, "reset, with the bus working"),
    Hazard("drive fault", lambda s: s.fault, True, True, "reset, with the drive's cause gone"),
    Hazard("drive restarted", lambda s: s.absent, True, True, "reset"),
    Hazard("drive silent", lambda s: s.silent, True, True, "reset, with the drive answering"),
    Hazard("watchdog tripped", _watchdog(WatchdogView.TRIPPED, "watchdog: "), True, True, "reset"),
    Hazard(
        "watchdog missing", _watchdog(WatchdogView.MISSING, "watchdog: "), False, True, "reset, with the watchdog alive"
    ),
    Hazard("drive disabled", lambda s: s.disabled, True, True, "reset"),
    Hazard("did not stop", lambda s: s.overdue, True, True, "reset"),
    Hazard("stop requested", lambda s: "service motor_driver/stop" if s.stop_requested else "", False, True, "reset"),
    SHUTDOWN,
)
"""All reasons to stop, the most telling first: when several hold, the first one is the cause that is reported."""

BLOCKERS: tuple[Hazard, ...] = (
    *(hazard for hazard in HAZARDS if hazard.name not in ("drive disabled", "did not stop")),
    Hazard("command not zero", lambda s: s.commanded, False, False, "a zero command"),
    Hazard("not standing", lambda s: "" if s.standstill else "a wheel turns", False, False, "standstill"),
)
"""What keeps the power off while there is none."""

LATCHED_WITHOUT_POWER = ("drive fault", "stop requested")
"""Of the blockers, those that need a reset though nothing had power. The others go by themselves: nothing moved."""


class Step(Enum):
    """The way down: `DriverState.STOPPING` in detail."""

    RAMP = "ramp"
    QUICK = "quick stop"
    OFF = "power off"


ORDERS: dict[DriverState | Step, Orders] = {
    DriverState.OFFLINE: Orders(PowerGoal.OFF, Drive.ZERO),
    DriverState.BOOTING: Orders(PowerGoal.OFF, Drive.ZERO),
    DriverState.DISARMED: Orders(PowerGoal.OFF, Drive.ZERO),
    DriverState.ENABLING: Orders(PowerGoal.ON, Drive.ZERO),
    DriverState.ENABLED: Orders(PowerGoal.ON, Drive.FOLLOW),
    DriverState.LATCHED: Orders(PowerGoal.OFF, Drive.ZERO),
    Step.RAMP: Orders(PowerGoal.ON, Drive.RAMP),
    Step.QUICK: Orders(PowerGoal.QUICK_STOP, Drive.ZERO),
    Step.OFF: Orders(PowerGoal.OFF, Drive.ZERO),
}


class Supervisor:
    """The state machine. `step` once a cycle; `reset` when the reset sequence has finished."""

    def __init__(self, ramp_timeout_s: float) -> None:
        """`ramp_timeout_s`: longest time for the driver's ramp before quick stop takes over (timeouts.standstill_s)."""
        self.state = DriverState.BOOTING
        self.cause = Cause("booting", "", "drives booted")
        self.finished = False
        self._step = Step.OFF
        self._since_s = 0.0
        self._latch = False
        self._ramp_timeout_s = ramp_timeout_s

    @property
    def latches(self) -> bool:
        """The stop that is under way, or the last one, needs a reset."""
        return self._latch

    def step(self, situation: Situation, now: float) -> Orders:
        """Judge the situation, move on, and say what to do in this cycle."""
        before = (self.state, self._step)
        self._RULES[self.state](self, situation, now)
        if (self.state, self._step) != before:
            self._since_s = now
        return ORDERS[self._step if self.state is DriverState.STOPPING else self.state]

    def reset(self) -> None:
        """Forget a latched cause. Raises RuntimeError while there may be power: then the stop comes first."""
        if self.state not in (DriverState.LATCHED, DriverState.DISARMED):
            raise RuntimeError(f"reset in state {self.state.name}: only LATCHED and DISARMED can be reset")
        self._latch = False
        self.state = DriverState.DISARMED

    def _booting(self, situation: Situation, now: float) -> None:
        self.cause = Cause("booting", situation.booting or situation.bus, "drives booted")
        if situation.shutdown_requested:
            self._end(_as_cause(SHUTDOWN, situation))
        elif not situation.booting and not situation.bus:
            self.state = DriverState.DISARMED
            self._disarmed(situation, now)

    def _disarmed(self, situation: Situation, _now: float) -> None:
        blocker = _first(BLOCKERS, situation)
        if situation.booting:
            self.state, self.cause = DriverState.BOOTING, Cause("booting", situation.booting, "drives booted")
        elif blocker is None:
            self.state, self.cause = DriverState.ENABLING, Cause("enabling", "", "operation enabled on all drives")
        elif blocker is SHUTDOWN:
            self._end(_as_cause(blocker, situation))
        else:
            self.cause = _as_cause(blocker, situation)
            if blocker.name in LATCHED_WITHOUT_POWER:
                self.state = DriverState.LATCHED

    def _enabling(self, situation: Situation, now: float) -> None:
        hazard = _first([hazard for hazard in HAZARDS if hazard.name != "drive disabled"], situation)
        if hazard is not None:
            self._stop(hazard, situation)
        elif not situation.disabled:
            self.state, self.cause = DriverState.ENABLED, Cause()
        elif now - self._since_s > ENABLE_TIMEOUT_S:
            self._latch = True
            self.state, self._step = DriverState.STOPPING, Step.OFF
            self.cause = Cause("enable timeout", f"{situation.disabled} after {ENABLE_TIMEOUT_S:.1f} s", "reset")

    def _enabled(self, situation: Situation, _now: float) -> None:
        hazard = _first(HAZARDS, situation)
        if hazard is not None:
            self._stop(hazard, situation)

    def _stopping(self, situation: Situation, now: float) -> None:
        elapsed_s = now - self._since_s
        worse = _first([hazard for hazard in HAZARDS if hazard.quick], situation)
        if self._step is Step.RAMP:
            if worse is not None:
                self._stop(worse, situation)
            elif situation.standstill:
                self._step = Step.OFF
            elif elapsed_s > self._ramp_timeout_s:
                self._step = Step.QUICK
        elif self._step is Step.QUICK:
            if elapsed_s > 0.0 and (situation.standstill or elapsed_s > QUICK_STOP_TIMEOUT_S):
                self._step = Step.OFF
        elif not situation.powered or elapsed_s > POWER_OFF_TIMEOUT_S:
            self._end(self.cause)

    def _latched(self, situation: Situation, _now: float) -> None:
        if situation.shutdown_requested:
            self._end(_as_cause(SHUTDOWN, situation))

    def _stop(self, hazard: Hazard, situation: Situation) -> None:
        self._step = Step.QUICK if hazard.quick else Step.RAMP
        self._latch = self._latch or hazard.latched
        if self.state is not DriverState.STOPPING:
            self.cause = _as_cause(hazard, situation)
        self.state = DriverState.STOPPING

    def _end(self, cause: Cause) -> None:
        self.cause = cause
        self.finished = cause.name == SHUTDOWN.name
        self.state = DriverState.LATCHED if self._latch else DriverState.DISARMED

    _RULES: ClassVar[dict[DriverState, Callable[[Supervisor, Situation, float], None]]] = {
        DriverState.BOOTING: _booting,
        DriverState.DISARMED: _disarmed,
        DriverState.ENABLING: _enabling,
        DriverState.ENABLED: _enabled,
        DriverState.STOPPING: _stopping,
        DriverState.LATCHED: _latched,
    }


def _first(hazards: tuple[Hazard, ...] | list[Hazard], situation: Situation) -> Hazard | None:
    return next((hazard for hazard in hazards if hazard.seen(situation)), None)


def _as_cause(hazard: Hazard, situation: Situation) -> Cause:
    return Cause(hazard.name, hazard.seen(situation), hazard.clears_on)
