"""The process of motor_driver: opens the bus, starts the threads, ends them. Owns signals and exit codes.

Every way out stops the robot: a signal ramps down and disables; a thread that fails sends quick stop and ends the
process; a process that is killed or hangs is caught by the watchdog and by the drives' own heartbeat consumers.
"""

from __future__ import annotations

import gc
import math
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from types import FrameType

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.logging import get_logger
from rclpy.signals import SignalHandlerOptions

from canbase_base.frame_socket import BusError
from canbase_base.latch_file import LatchFile, LatchKeeper
from canbase_base.output import never_wait
from canbase_base.sd_notify import Service
from canbase_base.single_instance import TakenError
from canbase_config.robot import Robot
from canbase_config.stopping import given_up_s
from canbase_driver.core import DriverCore
from canbase_driver.ros.node import MotorDriverNode, Publisher
from canbase_driver.runtime.black_box import Ring
from canbase_driver.runtime.black_box_about import about
from canbase_driver.runtime.black_box_writer import BlackBoxWriter
from canbase_driver.runtime.claim import Claim
from canbase_driver.runtime.control_thread import ControlLoop
from canbase_driver.supervision.lifecycle import Aim
from canbase_runtime.log_priority import Priority
from canbase_runtime.private_process import guard_keys
from canbase_runtime.ros_end import end_ros

WAKE_S = 0.02
"""An outcome of the control thread waits at most this long for the next message before it is answered [s]."""
LOOP_TIMEOUT_S = 0.5
"""A control thread without a cycle for this long, while this one ran, hangs: the process ends; the watchdog has already
stopped the drives."""
END_MARGIN_S = 1.5
"""Above the time of ramp and quick stop: power off."""
WRITE_S = 5.0
"""For the recording of a stop that is just over."""

Worker = ControlLoop | Publisher | BlackBoxWriter | LatchKeeper
"""Each of them has a `failure`, and none may end before the process does."""


def run(
    robot: Robot,
    ros_args: Sequence[str],
    claim: Claim,
    autostart: bool = True,
    when_ready: Callable[[], None] = lambda: None,
) -> int:
    """Runs the driver until SIGINT or SIGTERM. Returns 0 after an orderly end, 1 when another driver is on the bus or a
    thread failed. `ros_args`: arguments for rclpy. `claim`: of this robot; closed at the end. `autostart`: without it
    nothing is sent on the bus before the node is configured. `when_ready`: called when all is made and nothing runs
    yet. Call from the main thread (signals)."""
    guard_keys(os.environ)
    never_wait(os.environ)
    folder = claim.folder
    try:
        claim.listen()
    except (TakenError, BusError) as error:
        print(f"canbase serve driver: {error}", file=sys.stderr)
        return 1
    received: list[int] = []

    def note(number: int, _frame: FrameType | None) -> None:
        received.append(number)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, note)
    rclpy.init(args=list(ros_args), signal_handler_options=SignalHandlerOptions.NO)
    aim = Aim.ACTIVE if autostart else Aim.RELEASED
    ring = Ring(robot.black_box.seconds)
    keeper = LatchKeeper(LatchFile(folder, "driver", robot.name, must_last=not robot.bus.is_virtual))
    core = DriverCore(robot, aim, keeper.found)
    loop = ControlLoop(core, claim.bus, robot.rates.control_hz, robot.rates.odometry_hz, ring, keeper)
    writer = BlackBoxWriter(robot.black_box, robot.name, get_logger("motor_driver").warning, about(robot))
    node = MotorDriverNode(robot, loop, ring, writer)
    publisher = Publisher(node, loop)
    threads = (loop, publisher, writer, keeper)
    gc.freeze()  # what is there now lives for ever: later collections need not look at it; of garbage there is little
    when_ready()
    for thread in threads:
        thread.start()
    try:
        failure = _spin(node, loop, threads, received)
        loop.request_shutdown()
        loop.join(given_up_s(robot) + END_MARGIN_S)
        loop.deliver()
        publisher.join(1.0)
        keeper.finish(WRITE_S)
        writer.finish(WRITE_S)
        failure = failure or loop.failure
        if failure is not None:
            node.event_log.write(f"ended by {type(failure).__name__}: {failure}", Priority.ERROR, robot=robot.name)
            sys.excepthook(type(failure), failure, failure.__traceback__)
    finally:
        claim.close()
        end_ros(*node.and_black_box)
    return 0 if failure is None else 1


def _spin(
    node: MotorDriverNode, loop: ControlLoop, threads: Sequence[Worker], received: list[int]
) -> BaseException | None:
    """Until a signal or a failure; the failure."""
    executor = EventsExecutor()
    executor.add_node(node)
    watch, service = HangWatch(LOOP_TIMEOUT_S, WAKE_S), Service()
    try:
        while not received:
            executor.spin_once(timeout_sec=WAKE_S)
            now_s = time.monotonic()
            node.look_at_the_clock(now_s)
            loop.deliver()
            node.deliver()
            failure = _failure(threads) or watch.check_cycle(loop.cycle_at, now_s)
            if failure is not None:
                return failure
            if loop.cycle_at < math.inf:
                service.alive(node.state_text, now_s)
    except Exception as error:  # noqa: BLE001 - the base is ramped down, then the process ends by it
        return error
    finally:
        service.stopping()
        executor.shutdown()
    return None


def _failure(threads: Sequence[Worker]) -> BaseException | None:
    """Why the process must end: a thread that failed or ended."""
    for thread in threads:
        if thread.failure is not None:
            return thread.failure
        if not thread.is_alive():
            return RuntimeError(f"thread {thread.name} ended by itself")
    return None


class HangWatch:
    """Distinguishes a thread that hangs from a process that was stopped as a whole, and goes on."""

    def __init__(self, timeout_s: float, check_s: float) -> None:
        """`check_s`: the longest time between two checks while this thread runs."""
        self._timeout_s = timeout_s
        self._check_s = check_s
        self._cycle_at = self._checked_at = math.inf
        self._without_cycle_s = 0.0

    def check_cycle(self, cycle_at: float, now_s: float) -> TimeoutError | None:
        """Call after each wait with the time of the last cycle. The failure, when there is one."""
        self._without_cycle_s += max(0.0, min(now_s - self._checked_at, self._check_s))
        self._checked_at = now_s
        if cycle_at != self._cycle_at:
            self._cycle_at, self._without_cycle_s = cycle_at, 0.0
        if self._without_cycle_s <= self._timeout_s:
            return None
        return TimeoutError(f"the control thread has made no cycle for {now_s - cycle_at:.1f} s")
