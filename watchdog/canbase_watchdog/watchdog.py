"""The watchdog without sockets and clock: frames and leases in, frames out. States and answers: docs/bus.md."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, replace

from canbase_base.latch_record import Found, Mark, Record, WriteAhead
from canbase_config.watchdog import STATE_PERIOD_S, WatchdogConfig
from canbase_watchdog import frames, policy
from canbase_watchdog.envelope import Envelope
from canbase_watchdog.frames import Frame
from canbase_watchdog.guarding import GuardRequests
from canbase_watchdog.hard_braking import HardBraking
from canbase_watchdog.ladder import Step
from canbase_watchdog.lease import LeaseBook, Refusal
from canbase_watchdog.left_right import LeftRightWatch
from canbase_watchdog.observer import Observer
from canbase_watchdog.power_and_motion import in_motion, is_off, near_power, velocity_ordered
from canbase_watchdog.ramp_to_zero import RampToZeroWatch
from canbase_watchdog.setpoint_at_rest import SetpointAtRestWatch
from canbase_watchdog.stopper import Stopper
from canbase_watchdog.trip_cause import FINE, SENSOR_CAUSES, TripCause, Verdict, before_the_start, code_of, has_opened
from canbase_watchdog.twist import TwistWatch
from canbase_watchdog.view import BusView, View

COUNTERS_PERIOD_S = 0.5
REPEATED_REQUEST_S = 1.0
"""A reset request with the number of the last one is a copy of it for this long, and a new one after [s]."""


class State(enum.IntEnum):
    """Byte 0 of the state frame."""

    STARTING = 0
    WATCHING = 1
    TRIPPED = 2


class Answer(enum.IntEnum):
    """Byte 7 of the state frame."""

    NONE = 0
    DONE = 1
    CAUSE_STANDS = 2
    VELOCITY_ORDERED = 3
    NOT_TRIPPED = 4


@dataclass(frozen=True, slots=True)
class Status:
    """The watchdog's state, apart from ages and counters. `reset`: last request and its answer."""

    state: State
    verdict: Verdict
    step: Step
    settled: bool
    reset: tuple[int, Answer]
    assumed: bool = False
    """Some drive was not seen to stand: its sensor cannot be trusted, and its power is off for longer than it rolls."""
    armed: bool = False
    """The record on disk is LIVE, and frames of the driver arrive: a watchdog without reception never reports it."""
    brakes_hard: bool = False
    """The driver has to brake with the emergency deceleration, to standstill."""
    unproven: str = ""
    """While it is tripped: the joint that stopped as no wheel can, by what its sensors report; empty: none did."""


