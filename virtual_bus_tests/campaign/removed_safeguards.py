"""Safeguards that can be taken out, one at a time: a campaign that then finds nothing would prove nothing.

Rows are dropped from the tables of watchdog and driver, which are read from their modules: a new check, detector, rung,
hazard or blocker is here at once, and test_teeth.py fails until safeguard_needs.py has its row. The others are one
method each.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType
from typing import Any

from canbase_action_server import causes
from canbase_action_server.outcome import ErrorCode
from canbase_base.latch_record import CLEAR, Defect, Found
from canbase_campaign.disk import StopDisk
from canbase_driver import core
from canbase_driver.causes import DriverCause
from canbase_driver.drives.release_test import ReleaseTest, TorqueEvidence
from canbase_driver.motion.braking import Braking
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.motion.limiter import Limiter, MotionState
from canbase_driver.motion.odometry import WheelTravel
from canbase_driver.motion.velocity_command import VelocityCommand
from canbase_driver.supervision import fault_reset, state_machine, watchdog_link
from canbase_driver.supervision.hazards import BLOCKERS, HAZARDS, Blocker, Hazard
from canbase_driver.supervision.lifecycle import Aim
from canbase_driver.supervision.phases import Phase
from canbase_runtime.watchdog_view import WatchdogView
from canbase_sim.cia301.heartbeat import HeartbeatConsumer
from canbase_velocity import coverage, filter_state, lock, mux, neutral, obstacle, safety_filter
from canbase_velocity.decision import PASSED
from canbase_velocity.estop import FREE, HELD
from canbase_velocity.frozen import FrozenWatch
from canbase_velocity.scan import Scan
from canbase_velocity.sweep import NO_TOUCH
from canbase_watchdog import frames, ladder, lease, policy, stopper, watchdog
from canbase_watchdog.hard_braking import HardBraking
from canbase_watchdog.ladder import RUNGS, Step
from canbase_watchdog.slowing import SlowingWatch
from canbase_watchdog.standstill import StandstillWatch
from canbase_watchdog.stopper import Stopper
from canbase_watchdog.trip_cause import FINE, TripCause
from canbase_watchdog.unasked_torque import UnaskedTorque
from canbase_watchdog.view import Axis
from canbase_watchdog.watchdog import State, Watchdog


def _drop(module: ModuleType, wanted: Callable[[Any], bool]) -> Callable[[], None]:
    """Rows that are not `wanted` leave every table of the module."""

    def take_out() -> None:
        for name, table in list(vars(module).items()):
            if isinstance(table, tuple) and any(not wanted(row) for row in table):
                setattr(module, name, tuple(row for row in table if wanted(row)))
            if name == "BY_PHASE":
                table |= {phase: tuple(row for row in rows if wanted(row)) for phase, rows in table.items()}

    return take_out


def _put(owner: Any, name: str, value: Any) -> Callable[[], None]:
    if not hasattr(owner, name):
        raise AttributeError(f"{owner.__name__} has no {name}: its safeguard would not be removed")
    return lambda: setattr(owner, name, value)


def _trip(cause: TripCause) -> Callable[[], None]:
    return _drop(policy, lambda row: getattr(row, "cause", None) is not cause)


def _reason(kind: type[Blocker | Hazard], cause: DriverCause) -> Callable[[], None]:
    def stays(row: Any) -> bool:
        reason = getattr(row, "reason", row)
        return not (isinstance(reason, kind) and reason.cause is cause)

    return _drop(state_machine, stays)


def _all_trips() -> None:
    _put(policy, "CHECKS", ())()


def _no_latch() -> None:
    """A trip ends by itself when everything stands."""
    tick = Watchdog.tick

    def forgetful(self: Watchdog, now_s: float) -> Any:
        frames = tick(self, now_s)
        if self._state is State.TRIPPED and self._settled:
            self._state, self._verdict, self._stoppers = State.WATCHING, FINE, []
        return frames

    Watchdog.tick = forgetful  # type: ignore[method-assign]


def _driver_forgets() -> None:
    """A latched stop of the driver ends by itself."""
    state_machine.BY_PHASE[Phase.LATCHED] = state_machine.BY_PHASE[Phase.DISARMED]


def _forget_estop(self: filter_state.SafetyFilter, now_s: float) -> None:
    """Released, the emergency stop is free at once."""
    self._estop.state = HELD if self._pressed(now_s) else FREE


def _no_estop(self: filter_state.SafetyFilter, now_s: float) -> None:
    """Whatever was pressed, nothing of it is left when an order is decided."""
    self._estop.state = FREE


def _no_records() -> None:
    """Whatever stands on the disk, a driver and a filter that start find that nothing was latched."""
    _clear_for("driver", "velocity")


def _watchdog_forgets() -> None:
    """Whatever stands on the disk, a watchdog that starts finds that it had not tripped."""
    _clear_for("watchdog")


def _clear_for(*parts: str) -> None:
    found = StopDisk.found
    StopDisk.found = lambda self: found(StopDisk(self.part) if self.part in parts else self)  # type: ignore[method-assign]


def _unreadable_is_clear() -> None:
    """A record of stops that cannot be read counts as an empty one."""
    found = StopDisk.found

    def found_or_clear(self: StopDisk) -> Found:
        return CLEAR if found(self).defect is not Defect.NONE else found(self)

    StopDisk.found = found_or_clear  # type: ignore[method-assign]


def _resets_while_commanded() -> None:
    """A reset is not refused, and not broken off, because a command orders motion."""
    commanded = fault_reset._BUS_OR_COMMAND[0]
    fault_reset.REFUSALS = tuple(check for check in fault_reset.REFUSALS if check is not commanded)
    for phase, checks in fault_reset.BREAKS.items():
        fault_reset.BREAKS[phase] = tuple(check for check in checks if check is not commanded)


def _never_frozen(self: FrozenWatch, scan: Scan, now_s: float, *, moves: bool) -> str:
    self.since = now_s
    return ""


def _brakes_softly_too(take_out: Callable[[], None]) -> Callable[[], None]:
    """Without a recent state frame of the watchdog the driver brakes hard by itself: that is taken out as well."""

    def both() -> None:
        take_out()
        _put(watchdog_link.WatchdogLink, "brakes_hard", lambda self, now_s: False)()

    return both


def _sign(name: str) -> Callable[[], None]:
    return _drop(policy, lambda row: getattr(row, "name", "") != name)


def _no_quick_stop() -> None:
    """The PDO is sent from "disable voltage" on."""
    word = Stopper._stop_word
    late = Step.DISABLE_VOLTAGE
    Stopper._stop_word = lambda self, now_s: word(self, now_s) if self.ladder.step >= late else []  # type: ignore[method-assign]


def _no_pre_operational() -> None:
    Stopper._pre_operational = lambda self, now_s: []  # type: ignore[method-assign]
    del stopper._WORD_BY_STEP[Step.PRE_OPERATIONAL]


def _no_disable_voltage() -> None:
    """Whatever the rung, PDO and SDO say quick stop."""
    frames.disable_voltage = frames.quick_stop
    stopper._WORD_BY_STEP.update(dict.fromkeys(stopper._WORD_BY_STEP, frames.QUICK_STOP_WORD))


WITHOUT_RUNG: dict[Step, Callable[[], None]] = {
    Step.QUICK_STOP: _no_quick_stop,
    Step.PRE_OPERATIONAL: _no_pre_operational,
    Step.DISABLE_VOLTAGE: _no_disable_voltage,
    Step.HEARTBEAT_WITHHELD: _put(Watchdog, "_sends_heartbeat", property(lambda self: True)),
    Step.RESET_NODE: _put(Stopper, "_reset_node", lambda self, now_s: []),
}
"""The ladder is climbed as it was; what the rung sends is not sent."""


def _both(one: Callable[[], None], other: Callable[[], None]) -> Callable[[], None]:
    def take_out() -> None:
        one()
        other()

    return take_out


def _any_lease(datagram: bytes) -> lease.Lease | lease.Refusal:
    """Whatever its magic number, its checksum and its values are."""
    if len(datagram) != lease.LAYOUT.size:
        return lease.Refusal.LENGTH
    _magic, sequence, stamp_ns, linear, angular, flags, _checksum = lease.LAYOUT.unpack(datagram)
    return lease.Lease(sequence, stamp_ns, linear, angular, flags)


def _at_once(
    self: Limiter, current: MotionState, target: Twist2D, dt_s: float, *, emergency: bool = False
) -> MotionState:
    return MotionState(Twist2D.ZERO if emergency else self.limit(target))


def _name(cause: DriverCause) -> str:
    return cause.value.replace(" ", "_")


NEVER = property(lambda self: False)
SIGNS = (*policy.OF_THE_SETPOINTS, *policy.IMPLAUSIBLE, *policy.MISSING)
"""Detectors of one row of policy.CHECKS each."""

SAFEGUARDS: dict[str, Callable[[], None]] = {
    **{f"watchdog:{sign.name}": _sign(sign.name) for sign in SIGNS},
    **{f"ladder:{step.name.lower()}": WITHOUT_RUNG[step] for step in RUNGS},
    "ladder:braking": _put(ladder.Braking, "allowed_mps", lambda self, from_mps, elapsed_s: math.inf),
    "ladder:slowing": _put(SlowingWatch, "fails", NEVER),
    "ladder:faulty_sensor": _put(Axis, "trusted", property(lambda self: True)),
    "ladder:sudden": _both(_put(StandstillWatch, "sudden", NEVER), _put(StandstillWatch, "unproven", NEVER)),
    "watchdog:unasked_torque": _both(_put(UnaskedTorque, "is_due", NEVER), _put(UnaskedTorque, "is_dead", NEVER)),
    "watchdog:hard_braking": _put(HardBraking, "on_lease", lambda self, lease, now_s: None),
    "watchdog:lease_times": _put(lease, "judge", lambda new, last, timeout_s, now_s: None),
    "watchdog:lease_form": _put(lease, "parse", _any_lease),
    "watchdog:reset_needs_stand": _both(
        _put(Stopper, "settled", property(lambda self: True)), _put(Stopper, "is_fresh", lambda self, now_s: True)
    ),
    "watchdog:reset_needs_end_of_cause": _put(policy, "stands", lambda verdict, view, config, now_s: False),
    "watchdog:reset_needs_zero": _put(watchdog, "velocity_ordered", lambda view, config, now_s: False),
    **{f"power:{_name(row.cause)}": _reason(Blocker, row.cause) for row in BLOCKERS},
    "driver:speed_limit": _put(Limiter, "limit", lambda self, target: target),
    "driver:acceleration_limit": _put(Limiter, "step", _at_once),
    "driver:braking": _put(Braking, "fails", lambda self, speed_mps, now_s: False),
    "filter:speed": _put(obstacle, "speed_factor", lambda twist, linear_mps, angular_radps: 1.0),
    "filter:growth": _put(safety_filter, "_growth", lambda twist, inputs, ceiling: (twist, PASSED)),
    "filter:limit_zones": _put(coverage, "zone_factor", lambda twist, zone, sight, geometry: 1.0),
    "filter:speed_limit": _put(safety_filter, "_lowered", lambda inputs: PASSED),
    "filter:uncommissioned": _put(safety_filter.FilterConfig, "uncommissioned", property(lambda self: "")),
    "filter:blind_mps": _put(safety_filter, "_unseen", lambda inputs, config: []),
    "filter:scan": _put(safety_filter, "missing_scan", lambda inputs: None),
    "filter:brakes_hard": _put(safety_filter, "brakes_hard", lambda inputs, config: False),
    "mux:lock": _put(lock.Lock, "hear", lambda self, locked, now_s: None),
    "mux:late_commands": _put(mux._Source, "why_late", property(lambda self: "")),
    **{f"watchdog:{check.cause.name.lower()}": _trip(check.cause) for check in policy.CHECKS},
    "watchdog:all": _all_trips,
    "watchdog:latch": _no_latch,
    **{f"driver:{_name(row.cause)}": _reason(Hazard, row.cause) for row in HAZARDS},
    "driver:latch": _driver_forgets,
    "driver:watchdog_missing": _brakes_softly_too(_reason(Hazard, DriverCause.WATCHDOG_MISSING)),
    "driver:asks_for_watchdog": _brakes_softly_too(
        _put(watchdog_link.WatchdogLink, "view", lambda self, now_s: (WatchdogView.OK, ""))
    ),
    "driver:command_timeout": _put(VelocityCommand, "_fresh", lambda self, now_s: self._command.within(1e9, now_s)),
    "driver:zero_before_motion": _put(VelocityCommand, "await_zero", lambda self: None),
    "driver:command_is_finite": _put(Twist2D, "is_finite", property(lambda self: True)),
    "driver:odometry_jump_guard": _put(WheelTravel, "_is_near", lambda self, from_raw, raw, cycles: True),
    "driver:stop_record": _no_records,
    "driver:switched_off": _put(core, "allowed_before_the_start", lambda found: Aim.ACTIVE),
    "driver:reset_needs_zero": _resets_while_commanded,
    "watchdog:stop_record": _watchdog_forgets,
    "records:unreadable": _unreadable_is_clear,
    "drives:heartbeat_consumer": _put(HeartbeatConsumer, "tick", lambda self, now_s: None),
    "mux:neutral_start": _put(neutral.Arming, "armed", property(lambda self: True)),
    "mux:lock_publishers": _put(lock.Lock, "published_by", lambda self, nodes: None),
    "driver:release_test": _put(ReleaseTest, "_is_due", lambda self, wheels: False),
    "driver:unasked_torque": _put(TorqueEvidence, "_note_change", lambda self, begins, elapsed_s: None),
    "mux:timeout": _put(mux._Source, "fresh", lambda self, now_s: self.command.within(1e9, now_s)),
    "filter:estop": _put(filter_state.SafetyFilter, "_advance_estop", _no_estop),
    "filter:obstacle": _put(obstacle, "first_touch", lambda points, box, twist, stop_m: NO_TOUCH),
    "filter:blind": _put(coverage, "uncovered", lambda order, sight, geometry: None),
    "filter:frozen": _put(FrozenWatch, "check_scan", _never_frozen),
    "filter:repeated_stamp": _put(FrozenWatch, "is_repeated", lambda self, scan: False),
    "filter:late_scans": _put(filter_state._Scanner, "_late_s", lambda self, scan, now_s, wall_s: 0.0),
    "filter:command": _put(safety_filter, "_command", lambda inputs, config: None),
    "filter:zero_after_estop": _put(filter_state.SafetyFilter, "_advance_estop", _forget_estop),
    "action:timeout_and_progress": _drop(
        causes, lambda row: getattr(row, "code", None) not in (ErrorCode.TIMEOUT, ErrorCode.NO_PROGRESS)
    ),
}  # fmt: skip
"""Name → how to take it out."""


def refuse_compiled(names: str) -> None:
    """Raises RuntimeError where `names` shall be taken out of compiled modules: it would have no effect."""
    if names and not str(policy.__file__).endswith(".py"):
        raise RuntimeError(f"{names} cannot be taken out of compiled modules: run it without COMPILED=1")


def remove(names: str) -> None:
    """Take `names`, with + between them, out of the code of this process.

    Raises KeyError for an unknown one, and RuntimeError in a compiled world.
    """
    refuse_compiled(names)
    for name in names.split("+") if names else ():
        SAFEGUARDS[name]()
