"""Black boxes of stops in virtual time: the driver's ring, filled and written as its process does it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from canbase_campaign.forked import in_a_copy
from canbase_campaign.process import FRAMES_HELD
from canbase_campaign.velocity_process import LOCKS
from canbase_campaign.world import World
from canbase_config.robot import Robot
from canbase_driver.runtime.black_box import Ring, asc_lines
from canbase_driver.runtime.black_box_about import about
from canbase_driver.runtime.black_box_json import json_lines
from canbase_driver.supervision.stop_history import StopRecord
from canbase_runtime.driver_state import DriverState
from canbase_velocity import input_ring as velocity_ring
from canbase_velocity.decision import Decision
from canbase_velocity.estop import EstopState
from canbase_velocity.input_ring import InputRing
from canbase_velocity.mux import MuxDecision
from canbase_velocity.safety_filter import FilterConfig
from canbase_velocity.twist import Twist
from canbase_watchdog import input_ring
from canbase_watchdog.input_ring import TripWatch

WALL_S = 1_790_000_000.0
"""Of the monotonic clock to the wall clock."""
WARM_UP_S = 2.0
RECORDED_S = 10.0
"""`black_box.seconds` by default."""


class WatchdogBox:
    """The inputs of each trip of a world's watchdog, noted and cut as its loop does it. One that starts again begins
    with nothing; what it had not written when it died is lost."""

    def __init__(self, world: World, seconds: float = RECORDED_S) -> None:
        self._watchdog: Any = world.watchdog
        self._clock, self._seconds = world.clock, seconds
        self.files: list[tuple[input_ring.Trip, list[str]]] = []
        self.trips: list[input_ring.Trip] = []
        """All of them; of some there is no file."""
        it: Any = self._watchdog
        self._lease, it._on_lease = it._on_lease, self._on_lease
        self._frame, it._on_frame = it._on_frame, self._on_frame
        self._begin, it.begin = it.begin, self._on_begin
        self._tick = it._on_tick
        self._end, it.end = it.end, self._on_end
        self._ring = input_ring.InputRing(seconds, -math.inf)  # it began to run long before
        self._watch = TripWatch(self._ring, it.disk.found())
        self._past = it.disk.found()
        it._on_tick = self._on_tick
        it._life += 1
        it.every(it._tick_s, self._on_tick, phase_s=it._tick_s)

    def _on_begin(self) -> None:
        self._past = self._watchdog.disk.found()
        self._ring = input_ring.InputRing(self._seconds, self._clock.now_s)
        self._watch = TripWatch(self._ring, self._past)
        self._begin()

    def _on_lease(self, datagram: bytes) -> None:
        self._ring.note((input_ring.LEASE, self._clock.now_s, datagram, None, None))
        self._lease(datagram)

    def _on_frame(self, cob_id: int, data: bytes) -> None:
        if not self._watchdog.is_deaf:
            self._ring.note((input_ring.FRAME, self._clock.now_s, cob_id, data))
        self._frame(cob_id, data)

    def _on_end(self) -> None:
        self._ring.note((input_ring.END, self._clock.now_s))
        self._end()

    def _on_tick(self) -> None:
        now_s = self._clock.now_s
        self._ring.note((input_ring.TICK, now_s, self._watchdog._failed_since, 0))
        self._tick()
        due = self._watch.due_trip(self._watchdog.core, now_s)
        trip = due or self._watch.open
        if trip is not None and trip not in self.trips[-1:]:
            self.trips.append(trip)
        if due is not None:
            self._cut(due)

    def _cut(self, trip: input_ring.Trip) -> None:
        head = input_ring.head(self._watchdog._config, self._past, trip, WALL_S)
        self.files.append((trip, list(input_ring.lines(head, self._ring.cut(self._clock.now_s)))))

    def write(self, path: Path) -> None:
        """Beside the driver's files; what happened to a trip that has none is known in virtual time alone: `.trips`."""
        if self._watch.open is not None and self._watchdog.alive:
            self._cut(self._watch.open)
        for number, (_, lines) in enumerate(self.files):
            file = path.with_name(f"watchdog_{path.stem}_{number}.jsonl")
            file.write_text("".join(lines), encoding="utf-8")
        trips = [(trip.at_s, trip.cause) for trip in self.trips]
        path.with_suffix(".trips").write_text(json.dumps(trips), encoding="utf-8")