class Watchdog:
    """Trips when policy.py says so and then stops every drive until a reset. All times are monotonic seconds.

    States: STARTING until it has listened for as long as a heartbeat may take (it trips already), then WATCHING;
    TRIPPED from the first cause on, latched: only an accepted reset request leads back to WATCHING, over restarts too.
    """

    def __init__(
        self, config: WatchdogConfig, now_s: float, past: Found | None = None, *, loopback: bool = True
    ) -> None:
        """`config.lease_uid` None: leases of any user count, so the caller puts in its own.

        `past`: the record of its last life; None: no record is kept, which is for virtual time alone. `loopback`: what
        it sends comes back to it.
        """
        self._config = config
        self._observer = Observer(config, now_s, loopback=loopback)
        self._envelope = Envelope(config, now_s)
        self._left_right = LeftRightWatch(config)
        self._twist = TwistWatch(config, now_s)
        self._setpoint_at_rest, self._ramp_to_zero = SetpointAtRestWatch(config), RampToZeroWatch(config)
        self._hard = HardBraking()
        self._leases = LeaseBook(config.lease_timeout_s, config.lease_uid)
        self._started_at = self._ticked_at = now_s
        self._bus_failed_since, self._bus_errors = math.inf, 0
        self._view = self._observe(now_s)
        self._fine: BusView | None = None
        """What the bus showed when nothing tripped."""
        self._state = State.STARTING
        self._verdict = FINE
        self._expired = FINE
        """LEASE_LOST between `expire` and the next tick."""
        self._stoppers: list[Stopper] = []
        self._opened = past is not None and has_opened(past.record)
        """The relay has opened for a drive that kept its power, in any life, and no reset was accepted since."""
        self._reset = (0, Answer.NONE)
        self._reset_at = -math.inf
        self._heartbeat_due = self._state_due = self._counters_due = now_s
        self._guard = GuardRequests(config, now_s)
        self._reported_status: Status | None = None
        self._longest_gap_s = 0.0
        self._ledger = WriteAhead(past)
        self.trips = 0
        """Since the start."""
        before = before_the_start(past) if past is not None else FINE
        if before.cause is not TripCause.NONE:
            self._latch(before, now_s, resting=True)
        self._note_record(now_s)

    @property
    def status(self) -> Status:
        """State, cause and rung as of now."""
        assumed = any(stopper.ladder.assumed for stopper in self._stoppers) if self._stoppers else False
        driver_alive = self._ticked_at < self._observer.driver_at + self._config.drive_heartbeat_s
        armed = driver_alive and self._ledger.wanted.mark is Mark.LIVE and self._ledger.is_on_disk
        unproven = self._unproven() if self._state is State.TRIPPED else ""
        state, verdict, hard = self._state, self._verdict, self._hard.holds
        return Status(state, verdict, self._step, self._settled, self._reset, assumed, armed, hard, unproven)

    @property
    def has_unreported_flag(self) -> bool:
        """The driver does not know yet that it has to brake hard: the next tick reports it."""
        return self._hard.holds and not (self._reported_status is not None and self._reported_status.brakes_hard)

    @property
    def verdict(self) -> Verdict:
        """Why it is tripped; FINE, the very object, while it is not."""
        return self._verdict

    def _unproven(self) -> str:
        return next((axis.drive.joint for axis in self._view.axes if axis.unproven and not axis.enabled), "")

    @property
    def record(self) -> Record:
        """What shall be on disk now."""
        return self._ledger.wanted

    def on_record(self, written: Record | None, problem: str) -> None:
        """The newest record on disk (None: none since the start), and what keeps the writer from writing."""
        self._ledger.on_written(written, problem)

    @property
    def keeps_relay(self) -> bool:
        """False on the last two rungs, and for a wheel that was seen not to brake: then a safety relay opens. Where a
        drive has shown that it keeps its power, it stays open until a reset, over restarts too."""
        runaway = any(stopper.ladder.runaway for stopper in self._stoppers)
        return self._sends_heartbeat and not runaway and not self._opened

    @property
    def _sends_heartbeat(self) -> bool:
        """False on the last two rungs: then the own heartbeat is withheld, and the guard requests with it."""
        return self._step < Step.HEARTBEAT_WITHHELD

    @property
    def refused_leases(self) -> dict[Refusal, int]:
        """Datagrams that were no lease, by reason, since the start."""
        return self._leases.refused

    @property
    def dropped_frames(self) -> int:
        """Frames of watched identifiers that could not be understood, since the start."""
        return self._observer.dropped

    def on_frame(self, cob_id: int, data: bytes, now_s: float) -> None:
        """Take in a received frame. Never raises for what is on the bus; own frames that come back change nothing."""
        if cob_id == frames.RESET_REQUEST:
            self._on_reset_request(data, now_s)
        else:
            self._observer.on_frame(cob_id, data, now_s)

    def on_lease(self, datagram: bytes, uid: int | None, now_s: float, pid: int | None = None) -> Refusal | None:
        """Take in a datagram from the lease socket, sent by the user `uid` and the process `pid`. Returns why it does
        not count."""
        refusal = self._leases.take_datagram(datagram, uid, now_s, pid)
        lease = self._leases.last
        if refusal is None and lease is not None:
            self._envelope.order(lease.linear_mps, lease.angular_radps, now_s)
            self._hard.on_lease(lease, now_s)
        return refusal

    def on_bus(self, failed_since: float, errors: int) -> None:
        """How the bus does: since when it has failed [s], infinity when it works, and its errors since the start."""
        self._bus_failed_since, self._bus_errors = failed_since, errors

    def on_suspend(self, duration_s: float) -> None:
        """The computer was suspended for this long [s]. The monotonic clock, and so every age, does not contain it."""
        self._ticked_at -= duration_s

    def expire(self, now_s: float) -> list[Frame]:
        """Quick stops for a lease that has run out since the last tick while a wheel moves, by the frames taken in.

        To be called before the frames that wait are taken in, which may take longer than a stop may wait. None of them
        gives the lease back. The tick that has to follow latches the stop; those frames may show a better cause.
        """
        if self._state is State.TRIPPED or not self._ticked_at < self._lease_ends_at <= now_s:
            return []
        view = replace(self._view, bus=self._observer.bus_view(), lease_at=self._leases.valid_at)
        self._expired = policy.lease_lost(view, self._config, now_s)
        if self._expired.cause is TripCause.NONE:
            return []
        self._observer.ours_since = now_s  # they may come back before the tick
        return self.quick_stops()

    @property
    def _lease_ends_at(self) -> float:
        return self._leases.valid_at + self._config.lease_timeout_s

    def tick(self, now_s: float) -> list[Frame]:
        """Judge and act. Returns the frames to send at once, the stop first. To be called at least every 5 ms."""
        self._view = self._observe(now_s)
        self._longest_gap_s = max(self._longest_gap_s, self._view.tick_gap_s)
        self._ticked_at = now_s
        stop = self._judge(now_s)
        self._note_record(now_s)
        return stop + self._due_frames(now_s)

    def _judge(self, now_s: float) -> list[Frame]:
        if self._state is State.TRIPPED:
            return self._stop(now_s)
        if self._state is State.STARTING and now_s >= self._started_at + self._config.drive_heartbeat_s:
            self._state = State.WATCHING
        verdict = policy.decide(self._view, self._config, now_s, self._fine)
        if verdict.cause is TripCause.NONE:
            verdict = self._expired
        self._expired = FINE
        if verdict.cause is TripCause.NONE:
            self._fine = self._view.bus
            return []
        self._trip(verdict, now_s)
        return self._stop(now_s)

    def next_expiry(self, now_s: float) -> float:
        """When the next timeout would run out [s]: a tick just then stops without delay."""
        return policy.next_expiry(self._leases.valid_at, self._observer.driver_at, self._config, now_s)

    def end(self, now_s: float) -> None:
        """The process is requested to end: with a wheel in motion it must not leave without stopping it."""
        view = self._observe(now_s)
        axis = in_motion(view, self._config)
        if self._state is State.TRIPPED or axis is None:
            return
        detail = f"requested to end while {axis.drive.joint} turns at {axis.velocity_mps:.3f} m/s"
        self._trip(Verdict(TripCause.ENDED, 0, detail), now_s)
        self._note_record(now_s)

    @property
    def sees_power(self) -> bool:
        """Power that nobody has seen off: a life that ends now leaves a record that counts as a stop."""
        return self._ledger.wanted.mark is Mark.LIVE

    def quick_stops(self) -> list[Frame]:
        """A quick stop for every node, whatever the state: for a way out on which nothing else can be trusted."""
        nodes = [drive.node_id for drive in self._config.drives]
        layouts = {drive.node_id: drive.layout for drive in self._config.drives}
        return [frames.quick_stop(node_id, nodes.count(node_id), layout) for node_id, layout in layouts.items()]

    def _observe(self, now_s: float) -> View:
        bus = self._observer.bus_view()
        self._hard.end_at_zero_setpoints(bus.axes)
        hard_since = self._hard.since
        self._observer.brake(self._hard.holds)
        bounds = self._envelope.advance(now_s, hard_since)
        skew = self._left_right.check_setpoints(bus, bounds)
        gap_s = now_s - self._ticked_at
        leases, failed = self._leases, self._bus_failed_since
        base_motion = self._twist.check_motion(bus, now_s)
        at_rest = self._setpoint_at_rest.check_setpoints(bus, bounds, now_s)
        ramp = self._ramp_to_zero.check_setpoints(bus, leases.last, now_s, hard_since)
        started_at, at = self._started_at, leases.valid_at
        return View(bus, bounds, started_at, leases.last, at, skew, base_motion, at_rest, gap_s, failed, ramp)

    def _trip(self, verdict: Verdict, now_s: float) -> None:
        self.trips += 1
        self._latch(verdict, now_s)

    def _latch(self, verdict: Verdict, now_s: float, resting: bool = False) -> None:
        self._state = State.TRIPPED
        self._verdict = verdict
        self._observer.ours_since = -math.inf
        nodes = dict.fromkeys(drive.node_id for drive in self._config.drives)
        lying = verdict.node_id if resting and verdict.cause in SENSOR_CAUSES else 0
        self._stoppers = [
            Stopper(node_id, self._config, self._view, now_s, node_id != lying, resting) for node_id in nodes
        ]

    def _note_record(self, now_s: float) -> None:
        """LIVE before there is power, and until all of it was seen to be off."""
        verdict = self._verdict
        if self._state is State.TRIPPED:
            self._opened = self._opened or any(stopper.ladder.defied for stopper in self._stoppers)
            self._ledger.want(Mark.LATCHED, code_of(verdict, opened=self._opened), detail=verdict.detail)
        elif self._are_off(now_s):
            self._ledger.want(Mark.CLEAR)
        elif self._ledger.wanted.mark is not Mark.CLEAR or any(near_power(axis) for axis in self._view.axes):
            self._ledger.want(Mark.LIVE)

    def _are_off(self, now_s: float) -> bool:
        for axis in self._view.axes:  # noqa: SIM110 - every cycle
            if not is_off(axis, self._view, self._config, now_s):
                return False
        return True

    def _stop(self, now_s: float) -> list[Frame]:
        return [frame for stopper in self._stoppers for frame in stopper.tick(self._view, now_s)]

    @property
    def _settled(self) -> bool:
        return not self._stoppers or all(stopper.settled for stopper in self._stoppers)

    @property
    def _step(self) -> Step:
        return max(stopper.ladder.step for stopper in self._stoppers) if self._stoppers else Step.NONE

    def _due_frames(self, now_s: float) -> list[Frame]:
        out: list[Frame] = []
        period_s = self._config.heartbeat_period_s
        if now_s >= self._heartbeat_due and self._sends_heartbeat:
            self._heartbeat_due = max(self._heartbeat_due, now_s - period_s) + period_s
            out.append(frames.heartbeat())
        if self._sends_heartbeat:
            out += self._guard.tick(now_s)
        status = self.status
        is_due = now_s >= self._state_due
        if is_due:  # a frame for what is new comes between the others, and delays none of them
            self._state_due = max(self._state_due, now_s - STATE_PERIOD_S) + STATE_PERIOD_S
        if is_due or status != self._reported_status:
            self._reported_status = status
            out.append(self._state_frame(status, now_s))
        if now_s >= self._counters_due:
            self._counters_due = max(self._counters_due, now_s - COUNTERS_PERIOD_S) + COUNTERS_PERIOD_S
            out.append(self._counters_frame())
        return out

    def _state_frame(self, status: Status, now_s: float) -> Frame:
        age_s = now_s - self._leases.valid_at
        verdict = status.verdict
        return frames.state(
            status.state,
            verdict.cause,
            status.step,
            verdict.node_id,
            age_s,
            status.reset,
            armed=status.armed,
            brakes_hard=status.brakes_hard,
        )

    def _counters_frame(self) -> Frame:
        refused, gap_s = sum(self._leases.refused.values()), self._longest_gap_s
        self._longest_gap_s = 0.0
        return frames.counters(refused, self._observer.dropped, self._bus_errors, self.trips, gap_s)

    def _on_reset_request(self, data: bytes, now_s: float) -> None:
        number = frames.decode_reset_request(data)
        if number is None:
            self._observer.dropped += 1
        elif number != self._reset[0] or now_s >= self._reset_at + REPEATED_REQUEST_S:
            self._reset = (number, self._answer(now_s))
            self._reset_at = now_s

    def _answer(self, now_s: float) -> Answer:
        if self._state is not State.TRIPPED:
            return Answer.NOT_TRIPPED
        view = self._observe(now_s)
        fresh = all(stopper.is_fresh(now_s) for stopper in self._stoppers)
        unsupplied = self._opened and self._verdict.cause is TripCause.DRIVE_SILENT  # the relay may feed it
        stands = not unsupplied and policy.stands(self._verdict, view, self._config, now_s)
        if not self._settled or not fresh or stands:
            return Answer.CAUSE_STANDS
        if velocity_ordered(view, self._config, now_s):
            return Answer.VELOCITY_ORDERED
        self._state = State.WATCHING
        self._verdict = FINE
        self._stoppers = []
        self._opened = False
        self._observer.ours_since = math.inf
        self._observer.trust()
        return Answer.DONE
