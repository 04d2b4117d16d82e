"""All pure cores of canbase in one virtual world: five processes, their topics, the leases, the bus and the drives."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from random import Random
from types import MappingProxyType

from canbase_campaign.action_process import ActionProcess, Goal
from canbase_campaign.can_bus import CanBus
from canbase_campaign.clock import FINE, Clock, ComputerClock, Pace
from canbase_campaign.driver_process import DriverProcess
from canbase_campaign.drives import Drives
from canbase_campaign.intruder import Intruder
from canbase_campaign.process import Process, Topics
from canbase_campaign.robots import DrawnRobot, campaign_robot
from canbase_campaign.velocity_process import VelocityProcess
from canbase_campaign.watchdog_process import WatchdogProcess
from canbase_config.derive import watchdog_config
from canbase_config.robot import Robot
from canbase_runtime.driver_state import DriverState
from canbase_sim.odd.draw import OddDrive
from canbase_sim.plant.base import PlantParameters
from canbase_velocity.twist import Twist

LEASE_DELAY_S = 0.0002
BOOT_S = 10.0
OLDER = b"CBL0"
"""Magic of leases before the flags: four bytes shorter."""


class World:
    """`note` logs what happens; `on_lease` receives every order whose lease reaches the watchdog's socket."""

    def __init__(
        self,
        robot: Robot | None = None,
        seed: int = 0,
        pace: Pace = FINE,
        drawn: DrawnRobot | None = None,
        odd: Mapping[int, OddDrive] = MappingProxyType({}),
        uptime_s: float = 100.0,
    ) -> None:
        """`drawn`: a robot with its body and its floor; None: `robot`, or the sample, on a level floor.

        `odd`: drives of the kind `odd`, by node id. `uptime_s`: monotonic time when it begins.
        """
        self.drawn = drawn or DrawnRobot(0, robot or campaign_robot(), PlantParameters())
        self.robot = self.drawn.robot
        self.random = Random(seed)
        self.clock = clock = Clock(uptime_s)
        self.computer = computer = ComputerClock(clock)
        """The clock of all processes."""
        self.note: Callable[[str], None] = lambda text: None
        self.on_lease: Callable[[Twist], None] = lambda twist: None
        self.on_goal_end: Callable[[Goal], None] = lambda goal: None
        self.lease_loss = 0.0
        """Chance that a lease is lost on its way."""
        self.locked_at = math.inf
        """Since when somebody publishes on the lock that it holds."""
        self.lease_garbage = False
        """Every lease comes with a mangled copy of it."""
        self.lease_older = False
        """The velocity process is of an older version, whose leases have another layout."""
        self.bus = CanBus(clock, self.random, self.robot.bus.bitrate)
        self.topics = Topics(clock, self.random, pace.topic_jitter_s)
        self.drives = Drives(self.drawn, self.bus, pace, odd)
        self.driver = DriverProcess(self.robot, computer, self.bus, self.topics, pace)
        self.watchdog = WatchdogProcess(watchdog_config(self.robot), computer, self.bus, pace)
        self.velocity = VelocityProcess(self.robot, computer, self.topics, self._lease, pace)
        self.action = ActionProcess(self.robot, computer, self.topics, lambda goal: self.on_goal_end(goal))
        self.intruder = Intruder(self.robot, self.bus, self.topics)
        processes: tuple[Process, ...] = (self.driver, self.watchdog, self.velocity, self.action)
        self.processes = {process.name: process for process in processes}

    def enable(self) -> None:
        """From power on until the driver is enabled and has seen a zero. RuntimeError: it does not happen."""
        end = self.clock.now_s + BOOT_S
        while self.driver.core.state is not DriverState.ENABLED:
            if self.clock.now_s >= end:
                raise RuntimeError(
                    f"not enabled after {BOOT_S} s: {self.driver.core.state.name} {self.driver.core.finding}"
                )
            self.clock.run_until(self.clock.now_s + 0.01)
        self.release()
        self.clock.run_until(self.clock.now_s + 0.7)

    def release(self) -> None:
        """Every source commands zero once: from now on it is followed (neutral start)."""
        for source in self.robot.mux.sources.values():
            self.topics.publish(source.topic, Twist(0.0, 0.0))

    def _lease(self, datagram: bytes, twist: Twist) -> None:
        if self.lease_older:
            self.clock.after(LEASE_DELAY_S, self.watchdog.on_lease, OLDER + datagram[len(OLDER) : -8] + datagram[-4:])
            return
        if self.random.random() >= self.lease_loss:
            self.clock.after(LEASE_DELAY_S, self._deliver, datagram, twist)
        if self.lease_garbage:
            self.clock.after(LEASE_DELAY_S, self.watchdog.on_lease, self._mangled(datagram))

    def _deliver(self, datagram: bytes, twist: Twist) -> None:
        if self.watchdog.alive:
            self.on_lease(twist)
            self.watchdog.on_lease(datagram)

    def _mangled(self, datagram: bytes) -> bytes:
        """A byte changed, cut short, or noise of any length."""
        draw = self.random
        kind = draw.randrange(3)
        if kind == 0:
            at = draw.randrange(len(datagram))
            return datagram[:at] + bytes([datagram[at] ^ (1 << draw.randrange(8))]) + datagram[at + 1 :]
        if kind == 1:
            return datagram[: draw.randrange(len(datagram))]
        return draw.randbytes(draw.randrange(64))
