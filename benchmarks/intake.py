"""Frames taken in by the driver and by the watchdog: a full 1 Mbit/s bus, and how much processor that costs.

A sender in a process of its own puts 8,000 frames a second on the virtual bus: SYNCs with the TPDOs of two drives, and
two of eight that cannot be understood, one by the driver and one by the watchdog. These they count: as many as were
sent, and none was lost. The floor is a loop around python-can's recv that does nothing with a frame.
"""

from __future__ import annotations

import gc
import json
import multiprocessing
import struct
import subprocess
import sys
import tempfile
import time
from multiprocessing.connection import Connection
from pathlib import Path

import can

from canbase_config.derive import watchdog_config
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from figures import Figure, raise_priority
from support.udp_port import free_udp_port

RATE_HZ = 8000
SECONDS = 5.0
BATCH = 8
"""This many frames in one go, 1,000 times a second."""
MALFORMED = b"\x01"
SETTLE_S = 1.0

SENDER = """
import json, sys, time
import can
arguments, frames, batches = json.loads(sys.argv[1]), json.loads(sys.argv[2]), int(sys.argv[3])
with can.Bus(**arguments) as bus:
    messages = [can.Message(arbitration_id=i, data=bytes.fromhex(d), is_extended_id=False) for i, d in frames]
    due = time.monotonic()
    for _ in range(batches):
        for message in messages:
            bus.send(message)
        due += 0.001
        time.sleep(max(0.0, due - time.monotonic()))
    print(time.monotonic() - due)
"""


def batch() -> list[tuple[int, str]]:
    """Eight frames; of the last two, the watchdog must count one as too short, and the driver the other."""
    status, speed = struct.pack("<Hi", 0x0240, 0).hex(), struct.pack("<i", 0).hex()
    feedback = [(0x181, status), (0x281, speed), (0x182, status), (0x282, speed)]
    return [*feedback, (0x701, "05"), (0x080, ""), (0x181, MALFORMED.hex()), (0x1FE, MALFORMED.hex())]


def bare(robot: Robot, pipe: Connection) -> None:
    """The floor: counts one of the eight, and does nothing else."""
    count = 0
    with can.Bus(**robot.bus.arguments()) as bus:
        pipe.send("ready")
        while not pipe.poll():
            for _ in range(256):
                message = bus.recv(0.05)
                if message is None:
                    break
                count += message.arbitration_id == 0x1FE
        pipe.send((count, time.process_time()))


def driver(robot: Robot, pipe: Connection) -> None:
    """The driver's control thread with its core."""
    from canbase_driver.core import DriverCore
    from canbase_driver.runtime.black_box import Ring
    from canbase_driver.runtime.bus_port import BusPort
    from canbase_driver.runtime.control_thread import ControlLoop

    raise_priority(35)
    core = DriverCore(robot)
    ring = Ring(robot.black_box.seconds)
    loop = ControlLoop(core, BusPort(robot.bus.arguments()), robot.rates.control_hz, robot.rates.odometry_hz, ring)
    gc.collect()
    gc.freeze()  # as the driver's process does
    loop.start()
    pipe.send("ready")
    pipe.recv()
    pipe.send((core.frames_dropped, time.process_time()))
    loop.request_shutdown()
    loop.join()


def watchdog(robot: Robot, pipe: Connection) -> None:
    """The watchdog's loop."""
    from canbase_watchdog.bus_port import BusPort
    from canbase_watchdog.input_ring import InputRing
    from canbase_watchdog.lease_socket import LeaseSocket
    from canbase_watchdog.loop import Loop
    from canbase_watchdog.realtime import calm_the_collector
    from canbase_watchdog.watchdog import Watchdog

    raise_priority(40)
    config = watchdog_config(robot)
    guard = Watchdog(config, time.monotonic())
    calm_the_collector()  # as its own process does
    with BusPort(config.bus_arguments) as bus, LeaseSocket(config.lease_socket, 0) as leases:
        pipe.send("ready")
        inputs = InputRing(config.recording_s, time.monotonic())
        Loop(guard, bus, leases, inputs=inputs).run(pipe.poll)
    pipe.send((guard.dropped_frames, time.process_time()))


def measure() -> list[Figure]:
    """Both figures."""
    floor_lost, floor_cpu = _run(bare)
    return [
        _figure("driver", *_run(driver), floor_lost, floor_cpu),
        _figure("watchdog", *_run(watchdog), floor_lost, floor_cpu),
    ]


def _figure(who: str, lost: int, cpu: float, floor_lost: int, floor_cpu: float) -> Figure:
    measured = f"{lost} lost, {cpu:.0%} of a processor"
    beside = f"a loop that only receives: {floor_lost} lost, {floor_cpu:.0%}"
    what = f"{who}: {RATE_HZ:,} frames a second for {SECONDS:.0f} s"
    return Figure(what, measured, beside, cpu / floor_cpu, "none lost", lost == 0)


def _run(target: object) -> tuple[int, float]:
    """Frames of each kind that were lost, times the eight kinds, and the share of a processor."""
    with tempfile.TemporaryDirectory(prefix="canbase-", dir="/tmp") as folder:
        robot = load_robot(sample("bench")).robot
        bus = robot.bus.model_copy(update={"extra": {"port": free_udp_port(), "hop_limit": 0}})
        lease = robot.lease.model_copy(update={"socket": str(Path(folder) / "lease")})
        robot = robot.model_copy(update={"bus": bus, "lease": lease})
        ours, theirs = multiprocessing.Pipe()
        process = multiprocessing.get_context("spawn").Process(target=target, args=(robot, theirs))  # type: ignore[arg-type]
        process.start()
        ours.recv()
        time.sleep(SETTLE_S)
        batches = round(SECONDS * RATE_HZ / BATCH)
        arguments = [json.dumps(robot.bus.arguments()), json.dumps(batch()), str(batches)]
        began_s = time.monotonic()
        late = subprocess.run([sys.executable, "-c", SENDER, *arguments], check=True, capture_output=True, text=True)
        took_s = time.monotonic() - began_s
        time.sleep(SETTLE_S)
        ours.send("end")
        count, cpu_s = ours.recv()
        process.join()
    print(f"sender: {float(late.stdout) * 1000:.1f} ms behind its schedule at the end")
    return (batches - count) * BATCH, cpu_s / (took_s + 2 * SETTLE_S)


if __name__ == "__main__":
    for figure in measure():
        print(figure)