class VelocityBox:
    """The inputs of mux and filter of a world, noted and cut as their process does it. One that starts again begins
    with nothing."""

    LOOK_S = 0.02

    def __init__(self, world: World, seconds: float = RECORDED_S) -> None:
        self._world, self._seconds = world, seconds
        self.files: list[list[str]] = []
        it: Any = world.velocity
        self._begin, it.begin = it.begin, self._on_begin
        self._renew()
        self._look()

    def _renew(self) -> None:
        self._ring, self._watch = InputRing(self._seconds), velocity_ring.StopWatch()
        self._world.velocity.note = self._ring.note
        self._driver = DriverState.OFFLINE

    def _on_begin(self) -> None:
        self._begin()
        self._renew()

    def _look(self) -> None:
        velocity, now_s = self._world.velocity, self._world.clock.now_s
        if velocity.running:
            self._ring.keep_recent(velocity.mux, velocity.filter, now_s)
            due = self._watch.due_stop(
                velocity.mux.driver_state(now_s), velocity.filter.estop is EstopState.FREE, now_s
            )
            if due is not None:
                self._cut(due)
        self._world.clock.after(self.LOOK_S, self._look)

    def _cut(self, stop: velocity_ring.Stop) -> None:
        robot = self._world.robot
        mux = robot.mux.model_copy(update={"locks": LOCKS})
        head = velocity_ring.head(robot.model_copy(update={"mux": mux}), FilterConfig.of(robot), stop, WALL_S)
        self.files.append(list(velocity_ring.lines(head, self._ring.cut())))

    def write(self, path: Path) -> None:
        """Beside the driver's files; a stop that is not over too."""
        if self._watch.open is not None and self._world.velocity.alive:
            self._cut(self._watch.open)
        for number, lines in enumerate(self.files):
            path.with_name(f"velocity_{path.stem}_{number}.jsonl").write_text("".join(lines), encoding="utf-8")


