"""The control thread in real time and what is around it: drives, simulated or real, and the watchdog with leases."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import can

from canbase_config.derive import watchdog_config
from canbase_driver.cia301.nmt import NmtState
from canbase_driver.core import DriverCore
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.runtime.black_box import Ring
from canbase_driver.runtime.bus_port import BusPort
from canbase_driver.runtime.control_thread import ControlLoop
from canbase_driver.snapshot import DriverSnapshot
from canbase_driver.supervision.fault_reset import RequestOutcome
from canbase_driver.supervision.stop_history import StopRecord
from canbase_runtime.driver_state import DriverState
from canbase_sim.faults import apply
from canbase_sim.frame import Frame as BenchFrame
from canbase_sim.world.bench import Bench, Truth
from canbase_velocity.lease import lease_datagram
from canbase_velocity.twist import Twist
from canbase_watchdog.watchdog import Watchdog
from support.crews import Crew


class Surroundings(threading.Thread):
    """What is on the other end of the bus: the drives of a simulated crew, the watchdog with leases, and an ear."""

    def __init__(self, crew: Crew, bus: can.BusABC) -> None:
        super().__init__(name="surroundings", daemon=True)
        self._bus, now_s = bus, time.monotonic()
        self._bench = Bench(crew.robot, now_s) if crew.simulated else None
        self._watchdog = Watchdog(watchdog_config(crew.robot), now_s)
        self._ended = threading.Event()
        self._lock = threading.Lock()
        self._leases = 0
        self.ordered = Twist2D.ZERO
        self.heard: list[tuple[float, int, bytes]] = []

    def __enter__(self) -> Surroundings:
        self.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._ended.set()
        self.join(5.0)
        self._bus.shutdown()

    @property
    def truth(self) -> Truth:
        """What simulated wheels really do."""
        assert self._bench is not None
        with self._lock:
            return self._bench.truth(time.monotonic())

    def suffer(self, node_id: int, fault: str, **arguments: object) -> None:
        """Make a simulated drive suffer."""
        assert self._bench is not None
        with self._lock:
            apply(self._bench.nodes, node_id, fault, time.monotonic(), arguments)

    def run(self) -> None:
        """The thread's body."""
        while not self._ended.is_set():
            received = self._bus.recv(0.001)
            with self._lock:
                while received is not None:  # all that waits: one a turn falls behind on a busy computer, for good
                    self._take(received, time.monotonic())
                    received = self._bus.recv(0.0)
                self._turn(time.monotonic())

    def _take(self, received: can.Message, now_s: float) -> None:
        if received.is_extended_id or received.is_remote_frame:
            return
        data = bytes(received.data)
        self.heard.append((now_s, received.arbitration_id, data))
        self._to_drives(received.arbitration_id, data, now_s)
        self._watchdog.on_frame(received.arbitration_id, data, now_s)

    def _turn(self, now_s: float) -> None:
        self._lease(now_s)
        for frame in self._watchdog.tick(now_s):
            self._say(frame.cob_id, frame.data, remote=frame.remote)
            self._to_drives(frame.cob_id, frame.data, now_s, remote=frame.remote)
        for answer in self._bench.tick(now_s) if self._bench else ():
            self._say(answer.cob_id, answer.data, extended=answer.extended)
            if not answer.extended:
                self._watchdog.on_frame(answer.cob_id, answer.data, now_s)

    def _to_drives(self, cob_id: int, data: bytes, now_s: float, *, remote: bool = False) -> None:
        if self._bench is not None:
            self._bench.on_frame(BenchFrame(cob_id, data, remote=remote), now_s)

    def _lease(self, now_s: float) -> None:
        self._leases += 1
        ordered = Twist(self.ordered.linear_mps, self.ordered.angular_radps)
        datagram = lease_datagram(self._leases, round(now_s * 1e9), ordered, brakes_hard=False)
        self._watchdog.on_lease(datagram, None, now_s)

    def _say(self, cob_id: int, data: bytes, *, extended: bool = False, remote: bool = False) -> None:
        self._bus.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=extended, is_remote_frame=remote))


