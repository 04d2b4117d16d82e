"""The watchdog's one thread: waits for leases and the next tick, and hands them and the frames to watchdog.py.

Frames are acted on in a tick alone, so none of them wakes this thread: a tick takes in what has arrived since the last
one, each frame with the time at which the kernel received it. A lease that runs out stops the drives before that.
"""

from __future__ import annotations

import gc
import logging
import select
import time
from collections.abc import Callable

from canbase_base.latch_file import LatchKeeper
from canbase_watchdog import frames
from canbase_watchdog.bus_port import BusPort
from canbase_watchdog.input_ring import END, EXPIRE, FRAME, LEASE, SUSPEND, TICK, Input, InputRing
from canbase_watchdog.lease_socket import LeaseSocket
from canbase_watchdog.relay import Relay
from canbase_watchdog.report import Reporter
from canbase_watchdog.trip_recorder import TripRecorder
from canbase_watchdog.watchdog import State, Watchdog

TICK_S = 0.005
BUS_DEAD_S = 1.0
"""Without one sent frame for this long the bus is lost [s]: it is opened again, and another life begins."""
END_S = 1.0
"""How long it goes on stopping the drives after the request to end [s]."""
COLLECT_S = 10.0
SUSPENDED_S = 0.02
"""CLOCK_BOOTTIME goes on in a suspend and CLOCK_MONOTONIC does not: so much between two turns is no lateness."""

NO_REQUESTS = (
    "the CAN adapter sends no remote frames (%s), and node guarding needs them: no guarded drive gets power. "
    "Use another adapter; or set self_stop.node_guarding: false in the drive profile, and no drive stops when this "
    "computer fails"
)

OFF_BEFORE = (
    "the CAN controller was bus-off before this start: check cable, termination and bit rate, and set restart-ms of "
    "the interface (docs/wiring.md). No drive gets power, and the relay stays open, until a frame comes"
)

_log = logging.getLogger("canbase.watchdog")


class BusDeadError(Exception):
    """No frame could be sent for BUS_DEAD_S."""