class DriverBox:
    """What the driver of a world would have recorded from now on. A driver that starts again begins with nothing."""

    def __init__(self, world: World, bitrate: int = 0, seconds: float = 60.0) -> None:
        """`bitrate`: of the bus [bit/s], where robot.yaml has another one."""
        self._world, self._seconds, self._bitrate = world, seconds, bitrate or world.robot.bus.bitrate
        self.ring = Ring(seconds)
        self._sent: dict[int, tuple[Twist, float]] = {}
        """By identity of the message: when the filter sent it, 0: somebody else did."""
        self._leased = False
        self._state: tuple[object, object] | None = None
        driver: Any = world.driver
        self._member_send, driver._member.send = driver._member.send, self._on_sent
        driver.hear = self._on_heard
        self._begin, driver.begin = driver.begin, self._on_begin
        velocity: Any = world.velocity
        self._lease, velocity._send_lease = velocity._send_lease, self._on_lease
        topics: Any = world.topics
        self._publish, topics.publish = topics.publish, self._on_published
        for topic, note in (("cmd_vel", self._on_command), ("safety_filter/state", self._on_filter)):
            self._tap(topic, note)

    @property
    def now_s(self) -> float:
        return self._world.clock.now_s

    def _tap(self, topic: str, note: Callable[[Any], None]) -> None:
        """What the driver takes out of a topic, when it does."""
        subscribers: list[Any] = self._world.topics._subscribers[topic]

        def both(do: Callable[[Any], None], message: Any) -> None:
            note(message)
            do(message)

        for at, (process, do) in enumerate(subscribers):
            if process is self._world.driver:
                subscribers[at] = (process, lambda message, do=do: both(do, message))

    def _on_begin(self) -> None:
        self.ring, self._state = Ring(self._seconds), None
        self._begin()

    def _on_sent(self, cob_id: int, data: bytes) -> bool:
        self.ring.frame(self.now_s, cob_id, data, False)
        return bool(self._member_send(cob_id, data))

    def _on_heard(self, cob_id: int, data: bytes) -> None:
        """A frame has the time at which it came, also where the driver hangs and takes it in later."""
        driver: Any = self._world.driver
        take_in = partial(self._take_in, self.now_s, driver._on_frame, cob_id, data)
        if driver.running:
            take_in()
        else:
            driver.receive("frames", FRAMES_HELD, take_in)

    def _take_in(self, at_s: float, do: Callable[..., object], cob_id: int, data: bytes) -> None:
        if not self._world.driver.bus_problem:
            self.ring.frame(at_s, cob_id, data, True)
        do(cob_id, data)

    def _on_lease(self, datagram: bytes, twist: Twist) -> None:
        self._leased = True
        self._lease(datagram, twist)

    def _on_published(self, topic: str, message: Any) -> None:
        if topic == "cmd_vel":
            message = Twist(message.linear_mps, message.angular_radps)
            self._sent[id(message)] = message, WALL_S + self.now_s if self._leased else 0.0
            self._leased = False
        elif topic == "motor_driver/status":
            self._on_state(message)
        elif topic == "velocity_mux/state":
            self._on_mux(message)
        for name, source in self._world.robot.mux.sources.items():
            if source.topic == topic:
                values = {"source": name, "linear_mps": message.linear_mps, "angular_radps": message.angular_radps}
                self.ring.event(self.now_s + self._world.topics.FASTEST_S, "order", values)
        self._publish(topic, message)

    def _on_command(self, twist: Twist) -> None:
        stamp_s = self._sent[id(twist)][1]
        values = {"linear_mps": twist.linear_mps, "angular_radps": twist.angular_radps, "stamp_s": stamp_s}
        self.ring.event(self.now_s, "cmd_vel", values)

    def _on_filter(self, decision: Decision) -> None:
        values = {"action": decision.action.value, "cause": decision.cause.value, "emergency": decision.emergency}
        ordered = decision.twist
        ordered_values = {"ordered_linear_mps": ordered.linear_mps, "ordered_angular_radps": ordered.angular_radps}
        self.ring.event(self.now_s, "safety_filter/state", values | ordered_values)

    def _on_mux(self, decision: MuxDecision) -> None:
        standing = {source.name: source.standing.value for source in decision.sources}
        locks = [lock.name for lock in decision.locks if lock.holds]
        values = {"active": decision.active or "", "standing": standing, "locks": locks}
        self.ring.event(self.now_s, "velocity_mux/state", values)

    def _on_state(self, snapshot: Any) -> None:
        told = (snapshot.state, snapshot.finding.cause)
        if told != self._state:
            self._state = told
            values = {"state": snapshot.state.name, "cause": snapshot.finding.cause.value}
            self.ring.event(self.now_s, "motor_driver/state", values)

    @property
    def _robot(self) -> Robot:
        """A scenario has a bit rate of its own."""
        robot = self._world.robot
        bus = robot.bus.model_copy(update={"bitrate": self._bitrate})
        return robot.model_copy(update={"bus": bus})

    def write(self, path: Path) -> Path:
        """Both files, as `black_box_writer.py` does it; `path`: of the .asc."""
        now_s = self.now_s
        cut = self.ring.cut(now_s, WALL_S)
        recording = replace(cut, events=tuple(sorted(cut.events, key=lambda event: event[0])))
        verdict = self._world.watchdog.core.status.verdict
        record = StopRecord("watchdog", verdict.cause.name.lower(), verdict.detail, True, "", now_s)
        path.write_text("".join(asc_lines(recording, "a stop")), encoding="utf-8")
        told = "".join(json_lines(recording, record, path.name, about(self._robot)))
        path.with_suffix(".json").write_text(told, encoding="utf-8")
        return path


def record_in_a_copy(world: World, run: Callable[[], object], path: Path, bitrate: int = 0) -> None:
    """`run` in a copy of this process, and its recording to `path`: the world stays as it is here.

    The recording begins WARM_UP_S before: a watchdog that is replayed from its begin has seen the robot by then.
    """

    def record() -> bool:
        boxes = DriverBox(world, bitrate), WatchdogBox(world), VelocityBox(world)
        world.clock.run_until(world.clock.now_s + WARM_UP_S)
        run()
        for box in boxes:
            box.write(path)
        return True

    assert in_a_copy(record), "the recording ended with an exception"