class Driver:
    """The control thread and its peers. `seen`: the newest snapshot."""

    def __init__(self, crew: Crew, arguments: dict[str, Any], around: Surroundings) -> None:
        robot = crew.robot
        self.core = DriverCore(robot)
        self.bus = BusPort(arguments)
        self.ring = Ring(10.0)
        self.loop = ControlLoop(self.core, self.bus, robot.rates.control_hz, robot.rates.odometry_hz, self.ring)
        self.around = around
        self.forward = Twist2D(crew.speed_mps, 0.0)
        self._guarded = {drive.joint for drive in robot.drives if drive.kind.self_stop.node_guarding}
        self.seen: DriverSnapshot | None = None
        self.stops: list[StopRecord] = []
        self.snapshots = 0

    def __enter__(self) -> Driver:
        self.loop.start()
        return self

    def __exit__(self, *error: object) -> None:
        self.loop.request_shutdown()
        self.loop.join(6.0)
        assert not self.loop.is_alive()

    def order(self, twist: Twist2D, within_s: float, until: Callable[[DriverSnapshot], bool]) -> DriverSnapshot:
        """Command this velocity at about 50 Hz until a snapshot is as wanted."""
        end = time.monotonic() + within_s
        self.around.ordered = twist
        while time.monotonic() < end:
            self.loop.queue_velocity_command(twist, time.monotonic())
            snapshot, stops = self.loop.next_snapshot(timeout_s=0.02)
            self.stops += stops
            if snapshot is not None:
                self.snapshots += 1
                self.seen = snapshot
                if until(snapshot):
                    return snapshot
        told = self.seen and (self.seen.state, self.seen.finding, self.seen.cycle, self.seen.odometry.twist)
        raise AssertionError(f"not within {within_s} s: {told}")

    def enabled(self) -> DriverSnapshot:
        """Wait until it is, and has seen zero commands since."""
        first = self.order(Twist2D.ZERO, 10.0, lambda snapshot: snapshot.state is DriverState.ENABLED)
        return self.order(Twist2D.ZERO, 5.0, lambda snapshot: snapshot.time_s > first.time_s + 0.1)

    def driving(self) -> DriverSnapshot:
        """Enabled, and nearly as fast as ordered."""
        self.enabled()
        return self.order(
            self.forward, 5.0, lambda snapshot: snapshot.odometry.twist.linear_mps > 0.7 * self.forward.linear_mps
        )

    def latched(self, twist: Twist2D = Twist2D.ZERO, within_s: float = 5.0) -> DriverSnapshot:
        """Order this until a stop is at its end."""
        return self.order(twist, within_s, lambda snapshot: snapshot.state is DriverState.LATCHED)

    def heard_again(self) -> DriverSnapshot:
        """Wait, with zero commands, until every drive is booted and its encoder known.

        That is after the wheels rolled out, and after the watchdog has released them: a boot before it is tried again.
        A guarded drive sends its feedback then, and its NMT state after the reset: until it, a tripped watchdog
        withholds its requests.
        """

        def heard(s: DriverSnapshot) -> bool:
            states = [drive.nmt_state for drive in s.drives if drive.joint not in self._guarded]
            return states == [NmtState.OPERATIONAL] * len(states) and s.odometry.valid

        return self.order(Twist2D.ZERO, 25.0, heard)

    def reset(self, within_s: float = 0.0) -> None:
        """Reset, which must be done; a refusal within this time only means to try again."""
        deadline_s = time.monotonic() + within_s
        outcome = self.try_reset()
        while not outcome.done and time.monotonic() < deadline_s:
            time.sleep(0.5)
            outcome = self.try_reset()
        assert outcome.done, outcome.sentence

    def stop(self) -> None:
        """Service motor_driver/stop; its answer is not waited for."""
        self.loop.stop(lambda _outcome: None)

    def try_reset(self, within_s: float = 20.0) -> RequestOutcome:
        """Reset; how it ended."""
        outcomes: list[RequestOutcome] = []
        self.loop.reset(outcomes.append)
        deadline_s = time.monotonic() + within_s
        while not outcomes and time.monotonic() < deadline_s:
            time.sleep(0.01)
            self.loop.deliver()
        return outcomes[0]
