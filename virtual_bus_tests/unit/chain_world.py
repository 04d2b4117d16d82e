"""Driver, watchdog and simulated drives on one lossless bus in virtual time: the pure cores, no threads, no clock."""

from __future__ import annotations

from collections.abc import Callable

from canbase_bench.frame import Frame as BenchFrame
from canbase_bench.world.bench import Bench, Truth
from canbase_config.derive import watchdog_config
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_driver.core import DriverCore
from canbase_driver.frame import Frame
from canbase_driver.kinematics import Twist2D
from canbase_driver.reset import Outcome
from canbase_driver.snapshot import DriverState
from canbase_velocity.lease import lease_datagram
from canbase_velocity.twist import Twist
from canbase_watchdog.watchdog import Watchdog

STEP_S = 0.001


def bench_robot() -> Robot:
    """The sample robot of the bench."""
    return load_robot(sample("bench")).robot


class World:
    """Everything that shares the bus. `run` lets time pass; the parts are open to the tests."""

    def __init__(self, robot: Robot | None = None) -> None:
        self.robot = robot or bench_robot()
        self.now = 100.0
        self.bench = Bench(self.robot, self.now)
        self.driver: DriverCore | None = DriverCore(self.robot)
        self.watchdog: Watchdog | None = Watchdog(watchdog_config(self.robot), self.now)
        self.command: Twist2D | None = Twist2D.ZERO
        self.leases = True
        self.log: list[tuple[float, Frame]] = []
        self._sequence = 0
        self._next_cycle = self._next_command = self.now

    @property
    def core(self) -> DriverCore:
        """The driver, which must be alive."""
        assert self.driver is not None
        return self.driver

    @property
    def truth(self) -> Truth:
        """What the robot really does."""
        return self.bench.truth(self.now)

    def run(self, duration_s: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Let time pass; True as soon as `until` holds."""
        end = self.now + duration_s
        while self.now < end:
            self.now += STEP_S
            self._step()
            if until():
                return True
        return until()

    def run_until(self, state: DriverState, within_s: float) -> None:
        """Let time pass until the driver is in `state`; it must get there in time."""
        reached = self.run(within_s, lambda: self.core.state is state)
        assert reached, f"driver is {self.core.state.name}, not {state.name}: {self.core.cause}"

    def enable(self) -> None:
        """From power on to operation enabled, with a zero command seen."""
        self.run_until(DriverState.ENABLED, 3.0)
        self.run(0.1)

    def reset(self) -> Outcome:
        """Ask the driver for a reset and let it run to its end."""
        outcomes: list[Outcome] = []
        self.core.request_reset(self.now, outcomes.append)
        assert self.run(12.0, lambda: bool(outcomes)), "the reset never ended"
        return outcomes[0]

    def _step(self) -> None:
        if self.now >= self._next_command:
            self._next_command += 0.02
            self._order()
        if self.driver is not None and self.now >= self._next_cycle:
            self._next_cycle += 1.0 / self.robot.rates.control_hz
            self._send(self.driver.tick(self.now))
        if self.watchdog is not None:
            self._send([Frame(frame.cob_id, frame.data) for frame in self.watchdog.tick(self.now)])
        self._send([Frame(frame.cob_id, frame.data) for frame in self.bench.tick(self.now)])

    def _order(self) -> None:
        if self.command is None:
            return
        if self.driver is not None:
            self.driver.on_command(self.command, self.now)
        if self.leases and self.watchdog is not None:
            self._sequence += 1
            twist = self.command
            ordered = Twist(twist.linear_mps, twist.angular_radps)
            datagram = lease_datagram(self._sequence, round(self.now * 1e9), ordered, stops=False, estop=False)
            self.watchdog.on_lease(datagram, None, self.now)

    def _send(self, frames: list[Frame]) -> None:
        waiting = list(frames)
        while waiting:
            frame = waiting.pop(0)
            self.log.append((self.now, frame))
            if self.driver is not None:
                waiting += self.driver.on_frame(frame, self.now)
            if self.watchdog is not None:
                self.watchdog.on_frame(frame.cob_id, frame.data, self.now)
            self.bench.on_frame(BenchFrame(frame.cob_id, frame.data), self.now)
            waiting += [Frame(each.cob_id, each.data) for each in self.bench.tick(self.now)]
