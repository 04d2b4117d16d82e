"""The control thread in real time on python-can's virtual bus, with simulated drives and the watchdog beside it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import can
import pytest
from can.interfaces import BACKENDS
from can.interfaces.virtual import VirtualBus

from bus.flaky_bus import FlakyBus
from canbase_bench.frame import Frame as BenchFrame
from canbase_bench.world.bench import Bench, Truth
from canbase_config.derive import watchdog_config
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_driver.black_box import Ring
from canbase_driver.bus_port import BusPort
from canbase_driver.core import DriverCore
from canbase_driver.frame import Frame
from canbase_driver.kinematics import Twist2D
from canbase_driver.loop import FRAMES_WHEN_LATE, ControlLoop
from canbase_driver.snapshot import DriverSnapshot, DriverState, StopRecord
from canbase_velocity.lease import lease_datagram
from canbase_velocity.twist import Twist
from canbase_watchdog.watchdog import Watchdog

pytestmark = pytest.mark.bus
FORWARD = Twist2D(0.3, 0.0)


@pytest.fixture
def robot() -> Robot:
    return load_robot(sample("bench")).robot


@pytest.fixture
def arguments(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Of a bus that this test has for itself, and can break."""
    monkeypatch.setitem(BACKENDS, "virtual", ("bus.flaky_bus", "FlakyBus"))
    FlakyBus.heal()
    return {"interface": "virtual", "channel": f"loop-{request.node.name}"}


class Surroundings(threading.Thread):
    """What is on the other end of the bus: the drives, the watchdog with leases, and an ear."""

    def __init__(self, robot: Robot, channel: str) -> None:
        super().__init__()
        self._bus = VirtualBus(channel)
        self._bench = Bench(robot, time.monotonic())
        self._watchdog = Watchdog(watchdog_config(robot), time.monotonic())
        self._ended = threading.Event()
        self._leases = 0
        self.ordered = Twist2D.ZERO
        self.heard: list[tuple[float, int, bytes]] = []
        self.truth: Truth = self._bench.truth(time.monotonic())

    def __enter__(self) -> Surroundings:
        self.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._ended.set()
        self.join(5.0)
        self._bus.shutdown()

    def run(self) -> None:
        while not self._ended.is_set():
            received = self._bus.recv(0.001)
            now = time.monotonic()
            if received is not None:
                data = bytes(received.data)
                self.heard.append((now, received.arbitration_id, data))
                self._bench.on_frame(BenchFrame(received.arbitration_id, data), now)
                self._watchdog.on_frame(received.arbitration_id, data, now)
            self._lease(now)
            for frame in self._watchdog.tick(now):
                self._say(frame.cob_id, frame.data)
                self._bench.on_frame(BenchFrame(frame.cob_id, frame.data), now)
            for answer in self._bench.tick(now):
                self._say(answer.cob_id, answer.data)
                self._watchdog.on_frame(answer.cob_id, answer.data, now)
            self.truth = self._bench.truth(now)

    def _lease(self, now: float) -> None:
        self._leases += 1
        ordered = Twist(self.ordered.linear_mps, self.ordered.angular_radps)
        datagram = lease_datagram(self._leases, round(now * 1e9), ordered, stops=False, estop=False)
        self._watchdog.on_lease(datagram, None, now)

    def _say(self, cob_id: int, data: bytes) -> None:
        self._bus.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))


class Driver:
    """The control thread and who talks to it. `seen`: the newest snapshot."""

    def __init__(self, robot: Robot, arguments: dict[str, Any], around: Surroundings) -> None:
        self.core = DriverCore(robot)
        self.bus = BusPort(arguments)
        self.ring = Ring(10.0)
        self.loop = ControlLoop(self.core, self.bus, robot.rates.control_hz, robot.rates.odometry_hz, self.ring)
        self.around = around
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
            self.loop.command(twist, time.monotonic())
            snapshot, stops = self.loop.next_snapshot(timeout_s=0.02)
            self.stops += stops
            if snapshot is not None:
                self.snapshots += 1
                self.seen = snapshot
                if until(snapshot):
                    return snapshot
        raise AssertionError(f"not within {within_s} s: {self.seen}")

    def enabled(self) -> DriverSnapshot:
        """Wait until it is, and has seen zero commands since."""
        first = self.order(Twist2D.ZERO, 10.0, lambda snapshot: snapshot.state is DriverState.ENABLED)
        return self.order(Twist2D.ZERO, 5.0, lambda snapshot: snapshot.time_s > first.time_s + 0.1)


