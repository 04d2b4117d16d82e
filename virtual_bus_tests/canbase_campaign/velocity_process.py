"""velocity_mux and safety_filter, one process, in virtual time: their cores, wired as their nodes are."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict
from functools import partial

from canbase_campaign.clock import FINE, ComputerClock, Pace
from canbase_campaign.disk import StopDisk
from canbase_campaign.process import Process, Topics
from canbase_config.mux import MuxLock
from canbase_config.robot import Robot
from canbase_config.state_age import STATE_PERIOD_S
from canbase_driver.snapshot import DriverSnapshot
from canbase_velocity.base_ready import status_timeout_s
from canbase_velocity.clearance import Points
from canbase_velocity.decision import Decision
from canbase_velocity.delay import Sent
from canbase_velocity.estop import EstopState
from canbase_velocity.filter_state import SafetyFilter
from canbase_velocity.input_ring import Note, filter_entry, forget, mux_entry
from canbase_velocity.lease import lease_datagram
from canbase_velocity.mux import Mux, MuxDecision
from canbase_velocity.placement import Placement
from canbase_velocity.safety_filter import FilterConfig
from canbase_velocity.scan import Scan
from canbase_velocity.twist import Twist

LOCKS = {"lock": MuxLock(topic="lock", priority=255, required=False)}
"""It has a publisher only in a fault."""


class VelocityProcess(Process):
    """Commands in by topic, orders out with a lease each: the lease first, as filter_node.py does it."""

    name = "velocity"

    def __init__(
        self,
        robot: Robot,
        clock: ComputerClock,
        topics: Topics,
        send_lease: Callable[[bytes, Twist], None],
        pace: Pace = FINE,
    ) -> None:
        super().__init__(clock)
        self._parts = pace.command_parts
        self._robot, self._topics, self._send_lease = robot, topics, send_lease
        for name, source in robot.mux.sources.items():
            topics.subscribe(source.topic, self, partial(self._on_source, name))
        topics.subscribe("motor_driver/status", self, self._on_driver)
        topics.subscribe(robot.safety.scan.topic, self, self._on_scan)
        topics.subscribe(robot.safety.estop.topic, self, self._on_estop)
        topics.subscribe("lock", self, self._on_lock)
        topics.subscribe("publishers", self, self._on_publishers)
        self.note: Note = forget
        """Takes each input of the cores and each decision, as in `input_ring.py`."""
        self.clocks_behind: dict[str, Callable[[float], float]] = {}
        """By source: its messages have stamps, of a clock that is so far behind this computer's at a time [s]."""
        self.disk = StopDisk("velocity")
        """Its record of the emergency stop, which outlives it."""
        self.begin()

    def begin(self) -> None:
        """A new mux and a new filter; the sequence of the leases starts again."""
        now_s = self.clock.now_s
        self.mux = Mux(self._robot.mux.sources, LOCKS, status_timeout_s=status_timeout_s(self._robot.rates))
        self.filter = SafetyFilter(FilterConfig.of(self._robot), self.disk.found())
        self._sequence, self._stamp_ns, self._ending = 0, 0, False
        self.decision: Decision | None = None
        """The last order."""
        self._mux_told: tuple[object, ...] = ()
        self._told: tuple[object, ...] = ()
        self._mux_state_at = self._state_at = -math.inf
        self._active: str | None = None
        self._mux_due = self._filter_due = now_s
        self._period_s = 1.0 / self._robot.rates.command_hz
        self.every(self._period_s / self._parts, self._on_timer, phase_s=0.003)

    def end(self) -> None:
        """It orders zero until the base stands."""
        self._ending = True
        self.note("end", self.clock.now_s)
        self.filter.end()
        self._issue(self._shut_down(self.clock.now_s))

    def _on_timer(self) -> None:
        """Two timers that each message restarts, at a quarter of their period's resolution."""
        now_s = self.clock.now_s
        if now_s >= self._mux_due:
            self._send(self._decide())
        if now_s >= self._filter_due:
            self._issue(self._filter_decides(now_s))

    def _shut_down(self, now_s: float) -> Decision:
        decision = self.filter.shut_down(now_s)
        self.note(*filter_entry("shut_down", now_s, decision))
        return decision

    def _filter_decides(self, now_s: float) -> Decision:
        decision = self.filter.decide(now_s)
        self.note(*filter_entry("decide", now_s, decision))
        return decision

    def _on_source(self, name: str, twist: Twist) -> None:
        now_s = self.clock.now_s
        stamp_s = now_s - self.clocks_behind[name](now_s) if name in self.clocks_behind else None
        times = None if stamp_s is None else (stamp_s, now_s)
        self.note("command", now_s, name, twist.linear_mps, twist.angular_radps, now_s, times)
        self.mux.accept_command(name, twist, now_s, sent=None if stamp_s is None else Sent(stamp_s, now_s, now_s))
        decision = self._decide()
        if decision.active == name or decision.active != self._active:
            self._send(decision)

    def _on_driver(self, snapshot: DriverSnapshot) -> None:
        now_s = self.clock.now_s
        self.note("driver", now_s, int(snapshot.state), snapshot.cycle.cycles, now_s)
        self.mux.on_driver(snapshot.state, snapshot.cycle.cycles, now_s)

    def _decide(self) -> MuxDecision:
        self.mux.on_estop(self.filter.estop is EstopState.FREE)
        self.mux.on_scans(self.filter.without_scans)
        decision = self.mux.decide(self.clock.now_s)
        self.note(*mux_entry("mux", self.clock.now_s, decision))
        return decision

    def _send(self, decision: MuxDecision) -> None:
        """As mux_node.py: the filter first; the topic is for people."""
        now_s = self.clock.now_s
        self._mux_due, self._active = now_s + self._period_s, decision.active
        self._topics.publish("cmd_vel_mux", decision.twist)
        if not self._topics.loses("cmd_vel_mux"):
            self.note("obey", now_s, now_s)
            self.filter.accept_command(decision.twist, now_s)
            self._issue(self._filter_decides(now_s))
        told = decision.essence
        if told != self._mux_told or now_s - self._mux_state_at >= STATE_PERIOD_S:
            self._mux_told, self._mux_state_at = told, now_s
            self._topics.publish("velocity_mux/state", decision)

    @property
    def holds_stop(self) -> bool:
        """Its emergency stop is pressed, or waits for its reset."""
        return self.filter.estop is not EstopState.FREE

    def reset(self) -> None:
        """The operator resets the emergency stop; a process that is dead or hangs does not receive it."""
        if self.alive:
            moving = self.mux.moving(self.clock.now_s)
            self.note("reset", self.clock.now_s, list(moving))
            self.filter.reset(moving, self.clock.now_s)

    def _on_scan(self, seen: Points | Scan) -> None:
        scan = self._robot.safety.scan
        if isinstance(seen, Scan):
            now_s = self.clock.now_s
            self.note("scan", now_s, scan.topic, seen, None, now_s)
            self.filter.on_laser_scan(scan.topic, seen, Placement.of(scan), now_s, now_s)
        else:
            self.note("points", self.clock.now_s, scan.topic, seen)
            self.filter.on_points(scan.topic, seen, None, self.clock.now_s)

    def _on_lock(self, locked: bool) -> None:
        self.note("lock", self.clock.now_s, "lock", locked, self.clock.now_s)
        self.mux.on_lock("lock", locked, self.clock.now_s)

    def _on_publishers(self, found: tuple[str, tuple[str, ...]]) -> None:
        """A look into the ROS graph: a topic, and the nodes that publish on it."""
        if found[0] == self._robot.safety.scan.topic:
            self.note("scanners", self.clock.now_s, found[0], list(found[1]), list(found[1]))
            self.filter.on_scan_publishers(found[0], found[1], found[1], self.clock.now_s)
            return
        self.note("publishers", self.clock.now_s, found[0], list(found[1]), list(found[1]))
        self.mux.on_publishers(*found)

    def _on_estop(self, pressed: bool) -> None:
        now_s = self.clock.now_s
        self.note("estop", now_s, pressed, now_s)
        self.filter.on_estop(pressed, now_s)
        if pressed:
            self._issue(self._filter_decides(now_s))

    def _issue(self, decision: Decision) -> None:
        now_s = self.clock.now_s
        if self._ending:
            decision = self._shut_down(now_s)
        self._filter_due, self.decision = now_s + self._period_s, decision
        self._sequence += 1
        self._stamp_ns = max(round(now_s * 1e9), self._stamp_ns + 1)  # no computer does two things in one nanosecond
        datagram = lease_datagram(self._sequence, self._stamp_ns, decision.twist, brakes_hard=decision.emergency)
        self._send_lease(datagram, decision.twist)
        self._topics.publish("cmd_vel", decision.twist)
        told = (decision.action, decision.cause, decision.emergency)
        if told != self._told or now_s - self._state_at >= STATE_PERIOD_S:
            self._told, self._state_at = told, now_s
            self._topics.publish("safety_filter/state", decision)
        written, problem = self.disk.write(self.filter.record)
        self.note("record", now_s, written and asdict(written), problem)
        self.filter.on_record(written, problem)
