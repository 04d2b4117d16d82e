"""The process of motor_driver: opens the bus, starts the threads, ends them. Owns signals and exit codes.

Every way out stops the robot: a signal ramps down and disables; a thread that fails sends quick stop and ends the
process; a process that is killed or hangs is caught by the watchdog and by the drives' own heartbeat consumers.
"""

from __future__ import annotations

import gc
import signal
import sys
import time
from collections.abc import Sequence
from types import FrameType

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions

from canbase_config.robot import Robot
from canbase_driver.bus_port import BusError, BusPort
from canbase_driver.core import DriverCore
from canbase_driver.loop import ControlLoop
from canbase_driver.node import MotorDriverNode, Publisher
from canbase_driver.services import DriverServices

WAKE_S = 0.1
LOOP_TIMEOUT_S = 0.5
"""A control thread without a cycle for so long hangs: the process ends, the watchdog has already stopped the drives."""
END_MARGIN_S = 3.0
"""Above the ramp's time: quick stop, power off."""


def run(robot: Robot, ros_args: Sequence[str]) -> int:
    """Runs the driver until SIGINT or SIGTERM. Returns 0 after an orderly end, 1 when the bus cannot be opened or a
    thread failed. `ros_args`: arguments for rclpy. Call from the main thread (signals)."""
    try:
        bus = BusPort(robot.bus.arguments())
    except BusError as error:
        print(f"canbase driver: {error}", file=sys.stderr)
        return 1
    received: list[int] = []

    def note(number: int, _frame: FrameType | None) -> None:
        received.append(number)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, note)
    rclpy.init(args=list(ros_args), signal_handler_options=SignalHandlerOptions.NO)
    loop = ControlLoop(DriverCore(robot), bus, robot.rates.control_hz, robot.rates.odometry_hz)
    node = MotorDriverNode(robot, loop)
    publisher, services = Publisher(node, loop), DriverServices(loop)
    threads = (loop, publisher, services)
    gc.collect()
    gc.freeze()  # what is there now lives for ever: later collections need not look at it
    for thread in threads:
        thread.start()
    try:
        failure = _spin(node, loop, threads, received)
        loop.request_shutdown()
        loop.join(robot.timeouts.standstill_s + END_MARGIN_S)
        publisher.join(1.0)
    finally:
        rclpy.shutdown()
        services.join(1.0)
    failure = failure or loop.failure
    if failure is not None:
        node.get_logger().fatal(f"ended by {type(failure).__name__}: {failure}")
        sys.excepthook(type(failure), failure, failure.__traceback__)
    return 0 if failure is None else 1


def _spin(
    node: MotorDriverNode,
    loop: ControlLoop,
    threads: tuple[ControlLoop, Publisher, DriverServices],
    received: list[int],
) -> BaseException | None:
    """Until a signal or a failure; the failure."""
    executor = EventsExecutor()
    executor.add_node(node)
    try:
        while not received:
            executor.spin_once(timeout_sec=WAKE_S)
            failure = _failure(loop, threads)
            if failure is not None:
                return failure
    except Exception as error:  # noqa: BLE001 - the base is ramped down, then the process ends by it
        return error
    finally:
        executor.shutdown()
    return None


def _failure(loop: ControlLoop, threads: tuple[ControlLoop, Publisher, DriverServices]) -> BaseException | None:
    """Why the process must end: a thread that failed, ended, or hangs."""
    for thread in threads:
        if thread.failure is not None:
            return thread.failure
        if not thread.is_alive():
            return RuntimeError(f"thread {thread.name} ended by itself")
    if time.monotonic() - loop.cycle_at > LOOP_TIMEOUT_S:
        return TimeoutError(f"the control thread has made no cycle for {LOOP_TIMEOUT_S} s")
    return None
