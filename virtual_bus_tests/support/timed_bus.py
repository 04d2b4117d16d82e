"""The chain on a bus that takes its time: one frame after the other, the lowest identifier first (ISO 11898-1)."""

from __future__ import annotations

import heapq
import itertools

from canbase_campaign.can_bus import frame_bits
from canbase_config.derive import watchdog_config
from canbase_config.robot import Robot
from canbase_driver.cia301.frame import Frame
from canbase_driver.core import DriverCore
from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_sim.frame import Frame as BenchFrame
from canbase_sim.world.bench import Bench
from canbase_watchdog.watchdog import Watchdog

IDLE_S = 1e-4
"""The drives' own delays are looked for this often while the bus is idle."""
COMMAND_PERIOD_S = 0.02
WATCHDOG_PERIOD_S = 0.005


def on_a_wire(robot: Robot, bitrate: int = 500_000) -> Robot:
    """The same robot, on a bus with a bit rate."""
    values = robot.model_dump()
    values["bus"] = {"interface": "socketcan", "channel": "can0", "bitrate": bitrate}
    return Robot.model_validate(values)


class TimedBus:
    """Driver, watchdog and drives, all switched on at the same moment."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self.now_s = robot, 0.0
        self._bench, self._driver = Bench(robot, 0.0), DriverCore(robot)
        self._watchdog = Watchdog(watchdog_config(robot), 0.0)
        self._queue: list[tuple[int, int, Frame]] = []
        self._numbers = itertools.count()
        self._due = {"cycle": 0.0, "command": 0.0, "watchdog": 0.0}
        self.heard: list[tuple[float, Frame]] = []
        """Every frame, and when its last bit had passed."""

    def enabled_after(self, within_s: float) -> float:
        """From power on to operation enabled on all drives [s]. Fails when that takes longer than `within_s`."""
        while self._driver.state is not DriverState.ENABLED:
            assert self.now_s < within_s, self._driver.finding
            self._step()
        return self.now_s

    def _step(self) -> None:
        """The time of one frame, or a little when there is none."""
        self._queue_up_what_is_due()
        if not self._queue:
            self.now_s += IDLE_S
            return
        frame = heapq.heappop(self._queue)[2]
        self.now_s += frame_bits(len(frame.data)) / self._robot.bus.bitrate
        self._deliver(frame)

    def _queue_up_what_is_due(self) -> None:
        if self._is_due("command", COMMAND_PERIOD_S):
            self._driver.accept_velocity_command(Twist2D.ZERO, self.now_s)
        if self._is_due("cycle", 1.0 / self._robot.rates.control_hz):
            self._queue_up(self._driver.tick(self.now_s))
        if self._is_due("watchdog", WATCHDOG_PERIOD_S):
            self._queue_up([Frame(each.cob_id, each.data, each.remote) for each in self._watchdog.tick(self.now_s)])
        self._queue_up([Frame(frame.cob_id, frame.data) for frame in self._bench.tick(self.now_s)])

    def _is_due(self, what: str, period_s: float) -> bool:
        due = self.now_s >= self._due[what]
        self._due[what] += period_s * due
        return due

    def _queue_up(self, frames: list[Frame]) -> None:
        for frame in frames:
            heapq.heappush(self._queue, (frame.cob_id, next(self._numbers), frame))

    def _deliver(self, frame: Frame) -> None:
        self.heard.append((self.now_s, frame))
        if not frame.remote:
            self._queue_up(self._driver.on_frame(frame, self.now_s))
            self._watchdog.on_frame(frame.cob_id, frame.data, self.now_s)
        self._bench.on_frame(BenchFrame(frame.cob_id, frame.data, remote=frame.remote), self.now_s)
