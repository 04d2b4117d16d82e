"""The safety filter over time: what came in when, and what was ordered. Deciding is safety_filter.py."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from canbase_base.latch_record import Found, Record
from canbase_config.safety import Scan as ScanConfig
from canbase_runtime.received import NEVER, Received
from canbase_runtime.stop_cause import StopCause
from canbase_velocity.clearance import NOWHERE, Clearances, Field, Points, ScanReader, clearances
from canbase_velocity.decision import Action, Decision
from canbase_velocity.delay import Delay, Sent
from canbase_velocity.estop import Estop, EstopEvent, EstopState
from canbase_velocity.frozen import FrozenWatch
from canbase_velocity.glitch import GlitchFilter
from canbase_velocity.motion import ExpectedMotion, Pose
from canbase_velocity.obstacle import Geometry, Sight
from canbase_velocity.placement import Placement
from canbase_velocity.safety_filter import (
    SHUTDOWN,
    FilterConfig,
    Inputs,
    ScanState,
    brakes_hard,
    decide,
    missing_scan,
)
from canbase_velocity.scan import Scan, ScanError
from canbase_velocity.sole_publisher import SolePublisher
from canbase_velocity.speed_limit import NO_LIMIT, SpeedLimit
from canbase_velocity.sweep import Floats
from canbase_velocity.twist import ZERO, Twist

WITHOUT_SCANS_S = 1.0
"""After this long without usable scans a source that ordered motion meanwhile is disarmed (neutral.py) [s]."""
NO_SCAN = (
    StopCause.SCAN_STALE,
    StopCause.SCAN_UNPLACED,
    StopCause.SCAN_INVALID,
    StopCause.SCAN_FROZEN,
    StopCause.SCAN_BLIND,
)
LONGEST_SINCE_S = 0.1
"""Orders after a longer gap may grow as far as after this one [s]."""
NOT_LATCHED = "The emergency stop is not latched: nothing to reset"


@dataclass(frozen=True, slots=True)
class _Seen:
    """What one scan shows, as far as it can matter. `field` None: it looks everywhere."""

    points: Floats
    field: Field | None
    clearances: Clearances
    measured_from_s: float


class _Scanner:
    """One scanner: its newest scan, reduced to what can matter."""

    def __init__(self, config: ScanConfig, geometry: Geometry) -> None:
        self.config = config
        self._geometry = geometry
        self._reader = ScanReader(config, geometry.box)
        self._frozen = FrozenWatch(config.frozen_s, noisy=config.noisy)
        self._glitches = GlitchFilter(config.min_points)
        self.sole = SolePublisher()
        self._delay = Delay(config.same_clock)
        self._reach_m = geometry.reach_m(config.timeout_s)
        self._seen: Received[_Seen] = NEVER
        self._problem = self._why_dropped = ""
        self._cause = StopCause.SCAN_STALE
        self._dropped = 0
        self._share: float | None = None
        self._first: Field | None = None

    def receive(self, scan: Scan, placement: Placement, now_s: float, wall_s: float, *, moves: bool) -> None:
        """A scan as it came. One that cannot be used is dropped and counted."""
        if self.sole.problem:
            self.drop(StopCause.SCAN_INVALID, self.sole.problem, at_once=True)
            return
        if self._frozen.is_repeated(scan):
            self.drop(StopCause.SCAN_FROZEN, "the stamp of its scans does not change")
            return
        try:
            view = self._reader.read(scan, placement)
        except ScanError as error:
            self.drop(StopCause.SCAN_INVALID, str(error))
            return
        frozen = self._frozen.check_scan(scan, now_s, moves=moves)
        if frozen:
            self.drop(StopCause.SCAN_FROZEN, frozen, at_once=True)
            return
        late_s = self._late_s(scan, now_s, wall_s)
        if self._delay.set_back:
            self.drop(StopCause.SCAN_INVALID, "its stamp is below that of the scan before")
            return
        why_late = self._delay.why_late(late_s, self.config.timeout_s)
        if why_late:
            self.drop(StopCause.SCAN_STALE, why_late)
            return
        self._share = view.share
        self.accept_points(
            view.points, view.field, now_s - self._frozen.since + scan.scan_time_s + max(late_s, 0.0), now_s
        )

    def _late_s(self, scan: Scan, now_s: float, wall_s: float) -> float:
        """[s]. The stamps of a simulator are of its own time, which may be slower."""
        if scan.stamp_ns is None or not self.config.noisy:
            return 0.0
        return self._delay.measure(Sent(scan.stamp_ns * 1e-9, wall_s, now_s))

    def drop(self, cause: StopCause, why: str, *, at_once: bool = False) -> None:
        """A scan that does not count. `at_once`: neither does the one before; otherwise that counts until it is old."""
        self._dropped += 1
        self._cause, self._why_dropped = cause, why
        self._problem = why if at_once else self._problem

    def accept_points(self, points: Points, field: Field | None, scan_time_s: float, now_s: float) -> None:
        """A scan with readings; its first reading was taken `scan_time_s` before."""
        limits = self._geometry.limits
        since_s = min(self._seen.age_s(now_s), self.config.timeout_s)
        genuine = self._glitches.genuine(points, limits.linear_mps * since_s, limits.angular_radps * since_s)
        near = genuine[self._geometry.box.distances_m(genuine) <= self._reach_m]
        if field is not None:
            field = replace(field, first=self._first, topic=self.config.topic)
            self._first = self._first or field
        from_s = now_s - min(max(scan_time_s, 0.0), self.config.timeout_s + self.config.frozen_s)
        self._seen = Received(_Seen(near, field, clearances(genuine, self._geometry.box), from_s), now_s)
        self._problem = self._why_dropped = ""

    def state(self, now_s: float) -> ScanState:
        config = self.config
        return ScanState(
            config.topic,
            config.required,
            config.timeout_s,
            self._seen.age_s(now_s),
            self._problem,
            self._cause,
            self._dropped,
            self._why_dropped,
            self._share,
            config.same_clock or not config.noisy,
        )

    def seen(self, now_s: float) -> _Seen | None:
        """What its last scan shows; None: that does not count, or there is none."""
        return self._seen.within(self.config.timeout_s, now_s) if self.state(now_s).is_fresh else None

    @property
    def first(self) -> Field | None:
        """Where its first scan that counted looked; None: there was none."""
        return self._first


class SafetyFilter:
    """Keeps the newest of each input. Starts with nothing received: that is a stop for everything required."""

    def __init__(self, config: FilterConfig, found: Found | None = None) -> None:
        """`found`: the record of the emergency stop at the start; None: no record is kept, for virtual time alone."""
        self._config = config
        self._command: Received[Twist] = NEVER
        self._scanners = {scan.topic: _Scanner(scan, config.geometry) for scan in config.safety.scans}
        self._estop = Estop(config.safety.estop.latched, found)
        self._held_at_start = self._estop.state is EstopState.HELD
        self._button: Received[bool] = NEVER
        self._estop_unheard = ""
        self.estop_crowd = ""
        """Why a release of the emergency stop cannot be seen; empty: it can."""
        longest_s = max(2.0 * scan.timeout_s + scan.frozen_s for scan in config.safety.scans) + config.safety.reaction_s
        self._motion = ExpectedMotion(config.limits, longest_s)
        self._previous, self._previous_at_s = ZERO, -math.inf
        self._braking_hard = False
        self._speed_limit, self._speed_limit_by = NO_LIMIT, ""
        self._ending = False
        self._no_scan_from = math.inf
        self.without_scans = ""
        """Why the base is held for WITHOUT_SCANS_S or longer for want of usable scans; empty: it is not."""

    @property
    def estop(self) -> EstopState:
        """What the emergency stop wants."""
        return self._estop.state

    @property
    def record(self) -> Record:
        """What shall be on disk now of the emergency stop."""
        return self._estop.record

    @property
    def record_is_on_disk(self) -> bool:
        """It is there."""
        return self._estop.record_is_on_disk

    def on_record(self, written: Record | None, problem: str) -> None:
        """The newest record on disk (None: none since the start), and what keeps the writer from writing."""
        self._estop.on_written(written, problem)

    def end(self) -> None:
        """An orderly end is complete, but for messages of the emergency stop that still come."""
        self._estop.end()

    def on_speed_limit(self, limit: SpeedLimit, by: str) -> None:
        """Takes a speed limit that holds from now on, and who has set it."""
        self._speed_limit, self._speed_limit_by = limit, by

    def accept_command(self, twist: Twist, now_s: float) -> None:
        """Takes a command of cmd_vel_mux, also one with NaN: that stops."""
        self._command = Received(twist, now_s)

    def on_points(
        self, topic: str, points: Points, field: Field | None, now_s: float, scan_time_s: float = 0.0
    ) -> None:
        """Takes what a scan shows. `field` None: it looks everywhere. Raises KeyError for another topic."""
        self._scanners[topic].accept_points(points, field, scan_time_s, now_s)

    def on_laser_scan(self, topic: str, scan: Scan, placement: Placement, now_s: float, wall_s: float) -> None:
        """Takes a scan as it came at `now_s` [s, monotonic], `wall_s` by this computer's clock; drops and counts one
        that cannot be used. Raises KeyError for another topic."""
        self._motion.advance(now_s)
        self._scanners[topic].receive(scan, placement, now_s, wall_s, moves=not self._motion.moving.twist.is_zero)

    def on_scan_publishers(self, topic: str, nodes: Sequence[str], keys: Sequence[str], now_s: float) -> None:
        """Takes the publishers on the topic of a scanner: a node's name and a key for each. Raises KeyError for another
        topic.
        """
        self._scanners[topic].sole.check_publishers(nodes, keys, now_s)

    def on_unplaced_scan(self, topic: str, problem: str) -> None:
        """A scan came whose scanner cannot be placed. Raises KeyError for another topic."""
        self._scanners[topic].drop(StopCause.SCAN_UNPLACED, problem, at_once=True)

    def on_estop(self, pressed: bool, now_s: float) -> None:
        """Takes a message of the emergency stop: true = stop."""
        self._button = Received(pressed, now_s)
        if pressed:
            self._estop.happens(EstopEvent.PRESS)

    def on_estop_publishers(self, count: int, unheard: str = "") -> None:
        """Takes how many publishers its topic has: the last word of one is not that of another.

        `unheard`: of one whose messages do not arrive, which counts as pressed; empty: there is none.
        """
        self._estop_unheard = unheard
        topic = self._config.safety.estop.topic
        advice = "no release counts; give each button a lock of its own (mux.locks), or join them in one node"
        self.estop_crowd = f"{topic} has {count} publishers: {advice}" if count > 1 else ""

    def reset(self, moving: Sequence[str], now_s: float) -> tuple[bool, str]:
        """Whether the emergency stop is free now, and a sentence. `moving`: sources that do not order zero."""
        self._advance_estop(now_s)
        inputs = self.inputs(now_s)
        if self._estop.state is EstopState.HELD:
            held = "pressed" if inputs.pressed else self._estop_unheard or self.estop_crowd or "not published"
            if inputs.pressed and self._button.never:
                held = f"not seen released yet ({self._estop.before_the_start}): press and release it"
            return False, f"refused: the emergency stop on {self._config.safety.estop.topic} is {held}"
        if self._estop.state is EstopState.FREE and not moving:
            return True, NOT_LATCHED
        if self.estop_crowd and self._estop.state is not EstopState.FREE:
            return False, f"refused: {self.estop_crowd}"
        if moving or not inputs.command.is_zero:
            who = ", ".join(moving) or "cmd_vel_mux"
            return False, f"refused: {who} orders a velocity; release the joystick or cancel the goal, then reset"
        self._estop.happens(EstopEvent.RESET)
        return True, "emergency stop reset; the next command is followed"

    def inputs(self, now_s: float) -> Inputs:
        """What is known at time `now_s` [s, monotonic]."""
        scans = tuple(scanner.state(now_s) for scanner in self._scanners.values())
        pose = self._motion.advance(now_s)
        return Inputs(
            command=self._command.within(math.inf, now_s) or ZERO,
            command_age_s=self._command.age_s(now_s),
            scans=scans,
            sight=self._sight(pose, now_s),
            moving=self._motion.moving,
            previous=self._previous,
            since_s=min(max(now_s - self._previous_at_s, 0.0), LONGEST_SINCE_S),
            estop=self._estop.state,
            pressed=self._pressed(now_s),
            estop_age_s=self._button.age_s(now_s),
            estop_before=self._estop.before_the_start,
            estop_crowd=self._estop_unheard or self.estop_crowd,
            estop_unarmed=self._estop.unarmed,
            braking_hard=self._braking_hard,
            speed_limit=self._speed_limit,
            speed_limit_by=self._speed_limit_by,
        )

    def clearances(self, now_s: float) -> Clearances | None:
        """The free way straight ahead and behind, by all fresh scans; None without any."""
        fresh = [seen.clearances for _, seen in self._fresh(now_s)]
        if not fresh:
            return None
        return Clearances(min(each.ahead_m for each in fresh), min(each.behind_m for each in fresh))

    def decide(self, now_s: float) -> Decision:
        """The order at time `now_s` [s, monotonic]; it counts as given."""
        if self._ending:
            return self.shut_down(now_s)
        self._advance_estop(now_s)
        inputs = self.inputs(now_s)
        decision = decide(inputs, self._config)
        self._watch_scans(inputs, decision, now_s)
        return self._ordered(decision, now_s)

    def shut_down(self, now_s: float) -> Decision:
        """The zero of a filter that ends, now and from here on; where the base brakes hard, it goes on to do so."""
        self._ending = True
        emergency = brakes_hard(self.inputs(now_s), self._config)
        return self._ordered(replace(SHUTDOWN, emergency=emergency), now_s)

    def _watch_scans(self, inputs: Inputs, decision: Decision, now_s: float) -> None:
        """Also while something else stops the base: a command that is late for a moment does not begin it anew."""
        held = missing_scan(inputs) or decision
        missing = held.action is Action.STOP and held.cause in NO_SCAN
        self._no_scan_from = min(self._no_scan_from, now_s) if missing else math.inf
        long = now_s - self._no_scan_from >= WITHOUT_SCANS_S
        self.without_scans = f"no usable scan for {WITHOUT_SCANS_S:.1f} s: {held.cause.value}" if long else ""

    def _ordered(self, decision: Decision, now_s: float) -> Decision:
        self._motion.order(decision.twist, now_s)
        self._previous, self._previous_at_s = decision.twist, now_s
        self._braking_hard = decision.emergency
        return decision

    def _fresh(self, now_s: float) -> list[tuple[_Scanner, _Seen]]:
        every = ((scanner, scanner.seen(now_s)) for scanner in self._scanners.values())
        return [(scanner, seen) for scanner, seen in every if seen is not None]

    def _sight(self, pose: Pose, now_s: float) -> Sight:
        """Each place as it was scanned and as the base must see it by now, where that differs."""
        fresh = self._fresh(now_s)
        parts = [NOWHERE]
        for _, seen in fresh:
            there = self._motion.pose_at(seen.measured_from_s - self._config.safety.reaction_s)
            parts.append(seen.points)
            if not pose.is_at(there) and seen.points.shape[0] > 0:
                parts.append(pose.from_here(seen.points, there))
        known = (seen.field for scanner, seen in fresh if scanner.state(now_s).knows_age)
        fields = tuple(field for field in known if field is not None)
        lost = (scanner.first for scanner in self._scanners.values() if scanner.seen(now_s) is None)
        sees_all = any(seen.field is None for _, seen in fresh)
        points = np.concatenate(parts) if len(parts) > 2 else parts[-1]
        ages_s = (max(now_s - seen.measured_from_s, scanner.config.timeout_s) for scanner, seen in fresh)
        return Sight(
            points,
            () if sees_all else fields,
            max(ages_s, default=0.0),
            tuple(field for field in lost if field is not None),
            everywhere=sees_all,
        )

    def _advance_estop(self, now_s: float) -> None:
        """A fresh zero command counts only while the emergency stop is free. In a crowd neither does a release."""
        settings = self._config.safety
        silent = self._button.within(settings.estop.timeout_s, now_s) is None
        if self._estop_unheard or (settings.estop.required and silent):
            self._estop.happens(EstopEvent.SILENCE)
        elif self.estop_crowd:
            return
        elif self._button.within(math.inf, now_s) is False:
            self._estop.happens(EstopEvent.RELEASE)
        command = self._command.within(settings.command_timeout_s, now_s)
        if command is not None and command.is_zero:
            self._estop.happens(EstopEvent.ZERO)

    def _pressed(self, now_s: float) -> bool:
        """By the last word of the button, however old: its timeout is looked at beside. Before it, by the record."""
        return self._held_at_start if self._button.never else bool(self._button.within(math.inf, now_s))