@pytest.fixture
def around(robot: Robot, arguments: dict[str, Any]) -> Iterator[Surroundings]:
    with Surroundings(robot, arguments["channel"]) as surroundings:
        yield surroundings


@pytest.fixture
def driver(robot: Robot, arguments: dict[str, Any], around: Surroundings) -> Iterator[Driver]:
    with Driver(robot, arguments, around) as running:
        yield running


def test_to_and_fro_in_real_time_and_an_orderly_end(driver: Driver, around: Surroundings) -> None:
    driver.enabled()
    there = driver.order(FORWARD, 5.0, lambda snapshot: snapshot.x_m > 0.15)
    assert there.linear_mps > 0.2
    back = driver.order(Twist2D(-0.3, 0.0), 8.0, lambda snapshot: snapshot.x_m < 0.05)
    assert back.linear_mps < 0.0
    last = driver.order(
        Twist2D.ZERO, 3.0, lambda snapshot: snapshot.standstill and snapshot.state is DriverState.ENABLED
    )
    assert last.x_m == pytest.approx(around.truth.x_m, abs=0.01)
    assert last.frames_dropped == 0
    driver.loop.request_shutdown()
    driver.loop.join(6.0)
    assert driver.loop.failure is None
    final, stops = driver.loop.next_snapshot(timeout_s=0.1)
    assert final is not None
    assert (final.cause, [stop.cause for stop in driver.stops + stops]) == ("shutdown", ["shutdown"])


def test_cycles_keep_their_grid_and_snapshots_come_at_the_rate_of_the_odometry(
    driver: Driver, around: Surroundings
) -> None:
    first = driver.enabled()
    before, cycles = driver.snapshots, first.cycles
    last = driver.order(Twist2D.ZERO, 10.0, lambda snapshot: snapshot.time_s > first.time_s + 2.0)
    duration_s = last.time_s - first.time_s
    # generous: this machine may be busy, but no cycle may come twice or too early
    assert 0.5 * 100.0 * duration_s < last.cycles - cycles <= 100.0 * duration_s + 2
    assert 0.4 * 50.0 * duration_s < driver.snapshots - before <= 50.0 * duration_s + 2
    assert last.cycle_lateness_max_s >= 0.0


def test_a_defect_in_the_core_sends_quick_stops_ends_the_thread_and_is_kept(
    driver: Driver, around: Surroundings, monkeypatch: pytest.MonkeyPatch
) -> None:
    driver.enabled()
    driver.order(FORWARD, 5.0, lambda snapshot: snapshot.linear_mps > 0.2)

    def defect(*_: object) -> None:
        raise ZeroDivisionError("a defect")

    monkeypatch.setattr(driver.core, "_judge", defect)
    driver.loop.join(2.0)
    assert not driver.loop.is_alive()
    assert isinstance(driver.loop.failure, ZeroDivisionError)
    time.sleep(1.0)
    from_driver = [(cob_id, data) for _, cob_id, data in around.heard if cob_id in (0x080, 0x201, 0x202)]
    quick_stop = bytes.fromhex("02 00 00 00 00 00")
    assert from_driver[-9:] == [(0x201, quick_stop), (0x202, quick_stop), (0x080, b"")] * 3
    assert around.truth.standing_s > 0.3
    assert driver.loop.reset().sentence == "refused: the control loop has ended"