class Loop:
    """Ticks at absolute times every TICK_S, and once more just when a timeout runs out."""

    def __init__(
        self,
        watchdog: Watchdog,
        bus: BusPort,
        leases: LeaseSocket,
        relay: Relay | None = None,
        keeper: LatchKeeper | None = None,
        inputs: InputRing | None = None,
        recorder: TripRecorder | None = None,
    ) -> None:
        """Owns none of them: the caller opens and closes. `relay`: None where there is none. `keeper`: of the record
        that the watchdog was made with; None where it was made without. `inputs`, `recorder`: of what the watchdog
        decides from; None: it is not recorded."""
        self._watchdog = watchdog
        self._bus = bus
        self._leases = leases
        self._relay = relay
        self._keeper = keeper
        self._recorder = recorder
        self._note = inputs.note if inputs is not None else _forget
        self._record_problem = self._request_problem = ""
        self._reporter = Reporter(watchdog)
        self._bus_has_fd = bus.fileno() is not None
        self._lost = not bus.health.works
        """The bus failed before this life, and has not worked since."""
        if bus.health.is_off:
            _log.warning(OFF_BEFORE)
        self._due = self._sent_at = self._collected_at = time.monotonic()
        self._suspended_s = suspended_s()
        self._acted_at = self._due
        """A timeout that ran out since then, while frames were taken in, is acted on at once."""

    def run(self, asked_to_end: Callable[[], bool]) -> None:
        """Until `asked_to_end` is true, the wheels are stationary and no drive has power, at most END_S later.

        The driver that was interrupted with it takes the power. Raises BusDeadError, RelayError.
        """
        while not asked_to_end():
            self._turn()
        now_s = time.monotonic()
        self._note((END, now_s))
        self._watchdog.end(now_s)
        while not self._at_rest() and time.monotonic() < now_s + END_S:
            self._turn()

    def _turn(self) -> None:
        """One wait, and what it brought."""
        now_s = time.monotonic()
        wake = min(self._due, self._watchdog.next_expiry(self._acted_at))
        self._wait(max(wake - now_s, 0.0))
        now_s = time.monotonic()
        stops = self._take_leases(now_s)
        expiry = self._watchdog.next_expiry(now_s)
        self._take_frames(now_s, min(expiry, now_s + TICK_S))
        if stops or self._watchdog.has_unreported_flag or (now_s >= wake and time.monotonic() < expiry):
            self._acted_at = now_s
            self._act(now_s)
            self._due = max(self._due, now_s - TICK_S) + TICK_S if now_s >= self._due else self._due

    def _wait(self, timeout_s: float) -> None:
        if self._bus_has_fd:
            select.select([self._leases.fileno()], [], [], timeout_s)
        else:
            self._bus.wait(timeout_s)

    def _take_leases(self, now_s: float) -> bool:
        """Those that have arrived. True: the last one that counts ran out while a wheel moves; the stop is sent."""
        for datagram, uid, pid in self._leases.receive():
            self._note((LEASE, now_s, datagram, uid, pid))
            self._watchdog.on_lease(datagram, uid, now_s, pid)
        stop = self._watchdog.expire(now_s)
        if stop:
            self._note((EXPIRE, now_s))
        for frame in stop:
            self._bus.send(frame)
        return bool(stop)

    def _take_frames(self, now_s: float, until: float) -> None:
        """Those that have arrived; what is left at the time `until` waits for the next turn, which comes at once."""
        for cob_id, data, at_s in self._bus.receive(now_s):
            at_s = now_s if cob_id == frames.RESET_REQUEST else at_s  # a request is judged by what holds now
            self._note((FRAME, at_s, cob_id, data))
            self._watchdog.on_frame(cob_id, data, at_s)
            if time.monotonic() >= until:
                return

    def _act(self, now_s: float) -> None:
        self._look_for_a_suspend()
        health = self._bus.health
        self._watchdog.on_bus(health.failed_since, health.errors)
        if self._keeper is not None:
            self._watchdog.on_record(self._keeper.written, self._keeper.problem)
        self._note((TICK, now_s, health.failed_since, health.errors))
        for frame in self._watchdog.tick(now_s):
            self._bus.send(frame)
        if self._relay is not None and self._watchdog.keeps_relay and not self._lost:
            self._relay.toggle()
        self._keep_record()
        if self._recorder is not None:
            self._recorder.record_due_trip(self._watchdog, now_s)
        self._check_bus(now_s)
        self._check_requests()
        self._reporter.tick(health, now_s, self._bus.datagrams_dropped)
        self._collect(now_s)

    def _look_for_a_suspend(self) -> None:
        before_s = self._suspended_s
        self._suspended_s = max(before_s, suspended_s())
        if self._suspended_s > before_s + SUSPENDED_S:
            self._note((SUSPEND, time.monotonic(), self._suspended_s - before_s))
            self._watchdog.on_suspend(self._suspended_s - before_s)

    def _keep_record(self) -> None:
        """Hands over what shall be on disk; the writer's defect is this loop's."""
        if self._keeper is None:
            return
        if self._keeper.failure is not None:
            raise self._keeper.failure
        self._keeper.want(self._watchdog.record)
        if self._keeper.problem != self._record_problem:
            self._record_problem = self._keeper.problem
            _log.warning("%s", self._record_problem or "the record of trips can be written again")

    def _check_bus(self, now_s: float) -> None:
        if self._bus.health.takes_frames:
            self._sent_at = now_s
            self._log_bus_recovered()
        elif now_s >= self._sent_at + BUS_DEAD_S:
            raise BusDeadError(f"no frame could be sent for {BUS_DEAD_S:.1f} s. Is the interface up, the cable in?")

    def _log_bus_recovered(self) -> None:
        if self._lost and self._bus.health.works:
            self._lost = False
            _log.info("the bus takes frames again")

    def _check_requests(self) -> None:
        """Each reason of an adapter that refuses remote frames is reported once."""
        problem = self._bus.request_problem
        if problem and problem != self._request_problem and self._bus.health.takes_frames:
            self._request_problem = problem
            _log.error(NO_REQUESTS, problem)

    def _at_rest(self) -> bool:
        status = self._watchdog.status
        return status.settled if status.state is State.TRIPPED else not self._watchdog.sees_power

    def _collect(self, now_s: float) -> None:
        """The collector is off in the loop; what little there is, it takes here, after the frames are out."""
        if now_s >= self._collected_at + COLLECT_S:
            self._collected_at = now_s
            gc.collect()


def _forget(_: Input) -> None:
    """Nobody records it."""


def suspended_s() -> float:
    """How long this computer was suspended since its start [s]; less, never more, by a pause between the two clocks."""
    return time.clock_gettime(time.CLOCK_BOOTTIME) - time.monotonic()
