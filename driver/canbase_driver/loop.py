"""The control thread: owns the core and the bus, keeps the SYNC cycle, and hands snapshots to whoever publishes them.

Cycles lie on a grid of absolute times; between two of them the thread does nothing but take in frames. Other threads
only put requests into the inbox. However the thread ends, its last act on the bus is a quick stop.
"""

from __future__ import annotations

import contextlib
import math
import os
import queue
import threading
import time
from collections.abc import Callable

from canbase_driver.black_box import Ring
from canbase_driver.bus_port import BusPort
from canbase_driver.core import DriverCore
from canbase_driver.frame import Frame
from canbase_driver.kinematics import Twist2D
from canbase_driver.odometry import Pose2D
from canbase_driver.readiness import Aim
from canbase_driver.reset import Outcome
from canbase_driver.snapshot import DriverSnapshot, StopRecord

ANSWER_MARGIN_S = 1.0
"""On top of the time in which the core answers a request."""
POLL_S = 0.1
FRAMES_WHEN_LATE = 100
"""So many waiting frames are taken in before a cycle that is already late: more than a bus brings in one cycle."""
LAST_WORDS = 3
"""How often the quick stop is sent on the way out."""


class ControlLoop(threading.Thread):
    """Runs a core on a bus. `failure` is the exception that ended it, None for an orderly end."""

    def __init__(self, core: DriverCore, bus: BusPort, control_hz: float, odometry_hz: float, ring: Ring) -> None:
        super().__init__(name="control", daemon=True)
        self._core = core
        self._bus = bus
        self._ring = ring
        self._answer_s = core.patience_s + ANSWER_MARGIN_S
        self._period_s = 1.0 / control_hz
        self._samples_per_snapshot = max(1, round(control_hz / odometry_hz))
        self._inbox: queue.SimpleQueue[Callable[[float], object]] = queue.SimpleQueue()
        self._condition = threading.Condition()
        self._snapshot: DriverSnapshot | None = None
        self._stops: list[StopRecord] = []
        self._published = (0, core.state)
        self._handed_over_at = 0.0
        self.cycle_at = math.inf
        """When the last cycle began [s, monotonic]: a thread that hangs is seen by it. Infinity before the first."""
        self.failure: BaseException | None = None

    def command(self, twist: Twist2D, received_at: float) -> None:
        """Hand over a velocity command, from any thread."""
        self._inbox.put(lambda _now: self._core.on_command(twist, received_at))

    def emergency(self, brakes_hard: bool, received_at: float) -> None:
        """Hand over whether the safety filter asks for the emergency deceleration, from any thread."""
        self._inbox.put(lambda _now: self._core.on_emergency(brakes_hard, received_at))

    def request_stop(self) -> None:
        """Hand over a stop request, from any thread."""
        self._inbox.put(lambda _now: self._core.request_stop())

    def request_shutdown(self) -> None:
        """Ramp to a stand, disable, end the thread."""
        self._inbox.put(lambda _now: self._core.request_shutdown())

    def reset(self) -> Outcome:
        """Reset and wait for the outcome; never call it from the control thread."""
        return self._ask(lambda now, answer: self._core.request_reset(now, answer))

    def set_pose(self, pose: Pose2D) -> Outcome:
        """Set the pose of the odometry and wait for the outcome; never call it from the control thread."""
        return self._ask(lambda now, answer: answer(self._core.set_pose(pose, now)))

    def aim(self, aim: Aim) -> Outcome:
        """Go so far and wait for the outcome; never call it from the control thread."""
        return self._ask(lambda now, answer: self._core.request_aim(aim, now, answer))

    def _ask(self, request: Callable[[float, Callable[[Outcome], None]], None]) -> Outcome:
        outcomes: queue.SimpleQueue[Outcome] = queue.SimpleQueue()
        self._inbox.put(lambda now: request(now, outcomes.put))
        deadline = time.monotonic() + self._answer_s
        while time.monotonic() < deadline:
            alive = self.is_alive()
            try:
                return outcomes.get(timeout=POLL_S)
            except queue.Empty:
                if not alive:
                    return Outcome(False, "refused: the control loop has ended")
        return Outcome(False, f"the control loop did not answer within {self._answer_s:.0f} s")

    def next_snapshot(self, timeout_s: float) -> tuple[DriverSnapshot | None, list[StopRecord]]:
        """Wait for a new snapshot; (None, []) when none came. Stops since the last call come with it."""
        with self._condition:
            self._condition.wait_for(lambda: self._snapshot is not None, timeout_s)
            snapshot, self._snapshot = self._snapshot, None
            stops, self._stops = self._stops, []
            return snapshot, stops

    def run(self) -> None:
        """The thread's body."""
        lead()
        try:
            self._cycle_until_finished()
            self._hand_over(time.monotonic())
        except BaseException as error:  # noqa: BLE001 - whatever it is, the drives are stopped and the process ends by it
            self.failure = error
            self._send(self._core.stop_frames() * LAST_WORDS)
        finally:
            self._bus.close()

    def _cycle_until_finished(self) -> None:
        cycle_at = self.cycle_at = time.monotonic()
        while not self._core.finished:
            cycle_at += self._period_s
            self._take_in_until(cycle_at)
            self._empty_inbox()
            now = self.cycle_at = time.monotonic()
            self._core.on_bus(self._bus.problem, now, self._bus.report)
            self._send(self._core.tick(now, now - cycle_at))
            self._hand_over_if_due(now)
            if now - cycle_at > self._period_s:
                cycle_at = now  # cycles that were missed are not made up for

    def _take_in_until(self, cycle_at: float) -> None:
        """Until then; in a cycle that is late already, what waits: feedback must not starve."""
        left = FRAMES_WHEN_LATE
        while left > 0:
            wait_s = cycle_at - time.monotonic()
            frame = self._bus.receive(max(0.0, wait_s))
            if frame is not None:
                now = time.monotonic()
                self._ring.frame(now, frame.cob_id, frame.data, True)
                self._send(self._core.on_frame(frame, now))
                self._hand_over_if_due(now)
            elif wait_s <= 0.0:
                return
            left -= wait_s <= 0.0

    def _empty_inbox(self) -> None:
        while True:
            try:
                request = self._inbox.get_nowait()
            except queue.Empty:
                return
            request(time.monotonic())

    def _send(self, frames: list[Frame]) -> None:
        now = time.monotonic()
        for frame in frames:
            self._bus.send(frame)
            self._ring.frame(now, frame.cob_id, frame.data, False)

    def _hand_over_if_due(self, now: float) -> None:
        """With each sample of the odometry that is to be published, and at once when the state changes."""
        serial, state = self._core.odometry_serial, self._core.state
        published_serial, published_state = self._published
        stale = self._snapshot is None and now - self._handed_over_at > self._samples_per_snapshot * self._period_s * 2
        if serial - published_serial >= self._samples_per_snapshot or state is not published_state or stale:
            self._hand_over(now)

    def _hand_over(self, now: float) -> None:
        self._published = (self._core.odometry_serial, self._core.state)
        self._handed_over_at = now
        with self._condition:
            self._snapshot = self._core.snapshot(now)
            self._stops += self._core.stops
            self._core.stops.clear()
            self._condition.notify_all()


def lead() -> None:
    """Where this process has real-time priority, this thread has one more than the others: a node that joins the ROS
    network keeps them busy, and the cycle does not wait for that. Without the right to it everything stays as it is."""
    if os.sched_getscheduler(0) == os.SCHED_FIFO:
        mine = os.sched_getparam(0).sched_priority
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(mine + 1))
