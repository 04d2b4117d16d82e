"""How much faster than real time a two-wheel robot runs in virtual time: drives and body alone, and with the cores.

The floor: the same body and motors stepped in a bare loop, without a bus, a drive or an order. After
`make compiled`, `PYTHONPATH=build/compiled:virtual_bus_tests python benchmarks/virtual_time.py` measures it compiled.
"""

from __future__ import annotations

import gc
import struct
import time
from collections.abc import Callable
from random import Random

from canbase_campaign.can_bus import CanBus
from canbase_campaign.clock import FINE, Clock, ComputerClock
from canbase_campaign.driver_process import DriverProcess
from canbase_campaign.drives import Drives
from canbase_campaign.process import Topics
from canbase_campaign.robots import DrawnRobot
from canbase_campaign.watchdog_process import WatchdogProcess
from canbase_config.derive import watchdog_config
from canbase_driver import core
from canbase_runtime.driver_state import DriverState
from canbase_sim.frame import Frame
from canbase_sim.plant.base import Base, MountedWheel, PlantParameters
from canbase_velocity.lease import lease_datagram
from canbase_velocity.twist import ZERO, Twist
from figures import Figure
from support.chain_world import bench_robot
from support.sim_rig import MPS, Rig

SECONDS = 60.0
QUICK_S = 15.0
BUDGET = 100.0
FORWARD = Twist(0.3, 0.0)
COMMAND_S = 0.02


def quick() -> list[Figure]:
    """The same in less time."""
    return measure(QUICK_S)


def measure(seconds: float = SECONDS) -> list[Figure]:
    """The bench, and the bench with driver and watchdog."""
    floor = _ratio(_body(seconds), seconds)
    drives, chain = _ratio(_bench(seconds), seconds), _ratio(Chain().drives_on(seconds), seconds)
    return [
        _figure("simulated drives and body, setpoints and SYNC at 100 Hz, driving", drives, floor),
        _figure("the same with driver and watchdog, driving at 0.3 m/s", chain, floor),
    ]


def _figure(what: str, ratio: float, floor: float) -> Figure:
    beside, measured = f"the body alone, in a bare loop: {floor:.0f} ×", f"{ratio:.0f} × real time"
    kept, form = ratio >= BUDGET, "" if str(core.__file__).endswith(".py") else ", compiled"
    return Figure(f"virtual time{form}: {what}", measured, beside, ratio / floor, "≥ 100 ×", kept, more_is_better=True)


def _ratio(run: Callable[[], object], seconds: float) -> float:
    """How much faster than real time, by the time of this process: what others do on the computer does not count.

    The collector is off, as in the loops of driver and watchdog.
    """
    gc.collect()
    gc.disable()
    began_s = time.process_time()
    run()
    ratio = seconds / (time.process_time() - began_s)
    gc.enable()
    return ratio


def _body(seconds: float) -> Callable[[], object]:
    robot, body = bench_robot(), PlantParameters()
    left, right = (MountedWheel(body.motor(2), 1) for _ in range(2))
    base = Base(body, robot.base.track_m, robot.base.standstill_mps, [left], [right], 0.0)
    for wheel in (left, right):
        wheel.motor.power_on()
        wheel.motor.run(FORWARD.linear_mps, 1.0, 1.0)

    def run() -> None:
        for step in range(1, round(seconds / body.step_s)):
            base.step(step * body.step_s)

    return run


def _bench(seconds: float) -> Callable[[], object]:
    rig = Rig()
    rig.drive(MPS // 2, MPS // 2, 1.0)
    cycle = [Frame(0x200 + node, struct.pack("<Hi", 0x0F, sign * MPS // 2)) for node, sign in ((1, 1), (2, -1))]
    cycle.append(Frame(0x080, b""))

    def run() -> None:
        for _ in range(round(seconds * 100.0)):
            rig.now_s += 0.01
            for frame in cycle:
                rig.bench.on_frame(frame, rig.now_s)
            rig.bench.tick(rig.now_s)

    return run


class Chain:
    """Drives, driver and watchdog on the campaign's bus and clock, each at its own times, with orders and leases."""

    def __init__(self) -> None:
        robot, random = bench_robot(), Random(0)
        self._clock = Clock(100.0)
        bus = CanBus(self._clock, random, robot.bus.bitrate)
        self._topics = Topics(self._clock, random, FINE.topic_jitter_s)
        self._drives = Drives(DrawnRobot(0, robot, PlantParameters()), bus)
        computer = ComputerClock(self._clock)
        self._driver = DriverProcess(robot, computer, bus, self._topics)
        self._watchdog = WatchdogProcess(watchdog_config(robot), computer, bus)
        self._twist, self._sequence = ZERO, 0
        self._order()
        self._clock.run_until(self._clock.now_s + 3.0)
        assert self._driver.core.state is DriverState.ENABLED, self._driver.core.finding
        self._twist = FORWARD
        self._clock.run_until(self._clock.now_s + 1.0)

    def drives_on(self, seconds: float) -> Callable[[], object]:
        """At speed, so much longer."""
        assert abs(self._drives.bench.base.v_mps - FORWARD.linear_mps) < 0.01
        return lambda: self._clock.run_until(self._clock.now_s + seconds)

    def _order(self) -> None:
        self._sequence += 1
        stamp_ns = round(self._clock.now_s * 1e9)
        self._watchdog.on_lease(lease_datagram(self._sequence, stamp_ns, self._twist, brakes_hard=False))
        self._topics.publish("cmd_vel", self._twist)
        self._clock.after(COMMAND_S, self._order)


if __name__ == "__main__":
    for figure in measure():
        print(figure)
