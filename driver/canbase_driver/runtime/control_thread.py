"""The control thread: owns the core and the bus, keeps the SYNC cycle, and hands snapshots to the publisher.

Cycles lie on a grid of absolute times; between two of them the thread does nothing but take in frames. Other threads
only put requests into the inbox. However the thread ends, its last act on the bus is a quick stop.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import queue
import threading
import time
from collections.abc import Callable

from canbase_base.latch_file import LatchKeeper
from canbase_driver.cia301.frame import Frame
from canbase_driver.core import DriverCore
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.motion.odometry import Pose2D
from canbase_driver.runtime.black_box import Ring
from canbase_driver.runtime.bus_port import BusPort
from canbase_driver.runtime.bus_traffic import Traffic
from canbase_driver.snapshot import DriverSnapshot
from canbase_driver.supervision.fault_reset import RequestOutcome
from canbase_driver.supervision.lifecycle import Aim
from canbase_driver.supervision.stop_history import StopRecord

OLD_S = 0.5
"""A request that lay in the inbox for longer is refused: this process stood still, and its caller may be gone."""
FRAMES_WHEN_LATE = 100
"""This many waiting frames are taken in before a cycle that is already late: more than a bus brings in one cycle."""
SUSPENDED_S = 0.02
"""CLOCK_BOOTTIME goes on in a suspend and CLOCK_MONOTONIC does not: so much between two cycles is no lateness."""
LAST_WORDS = 3
"""How often the quick stop is sent on the way out."""

OnOutcome = Callable[[RequestOutcome], None]


class ControlLoop(threading.Thread):
    """Runs a core on a bus. `failure` is the exception that ended it, None for an orderly end."""

    def __init__(
        self,
        core: DriverCore,
        bus: BusPort,
        control_hz: float,
        odometry_hz: float,
        ring: Ring,
        keeper: LatchKeeper | None = None,
    ) -> None:
        """`keeper`: of the record that the core was made with; None where it was made without."""
        super().__init__(name="control", daemon=True)
        self._core = core
        self._bus = bus
        self._ring = ring
        self._keeper = keeper
        self._period_s = 1.0 / control_hz
        self._samples_per_snapshot = max(1, round(control_hz / odometry_hz))
        self._inbox: queue.SimpleQueue[Callable[[float], object]] = queue.SimpleQueue()
        self._outcomes: queue.SimpleQueue[tuple[int, RequestOutcome]] = queue.SimpleQueue()
        self._numbers = itertools.count()
        self._asked: dict[int, tuple[str, OnOutcome]] = {}
        """By number: what was requested, and who gets the outcome."""
        self._condition = threading.Condition()
        self._snapshot: DriverSnapshot | None = None
        self._stops: list[StopRecord] = []
        self._published = (0, core.state)
        self._handed_over_at = 0.0
        self._suspended_s = suspended_s()
        self.cycle_at = math.inf
        """When the last cycle began [s, monotonic]: a thread that hangs is seen by it. Infinity before the first."""
        self.failure: BaseException | None = None

    def queue_velocity_command(self, twist: Twist2D, received_at: float) -> None:
        """Hand over a velocity command, from any thread."""
        self._inbox.put(lambda _now: self._core.accept_velocity_command(twist, received_at))

    def request_shutdown(self) -> None:
        """Ramp to a stand, disable, end the thread."""
        self._inbox.put(lambda _now: self._core.request_shutdown())

    def traffic(self) -> Traffic:
        """What has passed on the bus, from any thread."""
        return self._bus.traffic()

    @property
    def aimed_at(self) -> Aim:
        """How far the driver goes now."""
        return self._core.aim

    def stop(self, on_outcome: OnOutcome) -> None:
        """Stop, however late; like each of these four it returns at once, and `deliver` calls `on_outcome`, once.

        No outcome comes while the control thread hangs: nothing obeys then, and the process is about to end.
        """

        def carry_out(_now: float, answer: OnOutcome) -> None:
            self._core.request_stop()
            answer(RequestOutcome(True, "stopping; nothing moves until `canbase reset`, or motor_driver/reset"))

        self._ask("stop", carry_out, on_outcome, however_late=True)

    def reset(self, on_outcome: OnOutcome) -> None:
        """Reset."""
        self._ask("reset", lambda now_s, answer: self._core.request_reset(now_s, answer), on_outcome)

    def set_pose(self, pose: Pose2D, on_outcome: OnOutcome) -> None:
        """Set the pose of the odometry."""
        self._ask("set_pose", lambda now_s, answer: answer(self._core.set_pose(pose, now_s)), on_outcome)

    def aim(self, aim: Aim, on_outcome: OnOutcome) -> None:
        """Go so far. What takes power away is obeyed however late."""
        takes_power = aim <= self._core.aim
        name = f"aim {aim.name.lower()}"
        self._ask(name, lambda now_s, answer: self._core.request_aim(aim, now_s, answer), on_outcome, takes_power)

    def deliver(self) -> None:
        """Report the outcomes that are there. Called by the requesting thread, and often: nothing here waits."""
        ended = not self.is_alive()
        while True:
            try:
                number, outcome = self._outcomes.get_nowait()
            except queue.Empty:
                break
            self._answer(number, outcome)
        for number in tuple(self._asked) if ended else ():
            self._answer(number, RequestOutcome(False, "not confirmed: motor_driver has ended"))

    def _answer(self, number: int, outcome: RequestOutcome) -> None:
        name, on_outcome = self._asked.pop(number)
        values = {"request": name, "done": outcome.done, "sentence": outcome.sentence}
        self._ring.event(time.monotonic(), "answer", values)
        on_outcome(outcome)

    def _ask(
        self,
        name: str,
        request: Callable[[float, OnOutcome], None],
        on_outcome: OnOutcome,
        however_late: bool = False,
    ) -> None:
        number, asked_at = next(self._numbers), time.monotonic()
        self._asked[number] = name, on_outcome
        self._ring.event(asked_at, "request", {"request": name})

        def answer(outcome: RequestOutcome) -> None:
            self._outcomes.put((number, outcome))

        def carry_out(now_s: float) -> None:
            if now_s - asked_at > OLD_S and not however_late:
                answer(
                    RequestOutcome(
                        False, f"refused: motor_driver did not run for {now_s - asked_at:.1f} s; send the request again"
                    )
                )
            else:
                request(now_s, answer)

        self._inbox.put(carry_out)

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
            now_s = self.cycle_at = time.monotonic()
            self._look_for_a_suspend(now_s)
            self._core.on_bus(self._bus.problem, now_s, self._bus.report)
            if self._keeper is not None:
                self._core.on_record(self._keeper.written, self._keeper.problem)
            self._send(self._core.tick(now_s, now_s - cycle_at))
            if self._keeper is not None:
                self._keeper.want(self._core.record)
            self._hand_over_if_due(now_s)
            if now_s - cycle_at > self._period_s:
                cycle_at = now_s  # cycles that were missed are not made up for

    def _look_for_a_suspend(self, now_s: float) -> None:
        before_s = self._suspended_s
        self._suspended_s = max(before_s, suspended_s())
        if self._suspended_s > before_s + SUSPENDED_S:
            self._core.on_suspend(now_s)

    def _take_in_until(self, cycle_at: float) -> None:
        """Until then; in a cycle that is late already, what waits: feedback must not starve."""
        left = FRAMES_WHEN_LATE
        while left > 0:
            wait_s = cycle_at - time.monotonic()
            frame = self._bus.receive(max(0.0, wait_s))
            if frame is not None:
                now_s = time.monotonic()
                self._ring.frame(self._bus.received_at(now_s), frame.cob_id, frame.data, True)
                self._send(self._core.on_frame(frame, now_s))
                self._hand_over_if_due(now_s)
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
        now_s = time.monotonic()
        for frame in frames:
            self._bus.send(frame)
            self._ring.frame(now_s, frame.cob_id, frame.data, False)

    def _hand_over_if_due(self, now_s: float) -> None:
        """With each sample of the odometry that is to be published, and at once when the state changes."""
        serial, state = self._core.odometry_serial, self._core.state
        published_serial, published_state = self._published
        stale = (
            self._snapshot is None and now_s - self._handed_over_at > self._samples_per_snapshot * self._period_s * 2
        )
        if serial - published_serial >= self._samples_per_snapshot or state is not published_state or stale:
            self._hand_over(now_s)

    def _hand_over(self, now_s: float) -> None:
        self._published = (self._core.odometry_serial, self._core.state)
        self._handed_over_at = now_s
        with self._condition:
            self._snapshot = self._core.snapshot(now_s)
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


def suspended_s() -> float:
    """How long this computer was suspended since its start [s]; less, never more, by a pause between the two clocks."""
    return time.clock_gettime(time.CLOCK_BOOTTIME) - time.monotonic()