def test_a_bus_that_fails_is_opened_again_and_the_base_drives_after_a_reset(
    driver: Driver, around: Surroundings
) -> None:
    driver.enabled()
    driver.order(FORWARD, 5.0, lambda snapshot: snapshot.linear_mps > 0.2)
    FlakyBus.broken = True
    failed = driver.order(FORWARD, 5.0, lambda snapshot: snapshot.state is DriverState.LATCHED)
    assert failed.cause == "bus failed"
    assert "network is down" in failed.detail
    assert around.truth.standing_s > 0.5  # watchdog and drives have done it
    FlakyBus.broken = False
    driver.order(
        Twist2D.ZERO,
        10.0,
        lambda snapshot: all(drive.nmt_state == "operational" for drive in snapshot.drives) and snapshot.odometry_valid,
    )
    outcome = driver.loop.reset()
    assert outcome.done, outcome.sentence
    driver.enabled()
    driver.order(FORWARD, 5.0, lambda snapshot: snapshot.linear_mps > 0.2)


def test_the_stop_request_and_the_reset_from_another_thread(driver: Driver) -> None:
    driver.enabled()
    driver.loop.request_stop()
    driver.order(Twist2D.ZERO, 3.0, lambda snapshot: snapshot.state is DriverState.LATCHED)
    assert [stop.cause for stop in driver.stops] == ["stop requested"]
    outcome = driver.loop.reset()
    assert outcome.done, outcome.sentence
    driver.enabled()


def test_the_last_snapshot_is_handed_over_though_the_state_is_the_same(driver: Driver) -> None:
    driver.enabled()
    driver.loop.request_stop()
    driver.order(Twist2D.ZERO, 3.0, lambda snapshot: snapshot.state is DriverState.LATCHED)
    driver.loop.request_shutdown()
    driver.loop.join(6.0)
    last, _ = driver.loop.next_snapshot(timeout_s=0.1)
    assert last is not None
    assert (last.state, last.cause) == (DriverState.LATCHED, "shutdown")


class SlowCore(DriverCore):
    """Its cycles take as long as `naps_s` says, one after the other; the last one for ever."""

    def __init__(self, robot: Robot, *naps_s: float) -> None:
        super().__init__(robot)
        self._naps_s = list(naps_s)
        self.ticked_at: list[float] = []
        self.taken = 0

    def on_frame(self, frame: Frame, now: float) -> list[Frame]:
        self.taken += 1
        return []

    def tick(self, now: float, lateness_s: float = 0.0) -> list[Frame]:
        self.ticked_at.append(now)
        time.sleep(self._naps_s.pop(0) if len(self._naps_s) > 1 else self._naps_s[0])
        return super().tick(now, lateness_s)


def run_for(core: DriverCore, robot: Robot, arguments: dict[str, Any], seconds: float, frames: int = 0) -> None:
    """Run the loop; after 0.1 s so many frames arrive at once."""
    loop = ControlLoop(core, BusPort(arguments), robot.rates.control_hz, robot.rates.odometry_hz, Ring(10.0))
    with VirtualBus(arguments["channel"]) as other:
        loop.start()
        time.sleep(0.1)
        for _ in range(frames):
            other.send(can.Message(arbitration_id=0x181, data=bytes(6), is_extended_id=False))
        time.sleep(seconds)
        loop.request_shutdown()
        loop.join(5.0)
    assert loop.failure is None
    assert not loop.is_alive()


def test_a_loop_that_is_always_late_still_takes_in_what_waits(robot: Robot, arguments: dict[str, Any]) -> None:
    core = SlowCore(robot, 0.015)
    run_for(core, robot, arguments, 0.5, frames=5 * FRAMES_WHEN_LATE)
    assert core.taken == 5 * FRAMES_WHEN_LATE


def test_cycles_that_were_missed_are_not_made_up_for(robot: Robot, arguments: dict[str, Any]) -> None:
    core = SlowCore(robot, 0.0, 0.5, 0.0)
    run_for(core, robot, arguments, 1.0)
    after = core.ticked_at[1] + 0.5
    assert len([at for at in core.ticked_at if after < at < after + 0.1]) <= 13
