"""The process of velocity_mux and safety_filter: two nodes, one thread, one executor. Owns signals and the way out."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import FrameType

import rclpy
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions

from canbase_base.latch_file import LatchFile, LatchKeeper
from canbase_base.latch_folder import SUFFIX, latch_folder
from canbase_base.output import never_wait
from canbase_base.sd_notify import Service
from canbase_base.single_instance import TakenError, hold_record, take
from canbase_config.robot import Robot
from canbase_config.stopping import standstill_s
from canbase_runtime.private_process import guard_keys
from canbase_runtime.ros_end import end_ros
from canbase_velocity.filter_node import FilterNode
from canbase_velocity.input_ring import InputRing
from canbase_velocity.mux_node import MuxNode
from canbase_velocity.stop_recorder import StopRecorder

SHUTDOWN_CYCLES = 5
"""At least this many zeros go out at the end, one per command period."""
WAKE_S = 0.1
WRITE_S = 1.0
"""For the record of the emergency stop at the end."""
RECORD_LOOK_S = 0.005


def run(robot: Robot, ros_args: Sequence[str], when_ready: Callable[[], None] = lambda: None) -> int:
    """Runs mux and filter until SIGINT or SIGTERM; then orders zero until the base stands and returns 0.

    `ros_args`: arguments for rclpy, such as ["--ros-args", "-r", "__ns:=/robot2"]. An exception in a callback ends the
    process too: zeros go out, and it is raised here. `when_ready`: called when all is made and nothing runs yet. Call
    from the main thread (signals).
    """
    guard_keys(os.environ)
    never_wait(os.environ)
    folder = latch_folder(os.environ, Path.home(), robot.name)
    try:
        held, writer = take("velocity process", robot.lease.socket), hold_record(folder / f"velocity{SUFFIX}")
    except TakenError as error:
        print(f"canbase serve velocity: {error}", file=sys.stderr)
        return 1
    with held, writer, _stop_signals() as received:
        rclpy.init(args=list(ros_args), signal_handler_options=SignalHandlerOptions.NO)
        try:
            _run_nodes(robot, folder, received, when_ready)
        finally:
            rclpy.try_shutdown()
    return 0


def _run_nodes(robot: Robot, folder: Path, received: list[int], when_ready: Callable[[], None]) -> None:
    inputs = InputRing(robot.black_box.seconds)
    mux = MuxNode(robot, inputs.note)
    keeper = LatchKeeper(LatchFile(folder, "velocity", robot.name, must_last=not robot.bus.is_virtual))
    safety = FilterNode(robot, mux.moving_sources, keeper, inputs.note)
    recorder = StopRecorder(robot, inputs, mux, safety)
    mux.lead(safety)
    executor = EventsExecutor()
    executor.add_node(mux)
    executor.add_node(safety)
    period_s, service = 1.0 / robot.rates.command_hz, Service()
    when_ready()
    keeper.start()
    recorder.start()
    try:
        while not received:
            executor.spin_once(timeout_sec=WAKE_S)
            recorder.record_due_stop(time.monotonic())
            service.alive(safety.state_text, time.monotonic())
        service.stopping()
        patience_s = time.monotonic() + standstill_s(robot)
        _order_zero(mux, safety, partial(_spin, executor, period_s), min(safety.stands_from_s, patience_s))
        _end_record(safety, executor)
    except BaseException:
        # What failed may fail again: no callback, no waiting for standstill, the driver and the watchdog see to it.
        _order_zero(mux, safety, partial(time.sleep, period_s), 0.0)
        raise
    finally:
        keeper.finish(WRITE_S)
        recorder.finish(WRITE_S)
        executor.shutdown()
        end_ros(safety, mux)


def _order_zero(mux: MuxNode, safety: FilterNode, wait: Callable[[], None], until_s: float) -> None:
    """Zeros and leases, until `until_s` (time.monotonic), so that an orderly end does not trip the watchdog.

    `wait`: for one command period. An orderly end receives meanwhile: the emergency stop may be pressed in it.
    """
    cycles = 0
    while cycles < SHUTDOWN_CYCLES or time.monotonic() < until_s:
        mux.shut_down()
        safety.shut_down()
        wait()
        cycles += 1


def _spin(executor: Executor, seconds: float) -> None:
    until_s = time.monotonic() + seconds
    while (left_s := until_s - time.monotonic()) > 0.0:
        executor.spin_once(timeout_sec=left_s)


def _end_record(safety: FilterNode, executor: Executor) -> None:
    """The base is at standstill: the record on disk loses its mark, unless the emergency stop is pressed until then."""
    until_s = time.monotonic() + WRITE_S
    while not safety.end() and time.monotonic() < until_s:
        _spin(executor, RECORD_LOOK_S)
    _spin(executor, RECORD_LOOK_S)


@contextmanager
def _stop_signals() -> Iterator[list[int]]:
    """Collects SIGINT and SIGTERM instead of dying from them. They are seen between two callbacks, never inside one."""
    received: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        received.append(number)

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield received
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
